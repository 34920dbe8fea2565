"""Build the hierarchy of a mesh by batched multi-triangulation, in memory or out of core.

Cignoni et al., "Batched Multi Triangulation", IEEE Visualization 2005: at each level all triangles
are divided into cells anew, and each cell is simplified with its border locked. Cells are handled
in blocks of neighbours, which are divided anew as well: what a block is made of is read, is
simplified by some process, and is written to where blocks of the next level find it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from pvibr.large.block import (
    PATCH_ARRAYS,
    SAMPLE_ARRAYS,
    TRIANGLE_ARRAYS,
    VERTEX_ARRAYS,
    Block,
    SimplifiedBlock,
    unit,
)
from pvibr.large.cells import BLOCK_TRIANGLES, is_one_cell, kd_planes
from pvibr.large.columns import Columns
from pvibr.large.distribution import (
    box_of_pieces,
    divide_triangles,
    merge_normals,
    merge_points,
    spans,
)
from pvibr.large.hierarchy import NO_CELL, Hierarchy
from pvibr.large.workers import Workers

#: Levels at most; each has about half the triangles of the one before.
_LEVELS = 40
#: Bytes that a row costs while a mesh is read in pieces, about.
_ROW_BYTES = 500
#: Centres of triangles by which blocks of the next level are divided, per block.
_PROBES = 500
#: Arrays of no cells.
_NO_CELLS = {'errors': np.zeros(0), 'boxes': np.zeros((0, 2, 3))}


@dataclass
class TriangleMesh:
    """The triangles of a mesh, in arrays or in what yields arrays of its slices."""

    #: Points of the mesh, (n, 3), float32 or float64.
    points: Any
    #: Triangles as numbers of points, (m, 3).
    faces: Any
    #: Cell of the user's mesh that each triangle is of, (m,).
    mesh_cells: Any
    #: Normals of the points if the mesh has any, (n, 3).
    normals: Any = None
    #: Texture coordinates of the points if the mesh has any, (n, 2).
    texture_coordinates: Any = None
    #: Edges of each triangle that are edges of its cell, bits 1, 2 and 4, (m,) uint8; all if None.
    edge_flags: Any = None
    #: Whether points are corners of triangles, of which equal ones are one point of the user's.
    is_soup: bool = False


def build_hierarchy(
    mesh: TriangleMesh, progress: Callable[[float], Any] = lambda fraction: None, workers=1
) -> Hierarchy:
    """Return the hierarchy of a mesh, built in memory."""
    builder = Builder(Columns(), progress, workers)
    return Hierarchy(**{name: whole(parts) for name, parts in builder.build(mesh).items()})


class Builder:
    """A hierarchy in the making: all that is known of it is in columns, from which it goes on."""

    def __init__(
        self,
        columns: Columns,
        progress: Callable[[float], Any] = lambda fraction: None,
        workers: int = 1,
        memory_bytes: float = 4e9,
        level_count: int = _LEVELS,
    ):
        self._columns, self._progress = columns, progress
        self._worker_count, self._level_count = workers, level_count
        self._rows = max(int(memory_bytes / _ROW_BYTES), 1 << 16)
        #: Vertices of the blocks that are being simplified.
        self._vertices: dict[int, np.ndarray] = {}

    def build(self, mesh: TriangleMesh) -> dict[str, list]:
        """Return the arrays of a hierarchy by name, as the columns that they are made of."""
        self._state = self._columns.resumed() or self._read(mesh)
        self._bounds = np.array(self._state['bounds'])
        with Workers(self._worker_count) as workers:
            while not self._state['is_built']:
                self._build_level(self._state['level'], workers)
        self._progress(1.0)
        return self._finished()

    def _read(self, mesh) -> dict[str, Any]:
        """Read a mesh into the first level."""
        columns, rows = self._columns, self._rows
        origin = box_of_pieces(mesh.points, rows).mean(0)
        merge_points(columns, mesh.points, origin, rows)
        if mesh.normals is not None:
            merge_normals(columns, mesh.normals, rows)
        texture_unit = divide_triangles(columns, mesh, rows, np.random.default_rng(0))
        if mesh.is_soup:
            columns.drop('vertex_of_point')
            for start, stop in spans(columns.length('base.points'), rows):
                columns.append('vertex_of_point', np.arange(start, stop, dtype=np.int32))
        state = {
            'origin': origin.tolist(),
            'bounds': box_of_pieces(columns['base.points'], rows).tolist(),
            'texture_unit': texture_unit,
            'level_starts': [0, columns.length('base.points')],
            'level': 0,
            'blocks_done': 0,
            'is_built': False,
        }
        columns.commit(state)
        return state

    # -- a level ---------------------------------------------------------------------------------

    def _build_level(self, level, workers):
        columns, state = self._columns, self._state
        count = columns.length(f'{level}.faces')
        previous = state.get('triangles')
        is_last = is_one_cell(count) or count == previous or level == self._level_count
        segments = columns.all_of(f'{level}.segments')
        planes = np.zeros((0, 4)) if is_last else self._next_planes(level, segments)
        blocks = np.unique(segments[:, 0])
        self._cells = {name: self._all_of(name, empty) for name, empty in _NO_CELLS.items()}
        loads = [
            partial(self._load, level, k, segments[segments[:, 0] == k], planes, is_last)
            for k in blocks[state['blocks_done'] :]
        ]
        results = workers.simplified(loads)
        for k, result in zip(blocks[state['blocks_done'] :], results, strict=True):
            self._take(level, result, self._vertices.pop(int(k)))
            state['blocks_done'] += 1
            columns.commit(state)
            self._advance(count, state['blocks_done'] / len(blocks))
        if level == 0:
            self._set_vertices()
        new_count = columns.length('base.points') + columns.length('new.points')
        state |= {'level': level + 1, 'blocks_done': 0, 'triangles': count, 'is_built': is_last}
        state['level_starts'] = [*state['level_starts'], *([] if is_last else [new_count])]
        names = *TRIANGLE_ARRAYS, *SAMPLE_ARRAYS, 'segments'
        columns.drop(*(f'{level}.{name}' for name in names))
        columns.commit(state)

    def _all_of(self, name, otherwise) -> np.ndarray:
        return self._columns.all_of(name) if name in self._columns else otherwise

    def _advance(self, left, fraction):
        """Tell the fraction done: each level takes half as long as the one before."""
        total = self._state.setdefault('triangle_count', left)
        done = 1 - left / total * (1 - fraction / 2)
        self._progress(min(done, 0.999))

    def _next_planes(self, level, segments) -> np.ndarray:
        """Return planes that divide the next level, which has half the triangles, into blocks."""
        rng = np.random.default_rng((level, 1 << 31))
        count = self._columns.length(f'{level}.faces')
        block_count = round(count / 2 / BLOCK_TRIANGLES)
        if block_count < 2:
            return kd_planes(np.zeros((0, 3)), 1, rng)
        places = np.linspace(0, count - 1, block_count * _PROBES).astype(int)
        # In the order of blocks, which pieces do not change.
        segments = segments[np.argsort(segments[:, 0], kind='stable')]
        ends = np.cumsum(segments[:, 2])
        of_segment = np.searchsorted(ends, places, side='right')
        places += (segments[:, 1] + segments[:, 2] - ends)[of_segment]
        faces = self._columns[f'{level}.faces'].take(places)
        vertices, faces = np.unique(faces, return_inverse=True)
        points = self._vertices_of('points', vertices)
        return kd_planes(points[faces.reshape(-1, 3)].mean(1), block_count, rng)

    def _vertices_of(self, name, vertices) -> np.ndarray:
        """Return an array of vertices, those of the full mesh and later ones."""
        first_new = self._state['level_starts'][1]
        split = int(np.searchsorted(vertices, first_new))
        found = [self._columns[f'base.{name}'].take(vertices[:split])]
        if split < len(vertices):
            found.append(self._columns[f'new.{name}'].take(vertices[split:] - first_new))
        return np.concatenate(found)

    def _load(self, level, k, segments, planes, is_last) -> Block:
        """Return a block of a level."""
        triangles = self._rows_of(level, TRIANGLE_ARRAYS, segments[:, 1:3])
        samples = self._rows_of(level, SAMPLE_ARRAYS, segments[:, 3:5])
        if 'sample_faces' in samples:  # counted from the start of their segment
            starts = np.cumsum([0, *segments[:-1, 2]])
            samples['sample_faces'] += np.repeat(starts, segments[:, 4]).astype(np.int32)
        vertices, faces = np.unique(triangles['faces'], return_inverse=True)
        if not level:
            samples['sample_vertices'] = vertices.astype(np.int32)
        triangles['faces'] = faces.reshape(-1, 3).astype(np.int32)
        self._vertices[int(k)] = vertices
        if 'made_by' not in triangles:
            triangles['made_by'] = np.full(len(triangles['faces']), NO_CELL, np.int32)
        makers = np.unique(triangles['made_by'])
        makers = makers[makers != NO_CELL]
        return Block(
            (level, int(k)),
            self._bounds,
            self._state['texture_unit'],
            {
                name: self._vertices_of(name, vertices)
                for name in VERTEX_ARRAYS
                if f'base.{name}' in self._columns
            },
            triangles,
            samples,
            None if level else self._columns['is_shared'].take(vertices),
            makers,
            self._cells['errors'][makers],
            self._cells['boxes'][makers],
            planes,
            is_last,
        )

    def _rows_of(self, level, names, spans_of_rows) -> dict[str, np.ndarray]:
        columns = {name: f'{level}.{name}' for name in names}
        return {
            name: np.concatenate(
                [self._columns[column][a : a + n] for a, n in spans_of_rows.tolist()]
            )
            for name, column in columns.items()
            if column in self._columns
        }

    def _take(self, level, result: SimplifiedBlock, vertices):
        """Write what a block adds to the hierarchy and to the next level."""
        columns = self._columns
        first_vertex = columns.length('base.points') + columns.length('new.points')
        new_count = len(result.new_vertices['points'])
        numbers = np.append(vertices, first_vertex + np.arange(new_count)).astype(np.int32)
        first_cell = columns.length('errors')

        def cells(made_by):
            return np.where(made_by < NO_CELL, first_cell - 2 - made_by, made_by).astype(np.int32)

        if result.own_vertices:
            self._append_spread('own', vertices, result.own_vertices)
        for name, values in result.new_vertices.items():
            columns.append(f'new.{name}', values)
        children, parents = numbers[result.merges].T
        order = np.argsort(children)
        self._append_spread('merges', children[order], {'parents': parents[order] + 1})
        for name, values in result.cells.items():
            columns.append(name, values)
        probes = result.probes['probes']
        probes[:, 0], probes[:, 2:] = cells(probes[:, 0]), numbers[probes[:, 2:]]
        for name, values in result.probes.items():
            columns.append(name, values)
        for kind, patches in (('full', result.full_patches), ('other', result.other_patches)):
            patches['patch_cells'] = cells(patches['patch_cells'])
            patches['vertices'] = numbers[patches['vertices']]
            for name, values in patches.items():
                columns.append(f'{kind}.{name}', values)
        if result.triangles:
            result.triangles['faces'] = numbers[result.triangles['faces']]
            result.triangles['made_by'] = cells(result.triangles['made_by'])
            self._append_level(level + 1, result)

    def _append_level(self, level, result):
        columns = self._columns
        blocks, counts, sample_counts = result.segments.T
        first = columns.length(f'{level}.faces') + np.cumsum([0, *counts[:-1]])
        first_samples = columns.length(f'{level}.samples') + np.cumsum([0, *sample_counts[:-1]])
        for name, values in (result.triangles | result.samples).items():
            columns.append(f'{level}.{name}', values)
        rows = np.stack([blocks, first, counts, first_samples, sample_counts], 1)
        columns.append(f'{level}.segments', rows)

    # -- arrays by vertex, from rows in any order ------------------------------------------------

    def _append_spread(self, kind, vertices, arrays):
        """Add values of vertices, in the order of these, for `_joined`."""
        if len(vertices):
            start = self._columns.length(f'{kind}.vertices')
            row = [start, start + len(vertices), vertices[0], vertices[-1] + 1]
            self._columns.append(f'{kind}.segments', np.array([row], np.int64))
            self._columns.append(f'{kind}.vertices', np.asarray(vertices, np.int32))
            for name, values in arrays.items():
                self._columns.append(f'{kind}.{name}', values)

    def _joined(self, kind, name, count, like, join=np.add) -> Iterator[np.ndarray]:
        """Yield pieces of the sums, or else, by vertex of what `_append_spread` wrote."""
        segments = self._all_of(f'{kind}.segments', np.zeros((0, 4), np.int64))
        for start, stop in spans(count, self._rows):
            joined = np.zeros((stop - start, *like.shape[1:]), like.dtype)
            is_inside = (segments[:, 2] < stop) & (segments[:, 3] > start)
            for a, b in segments[is_inside, :2].tolist():
                vertices = self._columns[f'{kind}.vertices'][a:b]
                i, j = np.searchsorted(vertices, (start, stop))
                values = self._columns[f'{kind}.{name}'][a + i : a + j]
                places = vertices[i:j] - start
                joined[places] = join(joined[places], values)
            yield joined

    def _set_vertices(self):
        """Sum what blocks of the full mesh know of their vertices."""
        columns, count = self._columns, self._state['level_starts'][1]
        for areas in self._joined('own', 'areas', count, np.zeros(0, np.float32)):
            columns.append('base.areas', areas)
        if 'own.normals' in columns:
            for normals in self._joined('own', 'normals', count, np.zeros((0, 3), np.float32)):
                columns.append('base.normals', unit(normals))
        columns.drop(*(f'own.{n}' for n in ('segments', 'vertices', 'areas', 'normals')))

    def _finished(self) -> dict[str, list]:
        columns, state = self._columns, self._state
        vertex_count = state['level_starts'][-1]
        columns.drop('parents', 'unit_normals')
        # Cells that meet at a vertex alone, as between two holes, may each merge it: one counts.
        like = np.zeros(0, np.int32)
        for parents in self._joined('merges', 'parents', vertex_count, like, np.maximum):
            columns.append('parents', parents - 1)
        for kind in ('base', 'new'):
            for start, stop in spans(columns.length(f'{kind}.normals'), self._rows):
                normals = unit(columns[f'{kind}.normals'][start:stop])
                columns.append('unit_normals', normals)
        small = {
            name: np.concatenate([columns.all_of(f'{kind}.{name}') for kind in ('full', 'other')])
            for name in PATCH_ARRAYS
        }
        starts = np.concatenate([[[0, 0]], np.cumsum(small['patch_sizes'], axis=0)])
        return {
            'origin': [np.array(state['origin'])],
            'points': self._parts('base.points', 'new.points'),
            'normals': self._parts('unit_normals'),
            'parents': self._parts('parents'),
            'level_starts': [np.array(state['level_starts'], np.int64)],
            'areas': self._parts('base.areas'),
            'vertex_of_point': self._parts('vertex_of_point'),
            'mesh_cells': self._parts('full.mesh_cells'),
            'edge_flags': self._parts('full.edge_flags'),
            **{name: [self._all_of(name, empty)] for name, empty in _NO_CELLS.items()},
            'probes': self._parts('probes'),
            'probe_weights': self._parts('probe_weights'),
            'patch_cells': [small['patch_cells']],
            'patch_boxes': [small['patch_boxes']],
            'vertex_starts': [starts[:, 0]],
            'triangle_starts': [starts[:, 1]],
            'vertices': self._parts('full.vertices', 'other.vertices'),
            'triangles': self._parts('full.triangles', 'other.triangles'),
            'texture_coordinates': self._parts(
                'full.texture_coordinates', 'other.texture_coordinates'
            ),
        }

    def _parts(self, *names) -> list:
        return [self._columns[name] for name in names if name in self._columns]


def whole(parts) -> np.ndarray:
    """Return the array of some columns."""
    arrays = [part[:] for part in parts]
    return arrays[0] if len(arrays) == 1 else np.concatenate(arrays)
