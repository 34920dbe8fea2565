"""Instances near enough to be drawn as meshes, many a draw."""

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
from pvibr.scene.shader_draws import ShaderDraws

#: Triangles of a draw, more of large sets: what a draw costs by itself is little beside them, and
#: so are those that it leaves unused.
_TRIANGLES, _MOST = 16_384, 65_536
#: Scale of copies in a vertex buffer, without rounding: they add nothing to the bounds it has.
_SHRUNK = 2.0**-60


class MeshDraws:
    """The instances of one level of a group, in entries that all levels share."""

    def __init__(self, level, capacity, center, matrix, binder, translucent=False):
        self.level, self._translucent = level, translucent
        shared = capacity, center, matrix, binder, translucent
        pairs = zip(level.parts, level.materials, strict=True)
        self._parts = [PartDraws(part, material, *shared) for part, material in pairs]

    @property
    def blends(self) -> bool:
        """Whether any part is translucent."""
        parts = self.level.parts
        return self._translucent or any(p.actor.HasTranslucentPolygonalGeometry() for p in parts)

    @property
    def failure(self) -> str | None:
        """Error of the shaders, or None."""
        return next((draws.failure for draws in self._parts if draws.failure), None)

    def check(self):
        """Note shaders that were not drawn with."""
        for draws in self._parts:
            draws.check()

    def set_inputs(self, entries, textures, uniforms):
        """Set what all draws have in common."""
        for draws in self._parts:
            draws.entries, draws.textures = entries, textures
            draws.uniforms = uniforms | {'ibr_cutoff': cutoff(draws.part)}

    def bound(self, half):
        """Have VTK know about how far it reaches from the place of the actors, along each axis."""
        for draws in self._parts:
            draws.bound(half)

    def tint(self, color):
        """Set one colour for all instances, over their looks."""
        for draws in self._parts:
            draws.tint = {} if color is None else {'ibr_tint': (*color, 1.0), 'ibr_multiply': 0}

    def show(self, first, end, outside) -> list:
        """Draw the entries from the first to the end; return new actors.

        If the eye is outside all of them, the sides that it cannot see are left out.
        """
        return [actor for draws in self._parts for actor in draws.show(first, end, outside)]

    def hide(self):
        """Draw nothing."""
        for draws in self._parts:
            draws.show_spans(())

    def actors(self) -> list:
        """Return every actor made so far."""
        return [actor for draws in self._parts for actor in draws.actors]

    def depths(self) -> list:
        """Return the actors that draw the depth of what is shown."""
        return [actor for draws in self._parts for actor in draws.depths()]

    def release(self, window):
        """Free GPU memory; the context is current."""
        for draws in self._parts:
            draws.entries = None  # they are the group's
            draws.release(window)


def suits(level) -> bool:
    """Return whether parts are surfaces that no geometry shader draws, and several fit a draw."""
    light = all(2 * part.mesh.n_cells <= _TRIANGLES for part in level.parts)
    return light and all(_is_plain(part.actor) for part in level.parts)


def _is_plain(actor):
    vertices = actor.GetProperty().GetVertexVisibility()
    return not (vertices or draws_more(actor, actor.GetMapper().GetInput()))


