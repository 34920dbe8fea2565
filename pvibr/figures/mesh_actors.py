"""The meshes of a figure as actors: rigid ones, and ones posed on the GPU."""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property

import numpy as np
import pyvista as pv

from pvibr.animation.figure_mesh import is_mirrored_by
from pvibr.animation.normals import with_flipped_winding
from pvibr.animation.splitting import split_figure
from pvibr.core import _vtk
from pvibr.figures.posing import MeshPose, PosedDraws, RestMesh, posed_feature
from pvibr.figures.shapes import MeshShapes
from pvibr.gl import set_vertex_uniforms
from pvibr.gl.doubles import is_cut_out
from pvibr.maths.transforms import inverses, signs_of, transform_normals, transform_points
from pvibr.maths.vectors import unit_vectors
from pvibr.meshes.parts import Part, as_parts
from pvibr.meshes.surfaces import moved

#: Relative margin of a box, so that it changes rarely.
_ROOM = 0.25
_SURFACE = 2  # VTK_SURFACE


class MeshActor:
    """A mesh of a figure as an actor; where a pose mirrors it, its faces wind the other way.

    VTK lights and culls by the winding that it sees.
    """

    part: Part
    actor: pv.Actor
    #: Whether only joints move it: then a moment may be of many poses.
    moves_with_joints = True
    #: Whether faces wind the other way.
    _turned = False

    @cached_property
    def _matrix(self):
        """The matrix shared by the actors that move."""
        matrix = _vtk.vtkMatrix4x4()
        for actor in self._moving():
            actor.SetUserMatrix(matrix)
        return matrix

    def move(self, world_from_figure, moment):
        """Move to the pose of a moment."""
        world_from_mesh = world_from_figure @ self.local(moment)
        self._matrix.DeepCopy(world_from_mesh.ravel().tolist())
        if self.mirrors(world_from_mesh, moment) != self._turned:
            self._turned = not self._turned
            self._turn()

    def local(self, moment) -> np.ndarray:
        """Return the matrix of the actor in the figure's space at a moment, shape (..., 4, 4)."""
        raise NotImplementedError

    def mirrors(self, world_from_mesh, _moment):
        """Return whether the mesh is mirrored at a moment, with the actor's matrix (..., 4, 4)."""
        return signs_of(world_from_mesh) < 0

    def mapper(self, mirrored):
        """Return a mapper for poses that mirror the mesh, or for those that do not."""
        return self._mirror_mapper if mirrored else self.actor.GetMapper()

    @cached_property
    def _mirror_mapper(self):
        return self.mapper_of(with_flipped_winding(pv.wrap(self.actor.GetMapper().GetInput())))

    def mapper_of(self, mesh):
        """Return a mapper of another mesh that looks like this one."""
        mapper = self.part.polydata_mapper()
        mapper.SetInputDataObject(mesh)
        return mapper

    def depth_actor(self):
        """Return the actor that draws depth."""
        return self.actor

    def release(self, window):
        """Release GPU resources."""
        for actor in self._moving():
            actor.ReleaseGraphicsResources(window)

    def _moving(self) -> tuple:
        return (self.actor,)

    def _turn(self):
        """Wind the faces the other way."""
        raise NotImplementedError


class RigidMeshActor(MeshActor):
    """A mesh that moves with its joint: an ordinary actor."""

    def __init__(self, part, node):
        self.part, self.actor, self.node = part, part.actor, node

    def local(self, moment) -> np.ndarray:
        """Return ``figure_from_mesh`` at a moment, shape (..., 4, 4)."""
        return _joint_matrix(moment, self.node)

    def _turn(self):
        mapper = self.actor.GetMapper()
        mapper.SetInputDataObject(with_flipped_winding(pv.wrap(mapper.GetInput())))


class WireMeshActor(RigidMeshActor):
    """Points or lines, posed on the CPU."""

    moves_with_joints = False

    def __init__(self, figure, index, part):
        super().__init__(part, -1)
        self.figure, self.index = figure, index

    def local(self, moment) -> np.ndarray:
        """Return the matrix to the middle of the points, which are posed."""
        points, _ = self.figure.posed(self.index, moment.pose)
        figure_from_middle = np.eye(4)
        figure_from_middle[:3, 3] = points.mean(0)
        mesh = self.actor.GetMapper().GetInput()
        mesh.SetPoints(pv.vtk_points(points - figure_from_middle[:3, 3]))
        return figure_from_middle


