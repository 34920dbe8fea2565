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
from pvibr.scene.shader_draws import pack

#: Vertices of a row of the textures.
WIDTH = 1024
#: Fours of numbers of a row of the state of poses, a power of two.
STATE_WIDTH = 1024
#: Samplers of the textures that vertex shaders read.
SAMPLERS = 'ibr_posed', 'ibr_posed_normals'
_AT_REST = 'ibr_rest', 'ibr_rest_normals', 'ibr_joints', 'ibr_weights'

_sheets: weakref.WeakKeyDictionary[object, weakref.WeakSet[PoseSheet]] = (
    weakref.WeakKeyDictionary()
)


def shader(section, **defines) -> str:
    """Return a section of the shader of posing with its defines."""
    head = ''.join(f'#define {name} {int(value)}\n' for name, value in defines.items())
    return head + sections(shader_source(__file__, 'posing'))[section]


def sheet_with_room(window, rest_rows, rows) -> PoseSheet | None:
    """Return a sheet of a window with free rows, None if even a new one has too few."""
    sheets = _sheets.setdefault(window, weakref.WeakSet())
    for sheet in sheets:
        if sheet.has(rest_rows, rows):
            return sheet
    sheet = PoseSheet(window)
    sheets.add(sheet)
    return sheet if sheet.has(rest_rows, rows) else None


class Rows:
    """Float textures of which ranges of rows are lent: they grow by need, and shrink."""

    def __init__(self, window, names):
        self.window, self.names = window, names
        self._limit = texture_limit(window)
        self._free = [(0, self._limit)]
        self._target: Any = None
        self._copy: Quad | None = None

    @property
    def height(self) -> int:
        """Rows of the textures now."""
        return 0 if self._target is None else self._target.height

    @property
    def nbytes(self) -> int:
        """Bytes on the GPU."""
        return 0 if self._target is None else self._target.nbytes

    @property
    def textures(self) -> dict[str, Texture]:
        """The textures by the names of their samplers."""
        found = () if self._target is None else self._target.colors
        return dict(zip(self.names, found, strict=bool(found)))

    def has(self, rows) -> bool:
        """Return whether so many rows are free one above another."""
        return any(end - first >= rows for first, end in self._free)

    def take(self, rows, most=None) -> int:
        """Return the first of so many free rows; they grow ahead of need up to so many."""
        i = next(i for i, (first, end) in enumerate(self._free) if end - first >= rows)
        first, end = self._free[i]
        self._free[i] = first + rows, end
        if first + rows > self.height:
            ahead = min(2 * self.height, most or self._limit, self._limit)
            self._resize(max(first + rows, ahead))
        return first

    def give(self, first, rows):
        """Take rows back."""
        free: list = []
        for start, end in sorted([*self._free, (first, first + rows)]):
            if free and free[-1][1] == start:
                start, _ = free.pop()
            free.append((start, end))
        self._free = free
        used = free[-1][0] if free[-1][1] == self._limit else self._limit
        if not used:
            self.release()
        elif 4 * used <= self.height:
            self._resize(2 * used)

    def _resize(self, height):
        old = self._target
        formats = ('rgba32f',) * len(self.names)
        self._target = Target(self.window, WIDTH, height, formats, filter='nearest')
        if old is not None:
            self.write(0, min(height, old.height), old.colors)
            old.release()

    def write(self, first, rows, textures):
        """Write textures into rows."""
        if self._copy is None:
            self._copy = Quad(self.window, shader('store', TEXTURES=len(self.names)), 'rows')
        with self.drawing():
            self.aim(first, rows)
            parts = {f'ibr_part{i}': texture for i, texture in enumerate(textures)}
            self._copy.draw({'ibr_first': float(first)}, parts)

    def drawing(self):
        """Draw into the rows; all GL state comes back afterwards."""
        return self._target.drawing()

    def aim(self, first, rows):
        """Draw into these rows only."""
        state = self.window.GetState()
        state.vtkglViewport(0, first, WIDTH, rows)
        state.vtkglScissor(0, first, WIDTH, rows)

    def download(self, first, rows) -> list[np.ndarray]:
        """Return the texels of rows of each texture, for tests."""
        return [t.download()[first : first + rows] for t in self._target.colors]

    def release(self):
        """Free the GPU's memory; the context must be alive."""
        release(self._target, self._copy)
        self._target = self._copy = None


class PoseSheet:
    """Meshes at rest and posed vertices of any number of figures, and the programs that pose."""

    def __init__(self, window):
        self.window = window
        self.rest, self.posed = Rows(window, _AT_REST), Rows(window, SAMPLERS)
        self._staging = [Texture(window) for _ in _AT_REST]
        self._state, self._places = Texture(window), Texture(window)
        self._placed = np.zeros(0)
        self._quads: dict[tuple, Quad] = {}
        self._binder = Binder()

    def has(self, rest_rows, rows) -> bool:
        """Return whether so many rows of both kinds are free."""
        return self.rest.has(rest_rows) and self.posed.has(rows)

    def load(self, images) -> int:
        """Take over a mesh at rest, images of the width; return its first row."""
        rows = max(len(image) for image in images)
        self.unbind()
        first = self.rest.take(rows)
        try:
            for texture, image in zip(self._staging, images, strict=True):
                blank = np.zeros((rows, WIDTH, 4), np.float32)
                blank[: len(image)] = image
                texture.upload(blank)
            self.rest.write(first, rows, self._staging)
        except BaseException:
            self.rest.give(first, rows)
            raise
        return first

    def take(self, rows) -> int:
        """Return the first of so many rows for posed vertices."""
        self.unbind()
        return self.posed.take(rows)

    def give(self, rest, posed):
        """Take back rows of meshes at rest and of posed vertices, pairs of the first and a count.

        With the last of them, all memory is freed.
        """
        self.unbind()
        for pair in rest:
            self.rest.give(*pair)
        self.posed.give(*posed)
        if not self.posed.height:
            release(*self._staging, self._state, self._places, *self._quads.values())
            self._quads, self._placed = {}, np.zeros(0)

    def upload(self, numbers, places):
        """Upload fours of numbers (n, 4), and for each row what of them makes it (rows, 4)."""
        self._state.upload(pack(numbers.astype(np.float32), STATE_WIDTH, 4))
        if not np.array_equal(places, self._placed):
            self._placed = places
            self._places.upload(places[:, None].astype(np.float32))

    def draw(self, first, rows, defines, uniforms, textures):
        """Pose the vertices of rows, within the drawing of the posed ones."""
        self.posed.aim(first, rows)
        key = tuple(defines.items())
        if key not in self._quads:
            text = shader('pose', WIDTH=WIDTH, STATE_WIDTH=STATE_WIDTH, **defines)
            self._quads[key] = Quad(self.window, text, 'posing')
        uniforms['ibr_rest_share'] = 1.0 / self.rest.height
        textures = textures | self.rest.textures
        if not defines['NUMBERS']:
            uniforms['ibr_shares'] = 1.0 / self._state.size[1], 1.0 / self._places.size[1]
            textures |= {'ibr_state': self._state, 'ibr_places': self._places}
        self._quads[key].draw(uniforms, textures)

    def bind(self) -> dict[str, int]:
        """Keep the posed vertices bound; return the texture units by samplers."""
        if self._binder.owner is self:
            return self._binder.units
        return self._binder.bind(self, self.posed.textures)

    def unbind(self):
        """Give the texture units back."""
        self._binder.unbind()
