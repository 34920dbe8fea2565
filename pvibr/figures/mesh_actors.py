"""The meshes of a figure as actors: rigid ones, and ones posed on the GPU."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pyvista as pv

from pvibr.core import _vtk
from pvibr.figures.posing import SAMPLERS, MeshPose, RestMesh, posed_feature
from pvibr.figures.shapes import MeshShapes
from pvibr.gl.doubles import is_cut_out
from pvibr.maths.transforms import transform_normals, transform_points
from pvibr.maths.vectors import unit_vectors
from pvibr.meshes.parts import Part, as_parts

#: Relative margin of a box, so that it changes rarely.
_ROOM = 0.25
_SURFACE = 2  # VTK_SURFACE


class RigidMeshActor:
    """A mesh that moves with its joint: an ordinary actor."""

    def __init__(self, part, node):
        self.part, self.actor, self.node = part, part.actor, node

    def depth_actor(self):
        """Return the actor that draws depth."""
        return self.actor

    def release(self, window):
        """Release the actor's GPU resources."""
        self.actor.ReleaseGraphicsResources(window)

    def move(self, user, moment):
        """Move to the place of a moment."""
        self.actor.user_matrix = user @ self.local(moment)

    def local(self, moment) -> np.ndarray:
        """Return ``figure_from_mesh`` at a moment, shape (4, 4)."""
        return _node(moment, self.node)


class PosedMeshActor:
    """A mesh whose vertices are posed on the GPU."""

    def __init__(self, figure, index, part):
        self.figure, self.index, self.part = figure, index, part
        self.figure_mesh = figure_mesh = figure.meshes[index]
        if part.mesh.n_points != len(figure_mesh.points):
            counts = f'is drawn with {part.mesh.n_points} points and has {len(figure_mesh.points)}'
            msg = f'meshes[{index}] {counts}: the look must not split them (split_sharp_edges).'
            raise ValueError(msg)
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
        mapper = part.polydata_mapper()
        mapper.SetInputDataObject(self.mesh)
        # The shader's positions are neither shifted nor scaled.
        mapper.SetVBOShiftScaleMethod(mapper.DISABLE_SHIFT_SCALE)
        actor = part.new_actor(mapper)
        actor.PickableOff()  # a stand-in is picked
        actor.UseBoundsOff()
        posed_feature().attach(actor)
        return actor

    def _depth_double(self):
        """Return an actor that draws only depth, by a minimal shader."""
        mapper = _vtk.vtkPolyDataMapper()
        mapper.SetInputDataObject(self.mesh)
        mapper.ScalarVisibilityOff()
        mapper.SetVBOShiftScaleMethod(mapper.DISABLE_SHIFT_SCALE)
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

    def release(self, window):
        """Release the actors' GPU resources."""
        for actor in (self.actor, self._double):
            actor.ReleaseGraphicsResources(window)

    def aim(self, row, units):
        """Set the uniforms that locate the posed vertices."""
        for actor in (self.actor, self._double):
            uniforms = actor.GetShaderProperty().GetVertexCustomUniforms()
            uniforms.SetUniformi('ibr_posed_row', row)
            for name in SAMPLERS:
                uniforms.SetUniformi(name, units[name])

    def mesh_pose(self, moment) -> MeshPose:
        """Return the pose of the mesh at a moment."""
        shapes = () if self.shapes is None else self.shapes.active(moment.pose)
        if self.figure_mesh.skin is None:
            return MeshPose(None, self.rest_mesh.origin, *shapes)
        return MeshPose(self.figure_mesh.skin.matrices(moment.world), moment.origin, *shapes)

    def move(self, user, moment):
        """Move to the place of a moment, and update the bounding box."""
        self.actor.user_matrix = self._double.user_matrix = user @ self.local(moment)

    def local(self, moment) -> np.ndarray:
        """Return ``figure_from_posed`` at a moment, shape (4, 4); update the bounding box."""
        skinned = self.figure_mesh.skin is not None
        matrix = np.eye(4)
        matrix[:3, 3] = moment.origin if skinned else self.rest_mesh.origin
        if not skinned:
            matrix = _node(moment, self.figure_mesh.node) @ matrix
        self._hold(moved_bounds(np.linalg.inv(matrix), moment.bounds))
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


def as_mesh_actors(figure, looks, theme):
    """Return the meshes of a figure as actors."""
    out: list = []
    for i, figure_mesh in enumerate(figure.meshes):
        mesh = figure_mesh.mesh.copy(deep=False)
        mesh.point_data['Normals'] = unit_vectors(figure_mesh.normals)  # as posed ones are
        mesh.point_data.active_normals_name = 'Normals'
        part = as_parts(mesh, theme=theme, **(figure_mesh.look | looks))[0]
        still = figure_mesh.skin is None and figure_mesh.frames is None and not figure.layers(i)
        out.append(
            RigidMeshActor(part, figure_mesh.node) if still else PosedMeshActor(figure, i, part)
        )
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


def posed_part(figure, index, part, matrix, pose, skinning, bulge=1.0) -> Part:
    """Return a posed mesh as a part in world units."""
    mesh = part.mesh.copy(deep=False)
    points, normals = figure.posed(index, pose, skinning, bulge)
    mesh.SetPoints(pv.vtk_points(transform_points(matrix, points)))
    mesh.point_data['Normals'] = transform_normals(matrix, normals)
    return replace(part, mesh=mesh)
