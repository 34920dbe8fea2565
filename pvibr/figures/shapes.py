"""Differences of whole meshes - key frames, morph targets, correctives - and their GPU cache."""

from __future__ import annotations

from typing import Any

import numpy as np

from pvibr.gl import Quad, Target, Texture, shader_source, texture_limit
from pvibr.gl.feature import sections
from pvibr.scene.shader_draws import pack

#: Memory budget for the shapes of one mesh, in bytes.
BUDGET = 2**28
_FEW = 8
_ATTRIBUTES = ('positions', 'normals')


class MeshShapes:
    """The shapes of a mesh: key frames, then morph targets, then correctives."""

    def __init__(self, figure, index, order):
        self.figure, self.index, self.order = figure, index, order
        self.figure_mesh = figure.meshes[index]
        frames = self.figure_mesh.frames
        self.n_frames = 0 if frames is None else len(frames.times)
        self._layers = [morphs for morphs, _ in figure.layers(index)]

    @property
    def n_points(self) -> int:
        """Number of drawn vertices."""
        return len(self.order)

    def __len__(self):
        return self.n_frames + sum(len(morphs) for morphs in self._layers)

    @property
    def neutral(self) -> tuple:
        """Points and normals that shapes are differences from, each (v, 3)."""
        frames = self.figure_mesh.frames
        if frames is None:
            return self.figure_mesh.points, self.figure_mesh.normals
        return np.asarray(frames.positions[0], float), np.asarray(frames.normals[0], float)

    def __getitem__(self, number):
        if number < self.n_frames:
            frames = self.figure_mesh.frames
            pairs = zip((frames.positions, frames.normals), self.neutral, strict=True)
            return tuple((values[number] - first)[self.order] for values, first in pairs)
        number -= self.n_frames
        for morphs in self._layers:
            if number < len(morphs):
                return tuple(self._dense(morphs, what, number) for what in _ATTRIBUTES)
            number -= len(morphs)
        raise IndexError(number)

    def _dense(self, morphs, what, number):
        target = morphs.target(what, number)
        if target is None:
            return None
        weights = np.zeros(len(morphs))
        weights[number] = 1.0
        return morphs.total(what, weights, len(self.figure_mesh.points))[self.order]

    def active(self, pose):
        """Return active shapes, their weights, and the number of key frames among them."""
        shapes, amounts, frames = [], [], 0
        if self.n_frames:
            found, weights = self.figure_mesh.frames.at(getattr(pose, 'time', 0.0))
            shown = np.flatnonzero(weights)
            shapes, amounts, frames = [found[shown]], [weights[shown]], len(shown)
        first = self.n_frames
        for morphs, weights in self.figure.layers(self.index, pose):
            shown = np.flatnonzero(weights)
            shapes.append(first + shown)
            amounts.append(weights[shown])
            first += len(morphs)
        joined = np.concatenate([np.zeros(0, int), *shapes]), np.concatenate([[], *amounts])
        return *joined, frames


class ShapeStore:
    """A GPU cache of the shapes of a mesh, within a memory budget."""

    def __init__(self, window, shapes, width, budget=BUDGET):
        self.window, self.shapes, self.width, self.budget = window, shapes, width, budget
        points = shapes.n_points
        self.rows = -(-points // width)
        self._target: Any = None
        self._where: dict[int, int] = {}  # row group by shape, least recently used first
        #: Number of uploads so far.
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
        """Number of shapes that fit now."""
        return 0 if self._target is None else self._target.height // self.rows

    @property
    def share(self) -> float:
        """Rows of one shape relative to all rows."""
        return self.rows / self._target.height

    @property
    def textures(self) -> dict:
        """Positions and normals, by the names of their samplers."""
        names = ('ibr_shapes', 'ibr_shape_normals')
        return dict(zip(names, self._target.colors, strict=True))

    def slots(self, wanted) -> dict[int, int]:
        """Return the row groups of shapes, loading missing ones."""
        missing = wanted - self._where.keys()
        if self._target is None or (missing and len(self._where) + len(missing) > self.capacity):
            self._grow(len(wanted))
            missing = wanted - self._where.keys()
        for shape in wanted - missing:
            self._where[shape] = self._where.pop(shape)  # most recently used
        for shape in sorted(missing):
            self._load(shape, self._room(wanted))
        return self._where

    def _grow(self, wanted):
        """Enlarge the cache up to the budget; its content is lost."""
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
        """Return a free row group, or that of the least recently used shape."""
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
        """Release all GPU resources; the context must be alive."""
        for owner in (self._target, *self._staging, self._quad):
            if owner is not None:
                owner.release()
        self._target, self._where = None, {}
