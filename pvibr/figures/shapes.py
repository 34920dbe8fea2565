"""Differences of whole meshes - key frames, morph targets, correctives - and their GPU cache."""

from __future__ import annotations

import numpy as np

from pvibr.figures.pose_sheet import WIDTH, Rows
from pvibr.gl import Texture, nbytes_of, release
from pvibr.scene.shader_draws import pack

#: Memory budget for the shapes of one mesh, in bytes.
BUDGET = 2**28
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

    def __init__(self, window, shapes):
        self.shapes = shapes
        #: Rows of a shape.
        self.rows = -(-shapes.n_points // WIDTH)
        self._held = Rows(window, ('ibr_shapes', 'ibr_shape_normals'))
        self._room = BUDGET // (WIDTH * 32)
        self._where: dict[int, int] = {}  # first row by shape, least recently used first
        #: Number of uploads so far.
        self.loads = 0
        self._staging = [Texture(window), Texture(window)]

    @property
    def nbytes(self) -> int:
        """Bytes on the GPU."""
        return nbytes_of(self._held, *self._staging)

    @property
    def share(self) -> float:
        """A row relative to all rows."""
        return 1.0 / max(self._held.height, 1)

    @property
    def textures(self) -> dict:
        """Positions and normals, by the names of their samplers."""
        return self._held.textures

    def places(self, wanted) -> dict[int, int]:
        """Return the first rows of shapes, loading missing ones."""
        for shape in wanted & self._where.keys():
            self._where[shape] = self._where.pop(shape)  # most recently used
        for shape in sorted(wanted - self._where.keys()):
            self._load(shape, self._free(wanted))
        return self._where

    def _free(self, wanted) -> int:
        """Return the first of free rows, or of those of the least recently used shape."""
        held, most = len(self._where), max(self._room, len(wanted) * self.rows)
        if (held + 1) * self.rows <= most and self._held.has(self.rows):
            return self._held.take(self.rows, most)
        oldest = next((shape for shape in self._where if shape not in wanted), None)
        if oldest is None:
            size = f'{len(wanted)} shapes of {self.rows * WIDTH} vertices at once'
            raise ValueError(f'{size}; {held} fit here.')
        return self._where.pop(oldest)

    def _load(self, shape, first):
        empty = np.zeros((self.shapes.n_points, 3), np.float32)
        for texture, found in zip(self._staging, self.shapes[shape], strict=True):
            values = empty if found is None else found.astype(np.float32)
            texture.upload(pack(np.ascontiguousarray(values), WIDTH, 3))
        self._held.write(first, self.rows, self._staging)
        self._where[shape] = first
        self.loads += 1

    def release(self):
        """Release all GPU resources; the context must be alive."""
        release(self._held, *self._staging)
        self._where = {}
