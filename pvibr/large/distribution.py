"""A mesh read in pieces: equal points merged, and its triangles divided into blocks."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from pvibr.large.block import box_of, unit
from pvibr.large.cells import BLOCK_TRIANGLES, blocks_of, kd_planes
from pvibr.large.columns import Columns
from pvibr.large.merging import as_drawn, row_hashes
from pvibr.large.simplified_cell import has_three_corners
from pvibr.large.wedges import areas_of, unit_length

#: Triangles by whose centres blocks are divided, per block.
_PROBES = 500
#: Blocks of a vertex that no triangle has yet, and of one that several blocks have.
_NO_BLOCK, _SHARED = 65535, 65534


def spans(count, rows) -> Iterator[tuple[int, int]]:
    """Yield where pieces of some rows start and stop."""
    for start in range(0, count, rows):
        yield start, min(start + rows, count)


def box_of_pieces(points, rows) -> np.ndarray:
    """Return the bounds of points, (2, 3); raise a ValueError where one is not finite."""
    boxes = []
    for start, stop in spans(len(points), rows):
        boxes.append(box_of(points[start:stop]))
        if not np.isfinite(boxes[-1]).all():
            piece = np.asarray(points[start:stop])
            invalid = start + int(np.argmin(np.isfinite(piece).all(1)))
            raise ValueError(
                f'mesh.points[{invalid}] must be finite, got {points[invalid : invalid + 1][0]}'
            )
    if not boxes:
        raise ValueError('mesh must have points, got an empty one')
    return np.stack([np.min(boxes, 0)[0], np.max(boxes, 0)[1]])


def merge_points(columns: Columns, points, origin, rows):
    """Write vertices, float32 about an origin, and the vertex of each point."""
    # Points that look the same in single precision are the same. They keep the order of the mesh,
    # which keeps neighbours together.
    drawn, first_of = _copies(columns, points, origin, rows)
    ranks = columns.scratch('ranks', len(points), np.int32)
    vertex_count = 0
    for start, stop in spans(len(points), rows):
        is_first = first_of[start:stop] == np.arange(start, stop)
        ranks[start:stop] = vertex_count + np.cumsum(is_first) - 1
        vertex_count += int(is_first.sum())
        columns.append('base.points', drawn[start:stop][is_first])
    for start, stop in spans(len(points), rows):
        columns.append('vertex_of_point', ranks[first_of[start:stop]])
    columns.drop('drawn', 'ranks', 'first_of')


def _copies(columns, points, origin, rows):
    """Return points as they are drawn, and the first point that is equal to each."""
    bits = max(int(np.ceil(np.log2(max(len(points) / rows, 1)))), 0)
    first_of = columns.scratch('first_of', len(points), np.int32)
    for start, stop in spans(len(points), rows):
        drawn = as_drawn(np.asarray(points[start:stop], float) - origin)
        columns.append('drawn', drawn)
        hashes = row_hashes(drawn.view(np.uint32))
        first_of[start:stop] = np.arange(start, stop)
        buckets = hashes >> np.uint64(64 - bits) if bits else np.zeros(len(hashes), np.uint64)
        for bucket in np.unique(buckets):
            inside = np.flatnonzero(buckets == bucket)
            columns.append(f'hashes{bucket}', hashes[inside])
            columns.append(f'places{bucket}', (start + inside).astype(np.int32))
    drawn = columns['drawn']
    for bucket in range(1 << bits):
        names = f'hashes{bucket}', f'places{bucket}'
        if names[0] in columns:
            copies, firsts = _copies_of(*map(columns.all_of, names))
            # Hashes may meet.
            is_equal = (drawn.take(copies) == drawn.take(firsts)).all(1)
            first_of[copies[is_equal]] = firsts[is_equal]
            columns.drop(*names)
    return drawn, first_of


def _copies_of(hashes, places) -> tuple[np.ndarray, np.ndarray]:
    """Return the places of values that are there before, and where these are first."""
    order = np.argsort(hashes, kind='stable')
    hashes = hashes[order]
    is_first = np.r_[True, hashes[1:] != hashes[:-1]]
    if is_first.all():
        return places[:0], places[:0]
    places = places[order]
    firsts = places[is_first][np.cumsum(is_first) - 1]
    return places[~is_first], firsts[~is_first]


def merge_normals(columns: Columns, normals, rows):
    """Write the normals of vertices, the mean of those of their points."""
    count = columns.length('base.points')
    sums = columns.scratch('sums', 3 * count, np.float32)
    for start, stop in spans(len(normals), rows):
        vertices = columns['vertex_of_point'][start:stop]
        piece = np.nan_to_num(np.asarray(normals[start:stop], np.float32))
        for axis in range(3):
            np.add.at(sums, 3 * vertices + axis, piece[:, axis])
    for start, stop in spans(count, rows):
        columns.append('base.normals', unit(sums[3 * start : 3 * stop].reshape(-1, 3)))
    columns.drop('sums')


def divide_triangles(columns: Columns, mesh, rows, rng) -> float:
    """Write the triangles of the full mesh by blocks; return a unit's length in texture space."""
    # Also which vertices several blocks share. Without texture coordinates it is 0.
    areas = np.zeros(2)
    if mesh.texture_coordinates is not None:
        for start, stop in spans(len(mesh.points), rows):
            coordinates = np.nan_to_num(mesh.texture_coordinates[start:stop])
            columns.append('coordinates', as_drawn(coordinates))
    planes = _planes(columns, mesh, rows, rng)
    block_of = columns.scratch('blocks', columns.length('base.points'), np.uint16)
    block_of[:] = _NO_BLOCK
    for start, faces, is_area, of_points in _faces_of(columns, mesh, rows):
        corners = columns['base.points'].take(faces.ravel()).reshape(-1, 3, 3)
        blocks = blocks_of(planes, corners.mean(1))
        order = np.argsort(blocks, kind='stable')
        blocks, faces = blocks[order], faces[order]
        _mark(block_of, faces, blocks.astype(np.uint16))
        own_blocks, counts = np.unique(blocks, return_counts=True)
        first = columns.length('0.faces') + np.cumsum([0, *counts[:-1]])
        columns.append('0.faces', faces)
        mesh_cells = np.asarray(mesh.mesh_cells[start : start + rows], np.int64)
        columns.append('0.mesh_cells', mesh_cells[is_area][order])
        if mesh.edge_flags is not None:
            flags = np.asarray(mesh.edge_flags[start : start + rows])
            columns.append('0.edge_flags', flags[is_area][order])
        if 'coordinates' in columns:
            coordinates = columns['coordinates'].take(of_points.ravel()).reshape(-1, 3, 2)
            areas += areas_of(corners, coordinates)
            columns.append('0.coordinates', coordinates[order])
        nothing = np.zeros_like(counts)
        columns.append('0.segments', np.stack([own_blocks, first, counts, nothing, nothing], 1))
    if not columns.length('0.faces'):
        raise ValueError('mesh must have triangles, got none with an area')
    for start, stop in spans(len(block_of), rows):
        columns.append('is_shared', block_of[start:stop] == _SHARED)
    columns.drop('blocks', 'coordinates')
    has_texture = '0.coordinates' in columns
    return unit_length(areas, box_of_pieces(columns['base.points'], rows)) if has_texture else 0.0


