"""Differences of whole meshes on the GPU: key frames, morph targets, correctives."""

from __future__ import annotations

from typing import Any

import numpy as np

from pvibr.gl import Quad, Target, Texture, shader_source, texture_limit
from pvibr.gl.feature import sections
from pvibr.instances.cards import pack

#: Bytes that the shapes of one mesh may take before those not in use make room.
BUDGET = 2**28
_FEW = 8


class ShapeStore:
    """The shapes of a mesh that are in use, and as many more as the budget allows."""

    def __init__(self, window, shapes, width, budget=BUDGET):
        self.window, self.shapes, self.width, self.budget = window, shapes, width, budget
        points = shapes.n_points
        self.rows = -(-points // width)
        self._target: Any = None
        self._where: dict[int, int] = {}  # shape to its group of rows, the longest unused first
        #: How many were uploaded so far.
        self.loads = 0
        self._staging = [Texture(window), Texture(window)]
        store = sections(shader_source(__file__, 'posing'))['store']
        self._quad = Quad(window, store, 'shapes')

    @property
    def nbytes(self) -> int:
        """Bytes on the GPU."""
        drawn = 0 if self._target is None else self._target.nbytes
        return drawn + sum(t.nbytes for t in self._staging)

    @property
    def capacity(self) -> int:
        """How many shapes it has room for now."""
        return 0 if self._target is None else self._target.height // self.rows

    @property
    def share(self) -> float:
        """Rows of one shape over those of all."""
        return self.rows / self._target.height

    @property
    def textures(self) -> dict:
        """Positions and normals, by the names of their samplers."""
        names = ('ibr_shapes', 'ibr_shape_normals')
        return dict(zip(names, self._target.colors, strict=True))

    def slots(self, wanted) -> dict[int, int]:
        """Return the groups of rows where shapes are, loading those that are missing."""
        missing = wanted - self._where.keys()
        if self._target is None or (missing and len(self._where) + len(missing) > self.capacity):
            self._grow(len(wanted))
            missing = wanted - self._where.keys()
        for shape in wanted - missing:
            self._where[shape] = self._where.pop(shape)  # used last
        for shape in sorted(missing):
            self._load(shape, self._room(wanted))
        return self._where

    def _grow(self, wanted):
        """Make room for more, at the cost of loading them again; up to the budget."""
        most = texture_limit(self.window) // self.rows
        if wanted > most:
            msg = f'{wanted} shapes of {self.rows * self.width} vertices at once; {most} fit here.'
            raise ValueError(msg)
        afforded = max(self.budget // (self.rows * self.width * 32), wanted, 1)
        asked = max(_FEW, 2 * self.capacity, 2 * wanted)
        capacity = min(asked, len(self.shapes), max(afforded, wanted), most)
        capacity = max(capacity, 1)
        if capacity <= self.capacity:
            return
        if self._target is not None:
            self._target.release()
        self._target = Target(
            self.window, self.width, capacity * self.rows, ('rgba32f', 'rgba32f'), filter='nearest'
        )
        self._where = {}

    def _room(self, wanted) -> int:
        """Return a group of rows that is free, or has what was unused for longest."""
        if len(self._where) < self.capacity:
            return len(self._where)
        oldest = next(shape for shape in self._where if shape not in wanted)
        return self._where.pop(oldest)

    def _load(self, shape, slot):
        empty = np.zeros((self.shapes.n_points, 3), np.float32)
        for texture, found in zip(self._staging, self.shapes[shape], strict=True):
            values = empty if found is None else found.astype(np.float32)
            texture.upload(pack(np.ascontiguousarray(values), self.width, 3))
        state = self.window.GetState()
        names = ('ibr_shape', 'ibr_shape_normal')
        with self._target.drawing():
            rect = (0, slot * self.rows, self.width, self.rows)
            state.vtkglViewport(*rect)
            state.vtkglScissor(*rect)
            self._quad.draw({}, dict(zip(names, self._staging, strict=True)))
        self._where[shape] = slot
        self.loads += 1

    def release(self):
        """Free the GPU's memory; the context must be alive."""
        for owner in (self._target, *self._staging, self._quad):
            if owner is not None:
                owner.release()
        self._target, self._where = None, {}
