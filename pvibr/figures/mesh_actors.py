"""The meshes of a figure as actors: rigid ones, and ones posed on the GPU."""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property

import numpy as np
import pyvista as pv

from pvibr.animation.figure_mesh import turned_by
from pvibr.animation.normals import turned
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
    #: Whether faces wind the other way.
    _turned = False

    @cached_property
    def _matrix(self):
        """Matrix of what moves."""
        matrix = _vtk.vtkMatrix4x4()
        for actor in self._moving():
            actor.SetUserMatrix(matrix)
        return matrix

    def move(self, user, moment):
        """Move to the place of a moment."""
        matrix = user @ self.local(moment)
        self._matrix.DeepCopy(matrix.ravel().tolist())
        if self.mirrors(matrix, moment) != self._turned:
            self._turned = not self._turned
            self._turn()

    def local(self, moment) -> np.ndarray:
        """Return the matrix of the actor in the figure's space at a moment, shape (4, 4)."""
        raise NotImplementedError

    def mirrors(self, matrix, _moment) -> bool:
        """Return whether the mesh is mirrored at a moment, with the actor's matrix (4, 4)."""
        return bool(signs_of(matrix) < 0)

    def mapper(self, mirrored):
        """Return a mapper for poses that mirror the mesh, or for those that do not."""
        return self._mirror_mapper if mirrored else self.actor.GetMapper()

    @cached_property
    def _mirror_mapper(self):
        return self._new_mapper(turned(pv.wrap(self.actor.GetMapper().GetInput())))

    def _new_mapper(self, mesh):
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
        """Return ``figure_from_mesh`` at a moment, shape (4, 4)."""
        return _node(moment, self.node)

    def _turn(self):
        mapper = self.actor.GetMapper()
        mapper.SetInputDataObject(turned(pv.wrap(mapper.GetInput())))


class WireMeshActor(RigidMeshActor):
    """Points or lines, posed on the CPU."""

    def __init__(self, figure, index, part):
        super().__init__(part, -1)
        self.figure, self.index = figure, index

    def local(self, moment) -> np.ndarray:
        """Return the matrix to the middle of the points, which are posed."""
        points, _ = self.figure.posed(self.index, moment.pose)
        matrix = np.eye(4)
        matrix[:3, 3] = points.mean(0)
        mesh = self.actor.GetMapper().GetInput()
        mesh.SetPoints(pv.vtk_points(points - matrix[:3, 3]))
        return matrix


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
        self.mesh = _with_spares(part.mesh, order, self.rest_mesh.points - self.rest_mesh.origin)
        self.actor = self._actor(part)
        self._double = self._depth_double()
        self._colors = self._morphed_colors()

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
        actor = part.new_actor(self._new_mapper(self.mesh))
        actor.PickableOff()  # a stand-in is picked
        actor.UseBoundsOff()
        posed_feature().attach(actor)
        return actor

    def _new_mapper(self, mesh):
        mapper = super()._new_mapper(mesh)
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
        double = pv.Actor()
        double.SetMapper(mapper)
        double.GetProperty().LightingOff()
        posed_feature().attach(double)
        return double

    def depth_actor(self):
        """Return the actor that draws depth: the double unless alpha matters."""
        actor = self.actor
        if actor.GetProperty().GetRepresentation() != _SURFACE or is_cut_out(actor):
            return actor
        if actor.HasTranslucentPolygonalGeometry() or self.part.alpha_cutoff is not None:
            return actor
        ours, theirs = self._double.GetProperty(), actor.GetProperty()
        ours.SetBackfaceCulling(theirs.GetBackfaceCulling())
        ours.SetFrontfaceCulling(theirs.GetFrontfaceCulling())
        return self._double

    def _moving(self) -> tuple:
        return self.actor, self._double

    def _turn(self):
        self.mesh.SetPolys(turned(self.mesh).GetPolys())

    def mirrors(self, matrix, moment) -> bool:
        """Return whether the mesh is mirrored at a moment, with the actor's matrix (4, 4)."""
        skinned = self.figure_mesh.skin is not None  # else the matrix has the node in it
        turns = skinned and turned_by(self.figure_mesh, moment.signs)
        return turns != super().mirrors(matrix, moment)

    def aim(self, row):
        """Set the first row of the posed vertices."""
        set_vertex_uniforms((self.actor, self._double), {'ibr_posed_row': row})

    def mesh_pose(self, moment) -> MeshPose:
        """Return the pose of the mesh at a moment."""
        shapes = () if self.shapes is None else self.shapes.active(moment.pose)
        if self.figure_mesh.skin is None:
            return MeshPose(None, self.rest_mesh.origin, *shapes)
        return MeshPose(self.figure_mesh.skin.matrices(moment.world), moment.origin, *shapes)

    def local(self, moment) -> np.ndarray:
        """Return ``figure_from_posed`` at a moment, shape (4, 4); update the bounding box."""
        matrix = np.eye(4)
        if self.figure_mesh.skin is not None:
            matrix[:3, 3] = moment.origin
            self._hold(moment.bounds - np.repeat(moment.origin, 2))
        else:
            matrix[:3, 3] = self.rest_mesh.origin
            matrix = _node(moment, self.figure_mesh.node) @ matrix
            self._hold(moved_bounds(inverses(matrix), moment.bounds))
        self._color(moment.pose)
        return matrix

    def _morphed_colors(self):
        """Return the colour array that morph targets change, or None."""
        if not any(morphs.has('colors') for morphs, _ in self.figure.layers(self.index)):
            return None
        colors = self.figure.colors(self.index)
        shown = self.mesh.point_data.get(self.figure_mesh.look.get('scalars') or '')
        same = colors is not None and shown is not None and colors.dtype == shown.dtype
        return shown if same and colors.shape[1:] == shown.shape[1:] else None

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
        room = _ROOM * (high - low).max()
        self.box = np.stack([low - room, high + room], 1).ravel()
        self.mesh.points[-2:] = self.box.reshape(3, 2).T
        self.mesh.GetPoints().Modified()
        self.mesh.Modified()


