"""A hierarchy by nested grids, made in a moment, that is drawn until the real one is built.

Rossignac and Borrel, "Multi-resolution 3D approximations for rendering complex scenes", 1993: the
vertices in each cube of a grid become one. A cube of a level holds eight of the level before, and
so does a node, whose triangles are a patch. Patches of two levels have other borders; each has the
triangles that reach over its node's, so that they overlap.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator

import numpy as np

from pvibr.large.block import areas_and_normals, box_of, unit
from pvibr.large.distribution import box_of_pieces
from pvibr.large.hierarchy import NO_CELL, Hierarchy
from pvibr.large.merging import as_drawn, merged_rows
from pvibr.large.simplified_cell import has_three_corners

#: Points of the first draft, about, and at most of the one that follows it.
FIRST_POINTS, NEXT_POINTS = 100_000, 6_000_000
#: Cubes along the longest side of the grid by which those of points are counted.
_ROUGH_GRID = 48
#: Cubes up to which they are numbered by a table of all.
_TABLE_CUBES = 1 << 25
#: Side of the cubes of the first grid, in mean distances of vertices, and relative to the extent.
_FIRST_CUBE, _LEAST_CUBE = 2.2, 2.0**-20
#: Binary digits of the number of cubes along a node.
_NODE_BITS = 5
#: Error of a level, in sides of its cubes.
_ERROR = 0.3
#: Triangles of a patch at most: uint16 counts their corners.
_PATCH_TRIANGLES = 16_384


def build_draft(mesh, point_count=FIRST_POINTS) -> Hierarchy:
    """Return a hierarchy to draw until that of a mesh is built, of about so many points."""
    points = np.asarray(mesh.points)
    bounds = box_of_pieces(points, len(points))
    origin = bounds.mean(0)
    points = as_drawn(points - origin)
    if len(points) > point_count:
        points, vertex_of_point = clustered_points(points, point_count)
    else:
        first, vertex_of_point = merged_rows(points.view(np.uint32))
        points = points[first]
    vertex_of_point = vertex_of_point.astype(np.int32)
    faces = vertex_of_point[mesh.faces]
    is_area = has_three_corners(faces)
    faces = faces[is_area]
    areas, normals = areas_and_normals(points, faces, bounds)
    if mesh.normals is not None:
        normals = _sums(vertex_of_point, np.nan_to_num(mesh.normals), len(points))
    levels = _Levels(points, unit(normals), areas, faces)
    coordinates = np.zeros((0, 2), np.float32)
    if mesh.texture_coordinates is not None:
        # Points that were merged have coordinates of their own.
        coordinates = np.nan_to_num(np.asarray(mesh.texture_coordinates, np.float32))
        levels.point_faces, levels.vertex_of_point = mesh.faces[is_area], vertex_of_point
    if len(points) < len(mesh.points):
        levels.turn()
    levels.add_all()
    arrays = levels.arrays()
    corners, rows = arrays.pop('corners'), arrays.pop('rows')
    return Hierarchy(
        origin=origin,
        areas=areas,
        vertex_of_point=vertex_of_point,
        mesh_cells=np.asarray(mesh.mesh_cells, np.int64)[is_area][rows],
        edge_flags=np.zeros(0, np.uint8),
        probes=np.zeros((0, 5), np.int32),
        probe_weights=np.zeros((0, 3), np.float32),
        texture_coordinates=coordinates[corners] if len(coordinates) else coordinates,
        **arrays,
    )


class _Levels:
    """The levels of a draft in the making."""

    def __init__(self, points, normals, areas, faces):
        self._made: dict[str, list] = defaultdict(list)
        self._level = 0
        # The last level: its vertices, and its triangles by these.
        self._points, self._normals, self._weights = points, normals, areas.astype(float)
        self._faces = faces
        #: The triangles by points if patches have a vertex for each, and the vertices of points.
        self.point_faces: np.ndarray | None = None
        self.vertex_of_point = np.arange(len(points))
        # Cubes of the vertices, (v, 3), the nodes that these are in, and the cubes of nodes.
        low, high = box_of(points)
        side = _FIRST_CUBE * float(areas.sum() / 6 / len(points)) ** 0.5
        self._side = max(side, float((high - low).max()) * _LEAST_CUBE) or 1.0
        self._cubes = ((points - low) / self._side).astype(np.int32)
        self._node_cubes, _, self._nodes = _numbered(self._cubes >> (_NODE_BITS - 1))
        self._node_boxes = _no_boxes(len(self._node_cubes))
        self._first_vertex, self._cell_count = 0, 0

    def add_all(self):
        """Add all levels, each of which has about a quarter of the triangles of the one before."""
        while True:
            is_last = len(self._node_cubes) == 1
            node_cubes, _, parents = _numbered(self._node_cubes >> 1)
            cells_of_nodes = np.full((len(parents), 2), NO_CELL, np.int32)
            if self._level:
                cells_of_nodes[:, 0] = self._cell_count + np.arange(len(parents))
                self._cell_count += len(parents)
            if not is_last:
                cells_of_nodes[:, 1] = self._cell_count + parents
            self._add_patches(cells_of_nodes)
            self._first_vertex += len(self._points)
            self._made['points'].append(self._points)
            self._made['normals'].append(self._normals)
            if is_last:
                self._made['parents'].append(np.full(len(self._points), -1, np.int32))
                return
            self._coarsen(node_cubes, parents)
            self._level += 1

    def _add_patches(self, cells_of_nodes):
        """Add patches of the nodes, and the cells that made them."""
        made, faces = self._made, self._faces if self.point_faces is None else self.point_faces
        places = np.empty(len(self.vertex_of_point), np.int32)
        for node, rows in _rows_of_nodes(self._nodes[self._faces]):
            corners, triangles = _compacted(faces[rows], places)
            vertices = corners if self.point_faces is None else self.vertex_of_point[corners]
            box = box_of(self._points[vertices])
            made['vertices'].append((vertices + self._first_vertex).astype(np.int32))
            made['triangles'].append(triangles.astype(np.uint16))
            made['corners'].append(corners)
            made['patch_cells'].append(cells_of_nodes[node, None])
            made['patch_boxes'].append(box[None])
            made['patch_sizes'].append(np.array([[len(corners), len(triangles)]]))
            if not self._level:
                made['rows'].append(rows)
            _widen(self._node_boxes, np.array([node]), box[None])
        if self._level:
            error = _ERROR * self._side * 2.0 ** (self._level - 1)
            made['errors'].append(np.full(len(self._node_boxes), error))
            made['boxes'].append(self._node_boxes)

    def _coarsen(self, node_cubes, parents):
        """Merge the vertices of each cube of the next level, in whose nodes the nodes are."""
        cubes, first, targets = _numbered(self._cubes >> min(self._level, 1))
        count = len(cubes)
        self._made['parents'].append((self._first_vertex + targets).astype(np.int32))
        weights = self._weights[:, None]
        self._weights = np.bincount(targets, self._weights, count)
        points = _sums(targets, self._points * weights, count) / self._weights[:, None]
        self._points = points.astype(np.float32)
        self._normals = unit(_sums(targets, self._normals * weights, count))
        self._cubes, self._nodes = cubes, parents[self._nodes[first]]
        faces = targets[self._faces]
        is_area = has_three_corners(faces)
        self._faces = faces[is_area]
        if self.point_faces is not None:
            self.point_faces = self.point_faces[is_area]
            self.vertex_of_point = targets[self.vertex_of_point]
        boxes, self._node_boxes = self._node_boxes, _no_boxes(len(node_cubes))
        _widen(self._node_boxes, parents, boxes)
        self._node_cubes = node_cubes
        self.turn()

    def turn(self):
        """Turn triangles that face away from the normals of their corners: folds, seen dark."""
        a, b, c = (self._points[corner] for corner in self._faces.T)
        normals = [self._normals[corner] for corner in self._faces.T]
        facing = np.einsum(
            'ij,ij->i', np.cross(b - a, c - a), normals[0] + normals[1] + normals[2]
        )
        is_turned = (facing < 0)[:, None]
        self._faces = np.where(is_turned, self._faces[:, ::-1], self._faces)
        if self.point_faces is not None:
            self.point_faces = np.where(is_turned, self.point_faces[:, ::-1], self.point_faces)

    def arrays(self) -> dict[str, np.ndarray]:
        """Return arrays of a hierarchy by name, and the corners and rows of its patches."""
        made: dict[str, list] = self._made | {
            'errors': [np.zeros(0), *self._made['errors']],
            'boxes': [_no_boxes(0), *self._made['boxes']],
        }
        level_sizes = [len(points) for points in made['points']]
        arrays = {name: np.concatenate(parts) for name, parts in made.items()}
        starts = np.cumsum(np.r_[[[0, 0]], arrays.pop('patch_sizes')], axis=0)
        arrays |= {'vertex_starts': starts[:, 0], 'triangle_starts': starts[:, 1]}
        return arrays | {'level_starts': np.cumsum([0, *level_sizes])}


def _rows_of_nodes(nodes) -> Iterator[tuple[int, np.ndarray]]:
    """Yield each node, and some triangles that have corners in it, from the nodes of corners."""
    first, second, third = nodes.T
    columns = [
        np.arange(len(nodes)),
        np.flatnonzero(second != first),
        np.flatnonzero((third != first) & (third != second)),
    ]
    rows = np.concatenate(columns).astype(np.int32)
    nodes = np.concatenate([nodes[own, k] for k, own in enumerate(columns)])
    order = np.argsort(nodes, kind='stable')
    rows, nodes = rows[order], nodes[order]
    starts = np.flatnonzero(np.r_[True, nodes[1:] != nodes[:-1]])
    for start, end in zip(starts.tolist(), [*starts[1:].tolist(), len(nodes)], strict=True):
        for k in range(start, end, _PATCH_TRIANGLES):
            yield int(nodes[start]), rows[k : min(k + _PATCH_TRIANGLES, end)]


def _compacted(faces, places) -> tuple[np.ndarray, np.ndarray]:
    """Return the different corners of faces, and faces by their places, by a table to fill."""
    corners = faces.ravel()
    numbers = np.arange(len(corners), dtype=np.int32)
    places[corners] = numbers
    own = corners[places[corners] == numbers]
    places[own] = numbers[: len(own)]
    return own, places[corners].reshape(faces.shape)


def clustered_points(points, point_count) -> tuple[np.ndarray, np.ndarray]:
    """Return the mean in each cube of a grid that has points, and the place of each among them."""
    low, high = box_of(points)
    side = float((high - low).max()) / _ROUGH_GRID or 1.0
    stride = max(len(points) // point_count, 1)
    occupied = _numbered(((points[::stride] - low) / side).astype(np.int32))[0]
    # The number of cubes that a surface meets grows with the square of the grid.
    side = max(side * (len(occupied) / point_count) ** 0.5, _ROUGH_GRID * side * _LEAST_CUBE)
    places = _numbered(((points - low) / side).astype(np.int32))[2]
    counts = np.bincount(places)
    return as_drawn(_sums(places, points, len(counts)) / counts[:, None]), places


def _numbered(cubes) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the different ones of cubes, one that is each, and the number of each cube."""
    shape = cubes.max(0).astype(np.int64) + 1
    keys = (cubes[:, 0] * shape[1] + cubes[:, 1]) * shape[2] + cubes[:, 2]
    if shape.prod() > _TABLE_CUBES:
        _, places, numbers = np.unique(keys, return_index=True, return_inverse=True)
        return cubes[places], places, numbers.astype(np.int32)
    table = np.full(int(shape.prod()), -1, np.int32)
    table[keys] = np.arange(len(keys), dtype=np.int32)
    occupied = np.flatnonzero(table >= 0)
    first = table[occupied]
    table[occupied] = np.arange(len(occupied), dtype=np.int32)
    return cubes[first], first, table[keys]


def _sums(places, values, count) -> np.ndarray:
    """Return sums of values (n, 3) by place."""
    return np.stack([np.bincount(places, axis, count) for axis in values.T], 1)


def _no_boxes(count) -> np.ndarray:
    """Return boxes that hold nothing, (n, 2, 3)."""
    return np.repeat([[[np.inf] * 3, [-np.inf] * 3]], count, axis=0)


def _widen(boxes, places, others):
    """Let boxes hold others."""
    np.minimum.at(boxes[:, 0], places, others[:, 0])
    np.maximum.at(boxes[:, 1], places, others[:, 1])