class PosedMeshActor(MeshActor):
    """A mesh whose vertices are posed on the GPU."""

    def __init__(self, figure, index, part, draws):
        self.figure, self.index, self.part, self.draws = figure, index, part, draws
        self.figure_mesh = figure_mesh = figure.meshes[index]
        # Two more points hold the bounding box; they copy a vertex, and draw nothing.
        spare = int(part.mesh.regular_faces[0, 0])
        order = np.concatenate([np.arange(len(figure_mesh.points)), [spare, spare]])
        self.order = order
        shapes = MeshShapes(figure, index, order)
        self.rest_mesh = self._rest_mesh(shapes)
        self.shapes = self.rest_mesh.shapes
        self.box = np.array([1.0, -1.0] * 3)
        self.mesh = _with_spare_points(
            part.mesh, order, self.rest_mesh.points - self.rest_mesh.origin
        )
        self.actor = self._actor(part)
        self._double = self._depth_double()
        self._colors = self._morphed_colors()
        is_shaped = bool(self.shapes) or self._colors is not None
        self.moves_with_joints = self.figure_mesh.skin is not None and not is_shaped

    def _rest_mesh(self, shapes):
        order = shapes.order
        points, normals = (values[order] for values in shapes.neutral)
        rest_mesh = RestMesh(points, normals, shapes=shapes if len(shapes) else None)
        skin = self.figure_mesh.skin
        if skin is not None:
            rest_mesh.joints, rest_mesh.weights = skin.joints[order], skin.weights[order]
            rest_mesh.centers = skin.centers
        return rest_mesh

    def _actor(self, part):
        actor = part.new_actor(self.mapper_of(self.mesh))
        actor.PickableOff()  # a stand-in is picked
        actor.UseBoundsOff()
        posed_feature().attach(actor)
        return actor

    def mapper_of(self, mesh):
        """Return a mapper of another mesh that looks like this one."""
        mapper = super().mapper_of(mesh)
        self._watch(mapper)
        return mapper

    def _watch(self, mapper):
        # The shader's positions are neither shifted nor scaled.
        mapper.SetVBOShiftScaleMethod(mapper.DISABLE_SHIFT_SCALE)
        self.draws.watch(mapper)

    def _depth_double(self):
        """Return an actor that draws only depth, by a minimal shader."""
        mapper = _vtk.vtkPolyDataMapper()
        mapper.SetInputDataObject(self.mesh)
        mapper.ScalarVisibilityOff()
        self._watch(mapper)
        depth_double = pv.Actor()
        depth_double.SetMapper(mapper)
        depth_double.GetProperty().LightingOff()
        posed_feature().attach(depth_double)
        return depth_double

    def depth_actor(self):
        """Return the actor that draws depth: the double unless alpha matters."""
        actor = self.actor
        if actor.GetProperty().GetRepresentation() != _SURFACE or is_cut_out(actor):
            return actor
        if actor.HasTranslucentPolygonalGeometry() or self.part.alpha_cutoff is not None:
            return actor
        double_property, shown_property = self._double.GetProperty(), actor.GetProperty()
        double_property.SetBackfaceCulling(shown_property.GetBackfaceCulling())
        double_property.SetFrontfaceCulling(shown_property.GetFrontfaceCulling())
        return self._double

    @property
    def has_morphed_colors(self) -> bool:
        """Whether poses change its colours."""
        return self._colors is not None

    def _moving(self) -> tuple:
        return self.actor, self._double

    def _turn(self):
        turn(self.mesh)

    def mirrors(self, world_from_mesh, moment):
        """Return whether the mesh is mirrored at a moment, with the actor's matrix (..., 4, 4)."""
        is_skinned = self.figure_mesh.skin is not None  # else the matrix has the node in it
        joints_mirror = is_skinned and is_mirrored_by(self.figure_mesh, moment.signs)
        return joints_mirror != super().mirrors(world_from_mesh, moment)

    def aim(self, first_row):
        """Set the first row of the posed vertices."""
        set_vertex_uniforms((self.actor, self._double), {'ibr_posed_row': first_row})

    def mesh_pose(self, moment) -> MeshPose:
        """Return the pose of the mesh at a moment."""
        shapes = () if self.shapes is None else self.shapes.active(moment.pose)
        if self.figure_mesh.skin is None:
            return MeshPose(None, self.rest_mesh.origin, *shapes)
        return MeshPose(self.figure_mesh.skin.matrices(moment.world), moment.origin, *shapes)

    def pose_here(self, mesh, pose, figure_from_posed, *skinning):
        """Pose its mesh, or a copy of it, by the CPU, relative to where an actor draws it."""
        posed_from_figure = inverses(figure_from_posed)
        points, normals = self.figure.posed(self.index, pose, *skinning)
        mesh.points[: len(points)] = transform_points(posed_from_figure, points)
        mesh.GetPoints().Modified()
        normals = unit_vectors(transform_normals(posed_from_figure, normals))
        mesh.point_data['Normals'][: len(normals)] = normals
        mesh.GetPointData().GetArray('Normals').Modified()
        mesh.Modified()

    def use_gpu(self, is_used):
        """Draw the vertices that the GPU poses, or those of the mesh."""
        feature = posed_feature()
        for actor in self._moving():
            (feature.attach if is_used else feature.detach)(actor)

    def local(self, moment) -> np.ndarray:
        """Return ``figure_from_posed`` at a moment, (..., 4, 4); update the bounding box."""
        figure_from_posed = np.eye(4)
        if self.figure_mesh.skin is not None:
            figure_from_posed[:3, 3] = moment.origin
            self._hold(moment.bounds - np.repeat(moment.origin, 2))
        else:
            figure_from_posed[:3, 3] = self.rest_mesh.origin
            figure_from_posed = _joint_matrix(moment, self.figure_mesh.node) @ figure_from_posed
            self._hold(transformed_bounds(inverses(figure_from_posed), moment.bounds))
        self._color(moment.pose)
        return figure_from_posed

    def _morphed_colors(self):
        """Return the colour array that morph targets change, or None."""
        if not any(morphs.has('colors') for morphs, _ in self.figure.layers(self.index)):
            return None
        colors = self.figure.colors(self.index)
        shown_colors = self.mesh.point_data.get(self.figure_mesh.look.get('scalars') or '')
        if colors is None or shown_colors is None or colors.dtype != shown_colors.dtype:
            return None
        return shown_colors if colors.shape[1:] == shown_colors.shape[1:] else None

    def _color(self, pose):
        """Show the colours of a pose, computed on the CPU since they change rarely."""
        if self._colors is None:
            return
        colors = self.figure.colors(self.index, pose)[self.order]
        if not np.array_equal(colors, self._colors):
            self._colors[:] = colors
            self._colors.VTKObject.Modified()
            self.mesh.Modified()

    def _hold(self, bounds):
        """Enlarge the mapper's box to hold bounds: VTK culls boxes outside the view."""
        old = self.box
        if bounds[0] > bounds[1] or (
            (_low(old) <= _low(bounds)).all() and (_high(bounds) <= _high(old)).all()
        ):
            return
        if old[0] > old[1]:
            old = bounds
        low, high = np.minimum(_low(old), _low(bounds)), np.maximum(_high(old), _high(bounds))
        box_margin = _ROOM * (high - low).max()
        self.box = np.stack([low - box_margin, high + box_margin], 1).ravel()
        self.mesh.points[-2:] = self.box.reshape(3, 2).T
        self.mesh.GetPoints().Modified()
        self.mesh.Modified()