def _planes(columns, mesh, rows, rng) -> np.ndarray:
    """Return planes between blocks, from the centres of some triangles."""
    block_count = round(len(mesh.faces) / BLOCK_TRIANGLES)
    if block_count < 2:
        return kd_planes(np.zeros((0, 3)), 1, rng)
    stride = max(len(mesh.faces) // (block_count * _PROBES), 1)
    centers = [np.zeros((0, 3), np.float32)]
    for start, faces, is_area, _ in _faces_of(columns, mesh, rows):
        # The same ones whatever the pieces are.
        is_probe = (start + np.flatnonzero(is_area)) % stride == 0
        corners = columns['base.points'].take(faces[is_probe].ravel())
        centers.append(corners.reshape(-1, 3, 3).mean(1))
    return kd_planes(np.concatenate(centers), min(block_count, _SHARED), rng)


def _faces_of(columns, mesh, rows):
    """Yield the start of each piece, its triangles by vertices, which they are, and by points."""
    point_count = len(mesh.points)
    for start, stop in spans(len(mesh.faces), rows):
        faces = of_points = np.asarray(mesh.faces[start:stop])
        if faces.min() < 0 or faces.max() >= point_count:
            raise ValueError(
                f'its triangles must be of its {point_count} points, got one of point '
                f'{faces.min() if faces.min() < 0 else faces.max()}'
            )
        faces = columns['vertex_of_point'].take(faces.ravel()).reshape(-1, 3)
        is_area = has_three_corners(faces)
        if is_area.any():
            yield start, faces[is_area], is_area, of_points[is_area]


def _mark(block_of, faces, blocks):
    """Note the blocks of vertices, and which are of several."""
    vertices, blocks = faces.ravel(), np.repeat(blocks, 3)
    known = block_of[vertices]
    is_other = (known != _NO_BLOCK) & (known != blocks)
    block_of[vertices] = blocks
    is_other |= block_of[vertices] != blocks
    block_of[vertices[is_other]] = _SHARED
