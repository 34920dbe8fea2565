"""Textures that the figures of a window share: their meshes at rest, and where they are posed.

One framebuffer for each figure would be one pass for each, which drivers finish one by one.
"""

from __future__ import annotations

import weakref
from typing import Any

import numpy as np

from pvibr.gl import Quad, Target, Texture, release, shader_source, texture_limit
from pvibr.gl.binder import Binder
from pvibr.gl.feature import sections
from pvibr.things.shader_draws import pack

#: Vertices of a row of the textures.
WIDTH = 1024
#: Vec4s per row of the pose state texture, a power of two.
STATE_WIDTH = 1024
#: Samplers of the textures that vertex shaders read.
SAMPLERS = 'ibr_posed', 'ibr_posed_normals'
_AT_REST = 'ibr_rest', 'ibr_rest_normals', 'ibr_joints', 'ibr_weights'

_sheets: weakref.WeakKeyDictionary[object, weakref.WeakSet[PoseSheet]] = (
    weakref.WeakKeyDictionary()
)


def shader(section, **defines) -> str:
    """Return a section of the shader of posing with its defines."""
    define_lines = ''.join(f'#define {name} {int(value)}\n' for name, value in defines.items())
    return define_lines + sections(shader_source(__file__, 'posing'))[section]


def sheet_with_room(window, rest_rows, row_count) -> PoseSheet | None:
    """Return a sheet of a window with free rows, None if even a new one has too few."""
    sheets = _sheets.setdefault(window, weakref.WeakSet())
    for sheet in sheets:
        if sheet.has(rest_rows, row_count):
            return sheet
    sheet = PoseSheet(window)
    sheets.add(sheet)
    return sheet if sheet.has(rest_rows, row_count) else None


class RowPool:
    """Float textures whose rows are allocated in ranges; they grow and shrink as needed."""

    def __init__(self, window, names):
        self.window, self.names = window, names
        self._limit = texture_limit(window)
        self._free = [(0, self._limit)]
        self._target: Any = None
        self._copy: Quad | None = None

    @property
    def height(self) -> int:
        """RowPool of the textures now."""
        return 0 if self._target is None else self._target.height

    @property
    def nbytes(self) -> int:
        """Bytes on the GPU."""
        return 0 if self._target is None else self._target.nbytes

    @property
    def textures(self) -> dict[str, Texture]:
        """The textures by the names of their samplers."""
        color_textures = () if self._target is None else self._target.colors
        return dict(zip(self.names, color_textures, strict=bool(color_textures)))

    def has(self, row_count) -> bool:
        """Return whether a contiguous range of rows is free."""
        return any(end_row - first_row >= row_count for first_row, end_row in self._free)

    def take(self, row_count, max_rows=None) -> int:
        """Allocate rows and return the first; growth is ahead of need, up to max_rows."""
        range_index = next(
            range_index
            for range_index, (first_row, end_row) in enumerate(self._free)
            if end_row - first_row >= row_count
        )
        first_row, end_row = self._free[range_index]
        self._free[range_index] = first_row + row_count, end_row
        if first_row + row_count > self.height:
            grown_height = min(2 * self.height, max_rows or self._limit, self._limit)
            try:
                self._resize(max(first_row + row_count, grown_height))
            except BaseException:
                self.give(first_row, row_count)
                raise
        return first_row

    def give(self, first_row, row_count):
        """Free rows."""
        free_ranges: list = []
        for start_row, end_row in sorted([*self._free, (first_row, first_row + row_count)]):
            if free_ranges and free_ranges[-1][1] == start_row:
                start_row, _ = free_ranges.pop()
            free_ranges.append((start_row, end_row))
        self._free = free_ranges
        used_rows = free_ranges[-1][0] if free_ranges[-1][1] == self._limit else self._limit
        if not used_rows:
            self.release()
        elif 4 * used_rows <= self.height:
            self._resize(2 * used_rows)

    def _resize(self, height):
        old_target = self._target
        formats = ('rgba32f',) * len(self.names)
        self._target = Target(self.window, WIDTH, height, formats, filter='nearest')
        if old_target is not None:
            self.write(0, min(height, old_target.height), old_target.colors)
            old_target.release()

    def write(self, first_row, row_count, textures):
        """Write textures into rows."""
        if self._copy is None:
            self._copy = Quad(self.window, shader('store', TEXTURES=len(self.names)), 'rows')
        with self.drawing():
            self.aim(first_row, row_count)
            source_textures = {f'ibr_part{i}': texture for i, texture in enumerate(textures)}
            self._copy.draw({'ibr_first': float(first_row)}, source_textures)

    def drawing(self):
        """Draw into the rows; all GL state is restored afterwards."""
        return self._target.drawing()

    def aim(self, first_row, row_count, width=WIDTH):
        """Draw into these rows only, or their first texels."""
        gl_state = self.window.GetState()
        gl_state.vtkglViewport(0, first_row, width, row_count)
        gl_state.vtkglScissor(0, first_row, width, row_count)

    def download(self, first_row, row_count) -> list[np.ndarray]:
        """Return the texels of rows of each texture, for tests."""
        return [t.download()[first_row : first_row + row_count] for t in self._target.colors]

    def release(self):
        """Free the GPU's memory; the context must be alive."""
        release(self._target, self._copy)
        self._target = self._copy = None