def drawn_figure(figure, options, theme):
    """Return a figure as it is drawn: with sharp edges split if its look or the theme says so."""
    theme = pv.global_theme if theme is None else theme
    feature_angles: list = []
    for i, figure_mesh in enumerate(figure.meshes):
        look = {key: v for key, v in (figure_mesh.look | options).items() if v is not None}
        is_smooth = look.get('smooth_shading', theme.smooth_shading or look.get('pbr'))
        splits_edges = is_smooth and look.get('split_sharp_edges', theme.split_sharp_edges)
        angle = look.get('feature_angle', theme.sharp_edges_feature_angle)
        feature_angles.append(angle if splits_edges and not _is_still(figure, i) else None)
    return split_figure(figure, feature_angles)


def _is_still(figure, i):
    """Return whether no point of a mesh moves within it."""
    mesh = figure.meshes[i]
    return mesh.skin is None and mesh.frames is None and not figure.layers(i)


def as_mesh_actors(figure, mesh_options, theme):
    """Return the meshes of a figure as actors."""
    draws = PosedDraws()
    mesh_actors: list = []
    for i, figure_mesh in enumerate(figure.meshes):
        mesh = figure_mesh.mesh.copy(deep=False)
        mesh.point_data['Normals'] = unit_vectors(figure_mesh.normals)  # as posed ones are
        mesh.point_data.active_normals_name = 'Normals'
        is_still = _is_still(figure, i)
        # The edges of others have been split already.
        split_option = {} if is_still else {'split_sharp_edges': False}
        part = as_parts(mesh, theme=theme, **(figure_mesh.look | mesh_options | split_option))[0]
        if is_still:
            mesh_actors.append(RigidMeshActor(part, figure_mesh.node))
        elif not part.mesh.n_cells:
            mesh_actors.append(WireMeshActor(figure, i, part))
        else:
            mesh_actors.append(PosedMeshActor(figure, i, part, draws))
    return mesh_actors