class PartDraws(ShaderDraws):
    """Draws of one part of a mesh, each of as many copies as its vertex buffer holds."""

    def __init__(self, part, material, capacity, center, matrix, binder, translucent):
        cells = max(part.mesh.n_cells, 1)
        triangles = min(max(_TRIANGLES, capacity * cells // 16), _MOST)
        chunk = max(1, min(capacity, triangles // cells))
        super().__init__(draws=0, chunk=chunk, binder=binder)
        self.part, self._center, self._matrix = part, center, matrix
        self._translucent = translucent
        self.set_feature(_feature(part.mesh))
        self.tint: dict = {}
        self._material, self._worn = material, part.actor.GetProperty()
        self._half = np.zeros(3)
        self._depths: _DepthDraws | None = None

    def show(self, first, end, outside) -> list:
        """Draw the entries from the first to the end; return new actors."""
        spans = [(i, min(i + self.chunk, end)) for i in range(first, end, self.chunk)]
        new = self.grow(len(spans), self._made)
        if spans:
            self._wear(self._material.material(outside and not self._translucent))
        self.show_spans(spans)
        return new

    def _wear(self, prop):
        if prop is not self._worn:
            self._worn = prop
            for actor in self.actors:
                actor.SetProperty(prop)

    def bound(self, half):
        """Have VTK know about how far it reaches from the place of the actors, along each axis."""
        if not np.array_equal(half, self._half):
            self._half = half
            if self.actors:
                spread(self.mapper.GetInput(), half)

    def depths(self) -> list:
        """Return actors that draw the depth of what is shown, by a minimal shader if that may."""
        shown = [actor for actor in self.actors if actor.GetVisibility()]
        cut = self.part.alpha_cutoff is not None or is_cut_out(self.part.actor)
        if not shown or cut or shown[0].HasTranslucentPolygonalGeometry():
            return shown
        if self._depths is None:
            self._depths = _DepthDraws(self.mapper.GetInput(), self._made_plain, self._binder)
        self._depths.set_inputs(self.entries, self.textures, self.uniforms)
        return self._depths.show([span for span in self._spans if span[1] > 0])

    def _made_plain(self, mapper):
        """Return an actor that draws depth alone."""
        actor, prop = pv.Actor(), self.part.actor.GetProperty()
        actor.SetMapper(mapper)
        actor.GetProperty().LightingOff()
        actor.GetProperty().SetBackfaceCulling(prop.GetBackfaceCulling())
        actor.GetProperty().SetFrontfaceCulling(prop.GetFrontfaceCulling())
        actor.SetUserMatrix(self._matrix)
        _feature(self.part.mesh, depth=True).attach(actor)
        return actor

    def release(self, window):
        """Free GPU memory; the context is current."""
        super().release(window)
        if self._depths is not None:
            self._depths.entries = None
            self._depths.release(window)
            self._depths = None

    def _inputs(self):
        return self.textures, self.uniforms | self.tint

    def _made(self):
        if not self.actors:
            self._fill()
        actor = with_looks(self.part, self.mapper)
        actor.SetProperty(self._worn)
        actor.SetUserMatrix(self._matrix)
        actor.PickableOff()
        actor.UseBoundsOff()
        actor.SetForceTranslucent(self._translucent)
        _feature(self.part.mesh).attach(actor)
        return actor

    def _fill(self):
        """Fill the mapper with copies of the mesh."""
        self.mapper.ShallowCopy(self.part.actor.GetMapper())
        self.mapper.SetVBOShiftScaleMethod(self.mapper.DISABLE_SHIFT_SCALE)
        mesh = copies(self.part.mesh, self.chunk, self._center)
        spread(mesh, self._half)
        self.mapper.SetInputDataObject(mesh)


class _DepthDraws(ShaderDraws):
    """Draws of the same copies for depth alone; they are in no renderer's list."""

    def __init__(self, mesh, made, binder):
        super().__init__(draws=0, binder=binder)
        self.mapper.SetVBOShiftScaleMethod(self.mapper.DISABLE_SHIFT_SCALE)
        self.mapper.SetInputDataObject(mesh)
        self._made = made

    def set_inputs(self, entries, textures, uniforms):
        """Set what the draws for all else have, too."""
        self.entries, self.textures, self.uniforms = entries, textures, uniforms

    def show(self, spans) -> list:
        """Return the actors that draw some spans of entries."""
        self.grow(len(spans), partial(self._made, self.mapper))
        self.show_spans(spans)
        return self.actors[: len(spans)]


def _feature(mesh, *, depth=False) -> Feature:
    part, kept = sections(shader_source(__file__)), '//VTK::PositionVC::Dec\n'
    defines = f'#define VERTICES {mesh.n_points}.0\n#define SHRUNK {_SHRUNK!r}\n'
    defines += f'#define CELL_NORMALS {int(mesh.cell_data.active_normals is not None)}\n'
    vertex = {
        'VTK::PositionVC::Dec': defines + part['vertex.declare'] + kept,
        'VTK::CustomBegin::Impl': part['vertex.begin'],
        'VTK::Normal::Impl': part['vertex.normal'],
    }
    if depth:
        return Feature('mesh_draws', vertex)
    fragment = {
        'VTK::PositionVC::Dec': defines + part['fragment.declare'] + kept,
        'VTK::Normal::Dec': part['fragment.declare_normal'],
        'VTK::Normal::Impl': part['fragment.normal'],
    }
    return Feature('mesh_draws', vertex, fragment)


def copies(mesh, count, origin) -> pv.PolyData:
    """Return shrunk copies of a mesh about an origin, and a cell without area for bounds."""
    size, faces = mesh.n_points, np.asarray(mesh.regular_faces)
    points = np.tile(((mesh.points - origin) * _SHRUNK).astype(np.float32), (count, 1))
    starts = size * np.arange(count)[:, None, None]
    out = pv.PolyData.from_regular_faces(
        np.concatenate([points, np.zeros((2, 3), np.float32)]),
        np.concatenate([(faces + starts).reshape(-1, 3), size * count + np.array([[0, 1, 1]])]),
    )
    of_points, of_cells = (np.tile(np.arange(n), count) for n in (size, len(faces)))
    return take_arrays(mesh, out, np.append(of_points, [0, 0]), np.append(of_cells, 0))


def spread(mesh, half):
    """Set the bounds of copies: how far they reach along each axis, both ways."""
    points = mesh.GetPoints()
    for sign, row in ((-1, 2), (1, 1)):
        points.SetPoint(points.GetNumberOfPoints() - row, *(sign * half).tolist())
    points.Modified()
