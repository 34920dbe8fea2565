"""Differences of whole meshes - key frames, morph targets, correctives - and their GPU cache."""

from __future__ import annotations

import numpy as np

from pvibr.figures.pose_sheet import WIDTH, RowPool
from pvibr.gl import Texture, nbytes_of, release
from pvibr.things.shader_draws import pack

#: Memory budget for the shapes of one mesh, in bytes.
BUDGET = 2**28
_ATTRIBUTES = ('positions', 'normals')


class MeshShapes:
    """Shapes of a mesh: key frames, then morph targets, then correctives."""

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
                return tuple(self._dense(morphs, attribute, number) for attribute in _ATTRIBUTES)
            number -= len(morphs)
        raise IndexError(number)

    def _dense(self, morphs, attribute, shape_index):
        target = morphs.target(attribute, shape_index)
        if target is None:
            return None
        one_hot = np.arange(len(morphs)) == shape_index
        return morphs.total(attribute, one_hot, len(self.figure_mesh.points))[self.order]

    def active(self, pose):
        """Return active shapes, their weights, and the number of key frames among them."""
        shapes, amounts, frame_count = [], [], 0
        if self.n_frames:
            frame_indices, weights = self.figure_mesh.frames.at(getattr(pose, 'time', 0.0))
            active_indices = np.flatnonzero(weights)
            shapes, amounts = [frame_indices[active_indices]], [weights[active_indices]]
            frame_count = len(active_indices)
        first_shape = self.n_frames
        for morphs, weights in self.figure.layers(self.index, pose):
            active_indices = np.flatnonzero(weights)
            shapes.append(first_shape + active_indices)
            amounts.append(weights[active_indices])
            first_shape += len(morphs)
        all_shapes = np.concatenate([np.zeros(0, int), *shapes]), np.concatenate([[], *amounts])
        return *all_shapes, frame_count


class ShapeStore:
    """A GPU cache of the shapes of a mesh, within a memory budget."""

    def __init__(self, window, shapes):
        self.shapes = shapes
        #: Rows of a shape.
        self.rows = -(-shapes.n_points // WIDTH)
        self._row_pool = RowPool(window, ('ibr_shapes', 'ibr_shape_normals'))
        self._room = BUDGET // (WIDTH * 32)
        self._row_by_shape: dict[int, int] = {}  # first row by shape, least recently used first
        #: Number of uploads so far.
        self.loads = 0
        self._staging = [Texture(window), Texture(window)]

    @property
    def nbytes(self) -> int:
        """Bytes on the GPU."""
        return nbytes_of(self._row_pool, *self._staging)

    @property
    def share(self) -> float:
        """Height of a row as a fraction of the texture."""
        return 1.0 / max(self._row_pool.height, 1)

    @property
    def textures(self) -> dict:
        """Positions and normals, by the names of their samplers."""
        return self._row_pool.textures

    def places(self, required) -> dict[int, int]:
        """Return the first rows of shapes, loading missing ones."""
        for shape in required & self._row_by_shape.keys():
            self._row_by_shape[shape] = self._row_by_shape.pop(shape)  # most recently used
        for shape in sorted(required - self._row_by_shape.keys()):
            self._load(shape, self._free(required))
        return self._row_by_shape

    def _free(self, required) -> int:
        """Return the first of free rows, or of those of the least recently used shape."""
        stored, max_rows = len(self._row_by_shape), max(self._room, len(required) * self.rows)
        if (stored + 1) * self.rows <= max_rows and self._row_pool.has(self.rows):
            return self._row_pool.take(self.rows, max_rows)
        oldest_shape = next((shape for shape in self._row_by_shape if shape not in required), None)
        if oldest_shape is None:
            raise ValueError(
                f'active shapes must be at most {stored}, got {len(required)} of '
                f'{self.rows * WIDTH} vertices'
            )
        return self._row_by_shape.pop(oldest_shape)

    def _load(self, shape, first_row):
        no_difference = np.zeros((self.shapes.n_points, 3), np.float32)
        for texture, difference in zip(self._staging, self.shapes[shape], strict=True):
            values = no_difference if difference is None else difference.astype(np.float32)
            texture.upload(pack(np.ascontiguousarray(values), WIDTH, 3))
        self._row_pool.write(first_row, self.rows, self._staging)
        self._row_by_shape[shape] = first_row
        self.loads += 1

    def release(self):
        """Release all GPU resources; the context must be alive."""
        release(self._row_pool, *self._staging)
        self._row_by_shape = {}
