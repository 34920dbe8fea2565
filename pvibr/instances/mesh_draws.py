"""Near instances drawn as meshes, many per draw call."""

from __future__ import annotations

from functools import partial

import numpy as np
import pyvista as pv

from pvibr.gl import shader_source
from pvibr.gl.doubles import is_cut_out
from pvibr.gl.feature import Feature, sections
from pvibr.instances.mesh_pool import cutoff, with_looks
from pvibr.meshes.decimate import take_arrays
from pvibr.meshes.parts import draws_more
from pvibr.things.shader_draws import ShaderDraws

#: Triangles per draw, and the most in large sets: enough to hide the cost of a draw call, and few
#: enough that unused copies cost little.
_TRIANGLES, MAX_TRIANGLES = 16_384, 65_536
#: Scale of copies in the vertex buffer, exact, so that they do not add to its bounds.
_SHRUNK = 2.0**-60


class MeshDraws:
    """The instances of one level of a group, in entries shared by all levels."""

    def __init__(self, level, capacity, center, matrix, binder, translucent=False):
        self.level, self._translucent = level, translucent
        self._parts = self._part_draws(capacity, center, matrix, binder, translucent)
        self.is_shown = False

    def _part_draws(self, *shared) -> list:
        """Return the draws of each part."""
        pairs = zip(self.level.parts, self.level.materials, strict=True)
        return [MeshPartDraws(part, material, *shared) for part, material in pairs]

    @property
    def blends(self) -> bool:
        """Whether any part is translucent."""
        for part in self.level.parts:
            if part.actor.HasTranslucentPolygonalGeometry():
                return True
        return self._translucent

    @property
    def failure(self) -> str | None:
        """Error of the shaders, or None."""
        return next((draws.failure for draws in self._parts if draws.failure), None)

    def check(self):
        """Note shaders that failed to draw."""
        for draws in self._parts:
            draws.check()

    def set_inputs(self, entries, *inputs):
        """Set the textures and uniforms that all parts share."""
        for draws in self._parts:
            draws.set_inputs(entries, *inputs)

    def bound(self, half):
        """Set the half sides of the bounds around the actors' position."""
        for draws in self._parts:
            draws.bound(half)

    def tint(self, color):
        """Paint all instances in one colour, or none."""
        for draws in self._parts:
            draws.tint(color)

    def show(self, first, end, outside) -> list:
        """Draw entries first to end; return new actors.

        If the eye is outside all of them, hidden sides are culled.
        """
        self.is_shown, new_actors = end > first, []
        for draws in self._parts:
            new_actors += draws.show(first, end, outside)
        return new_actors

    def hide(self):
        """Draw nothing."""
        self.is_shown = False
        for draws in self._parts:
            draws.show_spans(())

    def actors(self) -> list:
        """Return all actors so far."""
        return [actor for draws in self._parts for actor in draws.actors]

    def depths(self) -> list:
        """Return the actors that draw the depth of visible instances."""
        return [actor for draws in self._parts for actor in draws.depths()]

    def release(self, window):
        """Free GPU memory; the context is current."""
        for draws in self._parts:
            draws.entries = None  # the group owns them
            draws.release(window)


def can_batch(level, triangles=_TRIANGLES) -> bool:
    """Return whether several copies fit a draw of triangles, and no geometry shader is needed."""
    light = all(2 * part.mesh.n_cells <= triangles for part in level.parts)
    return light and all(_is_plain(part.actor) for part in level.parts)


def _is_plain(actor):
    shows_vertices = actor.GetProperty().GetVertexVisibility()
    return not (shows_vertices or draws_more(actor, actor.GetMapper().GetInput()))


