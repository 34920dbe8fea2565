"""Draws of one shader: actors that share a mapper, its textures and a table of entries."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pyvista as pv

from pvibr.core import _vtk
from pvibr.core.observers import tell_programs, weakly
from pvibr.gl import Texture, set_uniforms
from pvibr.gl import enums as gl
from pvibr.gl.binder import Binder
from pvibr.gl.feature import Feature
from pvibr.things.shared_material import CardMaterial

ROW = 1024  # texels of a row of a table
PBR = 3  # VTKPBR
# VTK computes highlights also where the material has none; the compiler drops what follows.
DULL = '#define specularColor vec3(0.0)\n', '#undef specularColor\n'


class ShaderDraws:
    """Actors of one mapper, visible within frames only, each of which draws a span of entries."""

    # The shader has the entries as ibr_entries, in rows of 1024 texels, and of each actor
    # ibr_first, the number of its first item, and ibr_end, the entry after its last.

    def __init__(
        self, *, draws=1, chunk=1, prop=None, feature=None, translucent=None, binder=None
    ):
        self.mapper = _vtk.vtkPolyDataMapper()
        self.mapper.ScalarVisibilityOff()
        tell_programs(self.mapper, self._set_shader)
        #: Most items of a draw.
        self.chunk = chunk
        #: Shared with whoever made it, or a copy of what is no material of cards.
        self.material = prop if isinstance(prop, CardMaterial) else CardMaterial(prop)
        self.actors = [_draw_actor(self.mapper, self.material, translucent) for _ in range(draws)]
        self.textures: dict[str, Texture] = {}
        self.uniforms: dict = {}
        self.entries: Texture | None = None
        self.failure: str | None = None
        self._binder = binder or Binder()
        self._spans, self._used = [(0, 0)] * draws, 0
        self._corners = self._watcher = 0
        self.feature: Feature | None = None
        self.landed = self._asked = False
        if feature is not None:
            self.set_feature(feature)

    @property
    def actor(self):
        """The only actor."""
        (actor,) = self.actors
        return actor

    @property
    def nbytes(self) -> int:
        """Bytes of the table of entries on the GPU."""
        return 0 if self.entries is None else self.entries.nbytes

    def set_feature(self, feature):
        """Replace the attached shader text."""
        if self.feature is None or feature.name != self.feature.name:
            for actor in self.actors:
                if self.feature is not None:
                    self.feature.detach(actor)
                feature.attach(actor)
            self.feature, self.landed = feature, False
            self._watch()

    def place_cards(self, bounds, corners=4):
        """Have cards of 4 corners, or points, as many as a draw may have; VTK culls by bounds."""
        self._corners = corners
        self.mapper.SetInputData(card_mesh(self.chunk, corners, bounds))

    # -- what is drawn ------------------------------------------------------------------------

    def upload(self, window, entries):
        """Upload the table of entries, shape (n, channels), if there are any."""
        if len(entries):
            self.entries = self.entries or Texture(window)
            self.entries.upload(pack(entries, ROW, entries.shape[1]))

    def grow(self, count, made) -> list:
        """Have so many actors at least; return those that were made."""
        new = [made() for _ in range(count - len(self.actors))]
        self.actors += new
        self._spans += [(0, 0)] * len(new)
        return new

    def show_spans(self, spans):
        """Draw a span by each actor: first item and end of the entries; others draw nothing."""
        count, self._used = max(len(spans), self._used), len(spans)  # others are hidden already
        spans = [*spans, *[(0, 0)] * (count - len(spans))]
        for k, (actor, span) in enumerate(zip(self.actors[:count], spans, strict=True)):
            actor.SetVisibility(span[1] > 0)
            if span != self._spans[k]:  # most stay while the camera moves
                uniforms = actor.GetShaderProperty().GetVertexCustomUniforms()
                uniforms.SetUniformi('ibr_first', span[0])
                uniforms.SetUniformi('ibr_end', span[1])
                self._spans[k] = span

    def show_parts(self, cuts, unit) -> list:
        """Draw the entries between each two cuts, of so many items each; return their actors."""
        step = self.chunk // unit
        parts = [
            [(a * unit, min(a + step, end)) for a in range(first, end, step)]
            for first, end in pairwise(cuts)
        ]
        self.show_spans([span for part in parts for span in part])
        free = iter(self.actors)
        return [[next(free) for _ in part] for part in parts]

    def hide(self):
        """Draw nothing, and give the texture units back."""
        self.show_spans(())
        self._binder.unbind()

    # -- the GPU ------------------------------------------------------------------------------

    def _watch(self):
        """Note the next time that VTK draws, whether or not it has a program."""
        self.mapper.RemoveObserver(self._watcher)
        self._asked = False
        self._watcher = self.mapper.AddObserver('StartEvent', weakly(self._note))

    def _note(self):
        self._asked = True
        self.mapper.RemoveObserver(self._watcher)

    def _inputs(self) -> tuple[dict, dict]:
        """Return the textures and the uniforms of a program that is about to draw."""
        return self.textures, self.uniforms

    def _set_shader(self, program):
        textures, uniforms = self._inputs()
        if self.entries is not None:
            textures = {**textures, 'ibr_entries': self.entries}
            if self._corners == 1:
                self.entries.window.GetState().SetEnumState(gl.PROGRAM_POINT_SIZE, True)
        set_uniforms(program, self._binder.bind(self, textures))
        set_uniforms(program, uniforms)
        if not self.landed:
            self.landed = True
            if self.feature is not None and not self.feature.landed(program):
                self.failure = f'the shader text {self.feature.name} did not land'

    def check(self):
        """Note if the frame that was drawn had no program for what it was to show."""
        if self._asked and not self.landed and self.feature is not None:
            self.failure = f'the driver refused the shader {self.feature.name}'

    def release(self, window):
        """Free GPU memory; the context is current."""
        self.hide()
        self.textures = {}
        if window is not None:
            self.mapper.ReleaseGraphicsResources(window)
            for actor in self.actors:
                actor.ReleaseGraphicsResources(window)
        if self.entries is not None:
            self.entries.release()
            self.entries = None


def _draw_actor(mapper, material, translucent):
    """Return an actor without bounds that is not picked."""
    actor = pv.Actor()
    actor.SetMapper(mapper)
    actor.SetProperty(material)
    if translucent is not None:
        (actor.ForceTranslucentOn if translucent else actor.ForceOpaqueOn)()
    actor.VisibilityOff()
    actor.PickableOff()
    actor.UseBoundsOff()
    return actor


def card_mesh(count, corners, bounds):
    """Return the polydata of unplaced cards: the shader places them by their vertex number."""
    low, high = np.asarray(bounds, float).reshape(3, 2).T
    count = max(count, 2)  # one point has no bounds
    points = np.empty((count * corners, 3))
    points[0::2], points[1::2] = low, high
    cell = np.array([0]) if corners == 1 else np.array([0, 1, 2, 0, 2, 3])
    cells = (np.arange(count)[:, None] * corners + cell).astype(np.int32).ravel()
    mesh = _vtk.vtkPolyData()
    vertices = _vtk.vtkPoints()
    vertices.SetData(_vtk.numpy_to_vtk(points, deep=True))
    mesh.SetPoints(vertices)
    polys = _vtk.vtkCellArray()
    offsets = np.arange(0, len(cells) + 1, 1 if corners == 1 else 3, dtype=np.int32)
    polys.SetData(*(_vtk.numpy_to_vtk(a, deep=True) for a in (offsets, cells)))
    if corners == 1:
        # VTK lights points that have normals, whatever these are.
        mesh.SetVerts(polys)
        normals = _vtk.numpy_to_vtk(np.zeros((count, 3), np.float32), deep=True)
        mesh.GetPointData().SetNormals(normals)
    else:
        mesh.SetPolys(polys)
    return mesh


def pack(values, width, channels) -> np.ndarray:
    """Return values as an image, padded with zeros."""
    flat = values.reshape(-1, channels)
    height = max(1, -(-len(flat) // width))
    out = np.zeros((height * width, channels), values.dtype)
    out[: len(flat)] = flat
    return out.reshape(height, width, channels)