def turn(mesh):
    """Wind the faces of a mesh the other way."""
    mesh.SetPolys(with_flipped_winding(mesh).GetPolys())


def _joint_matrix(moment, joint_index):
    return np.eye(4) if joint_index < 0 else moment.world[..., joint_index, :, :]


def _with_spare_points(mesh, order, points):
    """Return a mesh with two more points and a degenerate cell."""
    n = len(order) - 2
    padded_mesh = pv.PolyData()
    padded_mesh.points = points.astype(np.float32)
    padded_mesh.regular_faces = np.concatenate([mesh.regular_faces, [[n, n + 1, n + 1]]])
    for name, values in mesh.point_data.items():
        padded_mesh.point_data[name] = np.asarray(values)[order]
    for name, values in mesh.cell_data.items():
        padded_mesh.cell_data[name] = np.concatenate([values, values[:1]])
    for data_name in ('point_data', 'cell_data'):
        source_data, padded_data = (getattr(m, data_name) for m in (mesh, padded_mesh))
        for active_kind in ('active_normals_name', 'active_texture_coordinates_name'):
            if getattr(source_data, active_kind) is not None:
                setattr(padded_data, active_kind, getattr(source_data, active_kind))
        padded_data.active_scalars_name = source_data.active_scalars_name
    return padded_mesh


def transformed_bounds(matrix, bounds):
    """Return the bounds of a transformed box."""
    if bounds[0] > bounds[1]:
        return np.asarray(bounds)
    low, high = _low(bounds), _high(bounds)
    center = matrix[:3, :3] @ (low + high) / 2 + matrix[:3, 3]
    half_size = np.abs(matrix[:3, :3]) @ (high - low) / 2
    return np.stack([center - half_size, center + half_size], 1).ravel()


def _low(bounds):
    return np.asarray(bounds)[::2]


def _high(bounds):
    return np.asarray(bounds)[1::2]


def moved_figure(mesh, world_from_figure):
    """Return a posed figure, a mesh or several, moved by a matrix, a mirroring one included."""
    if isinstance(mesh, pv.PolyData):
        return moved(mesh, world_from_figure)
    for i, block in enumerate(mesh):
        mesh.replace(i, moved(block, world_from_figure))
    return mesh


def posed_part(figure, index, part, world_from_figure, pose, skinning, bulge=1.0) -> Part:
    """Return a posed mesh as a part in world units."""
    mesh = part.mesh.copy(deep=False)
    world = figure.world(pose)
    points, normals = figure.posed(index, pose, skinning, bulge)
    mesh.SetPoints(pv.vtk_points(transform_points(world_from_figure, points)))
    mesh.point_data['Normals'] = transform_normals(world_from_figure, normals)
    is_flipped = np.linalg.det(world_from_figure[:3, :3]) < 0
    is_mirrored = figure.meshes[index].mirrors(world) != is_flipped
    return replace(part, mesh=with_flipped_winding(mesh) if is_mirrored else mesh)