class MeshPartDraws(ShaderDraws):
    """Draws of one part of a mesh, each of as many copies as its vertex buffer holds."""

    def __init__(self, part, material, capacity, center, matrix, binder, translucent):
        triangle_count = max(part.mesh.n_cells, 1)
        draw_triangles = min(max(_TRIANGLES, capacity * triangle_count // 16), MAX_TRIANGLES)
        chunk = max(1, min(capacity, draw_triangles // triangle_count))
        super().__init__(draws=0, chunk=chunk, binder=binder)
        self.part, self._center, self._matrix = part, center, matrix
        self._translucent = translucent
        self.set_feature(self._feature())
        self._material, self._property = material, part.actor.GetProperty()
        self._half = np.zeros(3)
        self._copies: pv.PolyData | None = None
        self._shared_uniforms: dict = {}
        self._tint: dict = {}
        self._depths: _DepthDraws | None = None

    def set_inputs(self, entries, textures, view_uniforms, uniforms):
        """Set the entries, and the textures and uniforms of all parts."""
        self.entries, self.textures = entries, textures
        self.view_uniforms, self._shared_uniforms = view_uniforms, uniforms
        self.uniforms = uniforms | self._tint if self._tint else uniforms
        alpha_cutoff = cutoff(self.part)
        if self.own_uniforms.get('ibr_cutoff') != alpha_cutoff:
            self.own_uniforms = {'ibr_cutoff': alpha_cutoff}

    def tint(self, color):
        """Paint all instances in one colour, or none."""
        self._tint = {} if color is None else {'ibr_tint': (*color, 1.0), 'ibr_multiply': 0}
        self.uniforms = self._shared_uniforms | self._tint

    def _feature(self, *, depth=False) -> Feature:
        """Return the shader of the copies."""
        section = sections(shader_source(__file__))
        texts = section['vertex.instances'], section['vertex.begin']
        return draws_feature(self.part.mesh, *texts, depth=depth)

    def show(self, first, end, outside) -> list:
        """Draw entries first to end; return new actors."""
        entry_spans = [(i, i + self.chunk) for i in range(first, end, self.chunk)]
        if entry_spans:
            entry_spans[-1] = entry_spans[-1][0], end
        new_actors = []
        if len(entry_spans) > len(self.actors):
            new_actors = self.grow(len(entry_spans), self._new_actor)
        if entry_spans:
            self._set_property(self._material.material(outside and not self._translucent))
        self.show_spans(entry_spans)
        return new_actors

    def _set_property(self, prop):
        if prop is not self._property:
            self._property = prop
            for actor in self.actors:
                actor.SetProperty(prop)

    def bound(self, half):
        """Set the half sides of the bounds around the actors' position."""
        if not np.array_equal(half, self._half):
            self._half = half
            if self.actors:
                spread(self.mapper.GetInput(), half)

    def depths(self) -> list:
        """Return actors that draw depth, by a minimal shader if the material allows."""
        visible = [actor for actor in self.actors if actor.GetVisibility()]
        is_cut = self.part.alpha_cutoff is not None or is_cut_out(self.part.actor)
        if not visible or is_cut or visible[0].HasTranslucentPolygonalGeometry():
            return visible
        if self._depths is None:
            self._depths = _DepthDraws(self.mapper.GetInput(), self._new_depth_actor, self._binder)
        self._depths.set_inputs(self.entries, *self._inputs())
        return self._depths.show([span for span in self._spans if span[1] > 0])

    def _new_depth_actor(self, mapper):
        """Return an actor that draws only depth."""
        actor, prop = pv.Actor(), self.part.actor.GetProperty()
        actor.SetMapper(mapper)
        actor.GetProperty().LightingOff()
        actor.GetProperty().SetBackfaceCulling(prop.GetBackfaceCulling())
        actor.GetProperty().SetFrontfaceCulling(prop.GetFrontfaceCulling())
        actor.SetUserMatrix(self._matrix)
        self._feature(depth=True).attach(actor)
        return actor

    def release(self, window):
        """Free GPU memory; the context is current."""
        super().release(window)
        if self._depths is not None:
            self._depths.entries = None
            self._depths.release(window)
            self._depths = None

    def _new_actor(self):
        if not self.actors:
            self._fill()
        actor = with_looks(self.part, self.mapper)
        actor.SetProperty(self._property)
        actor.SetUserMatrix(self._matrix)
        actor.PickableOff()
        actor.UseBoundsOff()
        actor.SetForceTranslucent(self._translucent)
        self._feature().attach(actor)
        return actor

    def _fill(self):
        """Fill the mapper with copies of the mesh."""
        self.mapper.ShallowCopy(self.part.actor.GetMapper())
        self.mapper.SetVBOShiftScaleMethod(self.mapper.DISABLE_SHIFT_SCALE)
        # Held: who asks the mapper for it would wrap it again.
        self._copies = copies(self.part.mesh, self.chunk, self._center)
        spread(self._copies, self._half)
        self.mapper.SetInputDataObject(self._copies)


class _DepthDraws(ShaderDraws):
    """Draws of the same copies for depth only; no renderer lists them."""

    def __init__(self, mesh, new_actor, binder):
        super().__init__(draws=0, binder=binder)
        self.mapper.SetVBOShiftScaleMethod(self.mapper.DISABLE_SHIFT_SCALE)
        self.mapper.SetInputDataObject(mesh)
        self._new_actor = new_actor

    def set_inputs(self, entries, textures, view_uniforms, uniforms):
        """Set the inputs of the draws for colour."""
        self.entries, self.textures = entries, textures
        self.view_uniforms, self.uniforms = view_uniforms, uniforms

    def show(self, spans) -> list:
        """Return the actors that draw spans of entries."""
        self.grow(len(spans), partial(self._new_actor, self.mapper))
        self.show_spans(spans)
        return self.actors[: len(spans)]


def draws_feature(mesh, declarations, begin, *, depth=False, around_normal=('', '')) -> Feature:
    """Return the shader of copies of a mesh whose vertices find their instances by some text."""
    section = sections(shader_source(__file__))
    defines = f'#define VERTICES {mesh.n_points}.0\n#define SHRUNK {_SHRUNK!r}\n'
    defines += f'#define CELL_NORMALS {int(mesh.cell_data.active_normals is not None)}\n'
    texts = defines, section['vertex.declare'], declarations, '//VTK::PositionVC::Dec\n'
    vertex = {
        'VTK::PositionVC::Dec': ''.join(texts),
        'VTK::CustomBegin::Impl': begin + section['vertex.placed'],
        'VTK::Normal::Impl': section['vertex.normal'].join(around_normal),
    }
    if depth:
        return Feature('mesh_draws', vertex)
    fragment = {
        'VTK::PositionVC::Dec': defines + section['fragment.declare'] + texts[-1],
        'VTK::Normal::Dec': section['fragment.declare_normal'],
        'VTK::Normal::Impl': section['fragment.normal'],
    }
    return Feature('mesh_draws', vertex, fragment)


def copies(mesh, count, origin) -> pv.PolyData:
    """Return shrunk copies of a mesh about an origin, and an empty cell that sets bounds."""
    n_points, faces = mesh.n_points, np.asarray(mesh.regular_faces)
    points = np.tile(((mesh.points - origin) * _SHRUNK).astype(np.float32), (count, 1))
    first_points = n_points * np.arange(count)[:, None, None]
    bounds_face = n_points * count + np.array([[0, 1, 1]])
    copied = pv.PolyData.from_regular_faces(
        np.concatenate([points, np.zeros((2, 3), np.float32)]),
        np.concatenate([(faces + first_points).reshape(-1, 3), bounds_face]),
    )
    source_points, source_cells = (np.tile(np.arange(n), count) for n in (n_points, len(faces)))
    return take_arrays(mesh, copied, np.append(source_points, [0, 0]), np.append(source_cells, 0))


def spread(mesh, half):
    """Set the half sides of the bounds of copies."""
    points = mesh.GetPoints()
    for sign, row in ((-1, 2), (1, 1)):
        points.SetPoint(points.GetNumberOfPoints() - row, *(sign * half).tolist())
    points.Modified()
