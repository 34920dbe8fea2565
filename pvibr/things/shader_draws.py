"""Draws of one shader: actors that share a mapper, its textures and a table of entries."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pyvista as pv

from pvibr.core import _vtk
from pvibr.core._vtk import method
from pvibr.core.observers import tell_programs, weakly
from pvibr.gl import Texture, set_shared_uniforms
from pvibr.gl import enums as gl
from pvibr.gl.binder import Binder
from pvibr.gl.feature import Feature
from pvibr.things.shared_material import CardMaterial

ROW = 1024  # texels per row of a table
_STEP = 128  # of the length of a single row
PBR = 3  # VTKPBR
# VTK computes highlights even if the material has none; with this the compiler drops them.
DULL = '#define specularColor vec3(0.0)\n', '#undef specularColor\n'
DULL_FEATURE = Feature('dull', fragment={'VTK::Light::Impl': '//VTK::Light::Impl\n'.join(DULL)})


def is_shiny(*props) -> bool:
    """Return whether any of some properties, or None, has highlights."""
    return any(p and (p.GetSpecular() > 0 or p.GetInterpolation() == PBR) for p in props)


class ShaderDraws:
    """Actors of one mapper, visible within frames only, each drawing a span of the entries."""

    #: First draws of any of them so far: unless there were more, no shader can have failed.
    first_draws = 0

    # The shader reads the entries from ibr_entries, in rows of ROW texels; an actor's span is
    # from ibr_first, its first item, to before ibr_end.

    def __init__(
        self, *, draws=1, chunk=1, prop=None, feature=None, translucent=None, binder=None
    ):
        self.mapper = _vtk.vtkPolyDataMapper()
        self.mapper.ScalarVisibilityOff()
        tell_programs(self.mapper, self._set_shader)
        #: Most items per draw.
        self.chunk = chunk
        #: Shared if given as a `CardMaterial`, else a copy.
        self.material = prop if isinstance(prop, CardMaterial) else CardMaterial(prop)
        self.actors: list = []
        self._set_visible: list = []  # looked up once: PyVista's lookup is in Python
        self.textures: dict[str, Texture] = {}
        #: Replaced with every change, as are the others, which have no name in common.
        self.uniforms: dict = {}
        #: Uniforms of the frame's view, shared by many draws.
        self.view_uniforms: dict = {}
        #: Uniforms in which these draws differ from others of the same program.
        self.own_uniforms: dict = {}
        self.entries: Texture | None = None
        self.failure: str | None = None
        self._binder = binder or Binder()
        #: Textures and entries as of the last draw, and both.
        self._joined: tuple[dict, Texture | None, dict] = {}, None, {}
        self._spans: list[tuple[int, int]] = []
        self.span_count = 0  # of actors that draw
        self.grow(draws, lambda: draw_actor(self.mapper, self.material, translucent))
        self._corners = self._start_observer = 0
        self.feature: Feature | None = None
        self.landed = self._was_drawn = False
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
        """Replace the attached feature."""
        if self.feature is None or feature.name != self.feature.name:
            for actor in self.actors:
                if self.feature is not None:
                    self.feature.detach(actor)
                feature.attach(actor)
            self.feature, self.landed = feature, False
            self._watch()

    def place_cards(self, bounds, corners=4):
        """Set the most cards of a draw, of 4 corners or 1, and the bounds that VTK culls by."""
        self._corners = corners
        self.mapper.SetInputData(card_mesh(self.chunk, corners, bounds))

    # -- what is drawn ------------------------------------------------------------------------

    def upload(self, window, entries):
        """Upload the table of entries, shape (n, channels), unless it is empty."""
        if entries.size:
            self.entries = self.entries or Texture(window)
            # Few need no whole row; steps keep the texture's size from frame to frame.
            row_length = min(ROW, -(-len(entries) // _STEP) * _STEP)
            self.entries.upload(pack(entries, row_length, entries.shape[1]))

    def grow(self, count, make_actor) -> list:
        """Grow the pool to at least `count` actors; return the new ones."""
        new_actors = [make_actor() for _ in range(count - len(self.actors))]
        self.actors += new_actors
        self._set_visible += [method(actor, 'SetVisibility') for actor in new_actors]
        self._spans += [(0, 0)] * len(new_actors)
        return new_actors

    def show_spans(self, spans):
        """Draw one span (first item, end entry) per actor; the other actors draw nothing."""
        last_count, self.span_count = self.span_count, len(spans)
        if last_count > self.span_count:  # the rest is hidden already
            spans = [*spans, *[(0, 0)] * (last_count - self.span_count)]
        for k, (set_visible, span) in enumerate(zip(self._set_visible, spans, strict=False)):
            set_visible(span[1] > 0)
            if span != self._spans[k]:  # most persist while the camera moves
                uniforms = method(self.actors[k], 'GetShaderProperty')().GetVertexCustomUniforms()
                uniforms.SetUniformi('ibr_first', span[0])
                uniforms.SetUniformi('ibr_end', span[1])
                self._spans[k] = span

    def show_parts(self, cuts, unit) -> list:
        """Draw the entries between consecutive cuts; return the actors of each part."""
        step_size = self.chunk // unit
        part_spans = [
            [(a * unit, min(a + step_size, end)) for a in range(first, end, step_size)]
            for first, end in pairwise(cuts)
        ]
        self.show_spans([span for part in part_spans for span in part])
        free_actors = iter(self.actors)
        return [[next(free_actors) for _ in part] for part in part_spans]

    def hide(self):
        """Draw nothing, and release the texture units."""
        self.show_spans(())
        self._binder.unbind()

    # -- the GPU ------------------------------------------------------------------------------

    def _watch(self):
        """Note when VTK next draws, with or without a program."""
        self.mapper.RemoveObserver(self._start_observer)
        self._was_drawn = False
        self._start_observer = self.mapper.AddObserver('StartEvent', weakly(self._on_start))

    def _on_start(self):
        ShaderDraws.first_draws += 1
        self._was_drawn = True
        self.mapper.RemoveObserver(self._start_observer)

    def _inputs(self) -> tuple[dict, ...]:
        """Return the textures and uniforms of a program about to draw."""
        return self.textures, self.view_uniforms, self.uniforms

    def _set_shader(self, program):
        textures, *uniforms = self._inputs()
        if self.entries is not None and self._corners == 1:
            self.entries.window.GetState().SetEnumState(gl.PROGRAM_POINT_SIZE, True)
        if textures is not self._joined[0] or self.entries is not self._joined[1]:
            own = {} if self.entries is None else {'ibr_entries': self.entries}
            self._joined = textures, self.entries, {**textures, **own}
        units = self._binder.bind(self._joined[2])
        set_shared_uniforms(program, units, *uniforms, self.own_uniforms)
        if not self.landed:
            self.landed = True
            if self.feature is not None and not self.feature.landed(program):
                self.failure = f'the shader text {self.feature.name} did not land'

    def check(self):
        """Record a failure if the last frame drew without a program."""
        if self._was_drawn and not self.landed and self.feature is not None:
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


def draw_actor(mapper, material, translucent):
    """Return an unpickable actor without bounds."""
    actor = pv.Actor()
    actor.SetMapper(mapper)
    actor.SetProperty(material)
    if translucent is not None:
        (actor.ForceTranslucentOn if translucent else actor.ForceOpaqueOn)()
    actor.VisibilityOff()
    actor.PickableOff()
    actor.UseBoundsOff()
    return actor


def card_mesh(card_count, corners, bounds):
    """Return polydata of cards that the shader positions by vertex number."""
    low, high = np.asarray(bounds, float).reshape(3, 2).T
    if corners == 1:
        card_count = max(card_count, 2)  # one point has no bounds
    corner_points = np.empty((card_count * corners, 3))
    corner_points[0::2], corner_points[1::2] = low, high
    corner_offsets = np.array([0]) if corners == 1 else np.array([0, 1, 2, 0, 2, 3])
    cells = (np.arange(card_count)[:, None] * corners + corner_offsets).astype(np.int32).ravel()
    mesh = _vtk.vtkPolyData()
    vertices = _vtk.vtkPoints()
    vertices.SetData(_vtk.numpy_to_vtk(corner_points, deep=True))
    mesh.SetPoints(vertices)
    cell_array = _vtk.vtkCellArray()
    cell_offsets = np.arange(0, len(cells) + 1, 1 if corners == 1 else 3, dtype=np.int32)
    cell_array.SetData(*(_vtk.numpy_to_vtk(a, deep=True) for a in (cell_offsets, cells)))
    if corners == 1:
        # VTK lights points only if they have normals; their values do not matter.
        mesh.SetVerts(cell_array)
        zero_normals = _vtk.numpy_to_vtk(np.zeros((card_count, 3), np.float32), deep=True)
        mesh.GetPointData().SetNormals(zero_normals)
    else:
        mesh.SetPolys(cell_array)
    return mesh


def pack(values, row_length, channel_count) -> np.ndarray:
    """Return values as an image, zero-padded."""
    flat_values = values.reshape(-1, channel_count)
    count = len(flat_values)
    padded = np.zeros((-(-count // row_length) or 1, row_length, channel_count), values.dtype)
    padded.reshape(-1, channel_count)[:count] = flat_values
    return padded