def drawn_figure(figure, looks, theme):
    """Return a figure as it is drawn: with sharp edges split if its look or the theme says so."""
    theme = pv.global_theme if theme is None else theme
    angles: list = []
    for i, figure_mesh in enumerate(figure.meshes):
        look = {key: v for key, v in (figure_mesh.look | looks).items() if v is not None}
        smooth = look.get('smooth_shading', theme.smooth_shading or look.get('pbr'))
        split = smooth and look.get('split_sharp_edges', theme.split_sharp_edges)
        angle = look.get('feature_angle', theme.sharp_edges_feature_angle)
        angles.append(angle if split and not _is_still(figure, i) else None)
    return split_figure(figure, angles)


def _is_still(figure, i):
    """Return whether no point of a mesh moves within it."""
    mesh = figure.meshes[i]
    return mesh.skin is None and mesh.frames is None and not figure.layers(i)


def as_mesh_actors(figure, looks, theme):
    """Return the meshes of a figure as actors."""
    draws = PosedDraws()
    out: list = []
    for i, figure_mesh in enumerate(figure.meshes):
        mesh = figure_mesh.mesh.copy(deep=False)
        mesh.point_data['Normals'] = unit_vectors(figure_mesh.normals)  # as posed ones are
        mesh.point_data.active_normals_name = 'Normals'
        still = _is_still(figure, i)
        # The edges of others have been split already.
        kept = {} if still else {'split_sharp_edges': False}
        part = as_parts(mesh, theme=theme, **(figure_mesh.look | looks | kept))[0]
        if still:
            out.append(RigidMeshActor(part, figure_mesh.node))
        elif not part.mesh.n_cells:
            out.append(WireMeshActor(figure, i, part))
        else:
            out.append(PosedMeshActor(figure, i, part, draws))
    return out


def _node(moment, node):
    return np.eye(4) if node < 0 else moment.world[node]


def _with_spares(mesh, order, points):
    """Return a mesh with two more points and a degenerate cell."""
    n = len(order) - 2
    out = pv.PolyData()
    out.points = points.astype(np.float32)
    out.regular_faces = np.concatenate([mesh.regular_faces, [[n, n + 1, n + 1]]])
    for name, values in mesh.point_data.items():
        out.point_data[name] = np.asarray(values)[order]
    for name, values in mesh.cell_data.items():
        out.cell_data[name] = np.concatenate([values, values[:1]])
    for theirs, ours in ((mesh.point_data, out.point_data), (mesh.cell_data, out.cell_data)):
        for kind in ('active_normals_name', 'active_texture_coordinates_name'):
            if getattr(theirs, kind) is not None:
                setattr(ours, kind, getattr(theirs, kind))
        ours.active_scalars_name = theirs.active_scalars_name
    return out


def moved_bounds(matrix, bounds):
    """Return the bounds of a transformed box."""
    if bounds[0] > bounds[1]:
        return np.asarray(bounds)
    low, high = _low(bounds), _high(bounds)
    center = matrix[:3, :3] @ (low + high) / 2 + matrix[:3, 3]
    half = np.abs(matrix[:3, :3]) @ (high - low) / 2
    return np.stack([center - half, center + half], 1).ravel()


def _low(bounds):
    return np.asarray(bounds)[::2]


def _high(bounds):
    return np.asarray(bounds)[1::2]


def moved_figure(mesh, matrix):
    """Return a posed figure, a mesh or several, moved by a matrix, a mirroring one included."""
    if isinstance(mesh, pv.PolyData):
        return moved(mesh, matrix)
    for i, block in enumerate(mesh):
        mesh.replace(i, moved(block, matrix))
    return mesh


def posed_part(figure, index, part, matrix, pose, skinning, bulge=1.0) -> Part:
    """Return a posed mesh as a part in world units."""
    mesh = part.mesh.copy(deep=False)
    world = figure.world(pose)
    points, normals = figure.posed(index, pose, skinning, bulge)
    mesh.SetPoints(pv.vtk_points(transform_points(matrix, points)))
    mesh.point_data['Normals'] = transform_normals(matrix, normals)
    mirrored = figure.meshes[index].mirrors(world) != (np.linalg.det(matrix[:3, :3]) < 0)
    return replace(part, mesh=turned(mesh) if mirrored else mesh)