class PoseSheet:
    """Meshes at rest and posed vertices of any number of figures, and the programs that pose."""

    def __init__(self, window):
        self.window = window
        self.rest, self.posed = RowPool(window, _AT_REST), RowPool(window, SAMPLERS)
        self._staging = [Texture(window) for _ in _AT_REST]
        self._state, self._places = Texture(window), Texture(window)
        self._uploaded_places = np.zeros(0)
        self._quads: dict[tuple, Quad] = {}
        self._binder = Binder()

    def has(self, rest_rows, row_count) -> bool:
        """Return whether contiguous rows of both kinds are free."""
        return self.rest.has(rest_rows) and self.posed.has(row_count)

    def load(self, images) -> int:
        """Load a mesh at rest from images; return its first row."""
        row_count = max(len(image) for image in images)
        self.unbind()
        first_row = self.rest.take(row_count)
        try:
            for texture, image in zip(self._staging, images, strict=True):
                padded_image = np.zeros((row_count, WIDTH, 4), np.float32)
                padded_image[: len(image)] = image
                texture.upload(padded_image)
            self.rest.write(first_row, row_count, self._staging)
        except BaseException:
            self.rest.give(first_row, row_count)
            raise
        return first_row

    def take(self, row_count) -> int:
        """Allocate rows for posed vertices; return the first."""
        self.unbind()
        return self.posed.take(row_count)

    def give(self, rest_ranges, posed_range):
        """Free rows of meshes at rest and of posed vertices, as pairs of first row and count.

        With the last of them, all memory is freed.
        """
        self.unbind()
        for pair in rest_ranges:
            self.rest.give(*pair)
        self.posed.give(*posed_range)
        if not self.posed.height:
            release(*self._staging, self._state, self._places, *self._quads.values())
            self._quads, self._uploaded_places = {}, np.zeros(0)

    def upload(self, pose_values, row_places):
        """Upload pose state (n, 4), and for each row which of it to read (rows, 4)."""
        self._state.upload(pack(pose_values.astype(np.float32), STATE_WIDTH, 4))
        if not np.array_equal(row_places, self._uploaded_places):
            self._uploaded_places = row_places
            self._places.upload(row_places[:, None].astype(np.float32))

    def draw(self, first_row, size, defines, uniforms, textures):
        """Pose the vertices of rows, width and count, within ``posed.drawing()``."""
        width, row_count = size
        self.posed.aim(first_row, row_count, width)
        program_key = tuple(defines.items())
        if program_key not in self._quads:
            shader_text = shader('pose', WIDTH=WIDTH, STATE_WIDTH=STATE_WIDTH, **defines)
            self._quads[program_key] = Quad(self.window, shader_text, 'posing')
        uniforms['ibr_rest_share'] = 1.0 / self.rest.height
        textures = textures | self.rest.textures
        if not defines['NUMBERS']:
            uniforms['ibr_shares'] = 1.0 / self._state.size[1], 1.0 / self._places.size[1]
            textures |= {'ibr_state': self._state, 'ibr_places': self._places}
        self._quads[program_key].draw(uniforms, textures)

    def bind(self) -> dict[str, int]:
        """Bind the posed vertices; return the texture units by sampler."""
        return self._binder.bind(self.posed.textures)

    def unbind(self):
        """Release the texture units."""
        self._binder.unbind()
