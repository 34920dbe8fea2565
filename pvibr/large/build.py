"""Build the hierarchy of a mesh by batched multi-triangulation.

Cignoni et al., "Batched Multi Triangulation", IEEE Visualization 2005: at each level all triangles
are divided into cells anew, and each cell is simplified with its border locked.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from pvibr.large.cells import kd_cells
from pvibr.large.hierarchy import NO_CELL, Hierarchy
from pvibr.large.merging import merged_points
from pvibr.large.simplified_cell import Cell, edges_once, has_three_corners, simplify_cell
from pvibr.large.wedges import Wedges

#: Random samples of the full mesh by which the error of a cell is measured, and how many of those
#: farthest off are measured again.
_SAMPLES, _FARTHEST = 960, 64
#: Points of a draft, about.
_DRAFT_POINTS = 100_000
#: Cubes along the longest side of the grid by which points of drafts are counted, and of theirs.
_ROUGH_GRID, _FINEST_GRID = 48, 300
_NOTHING = np.zeros(0, np.int64)
#: Levels at most; each has about half the triangles of the one before.
_LEVELS = 40


@dataclass
class TriangleMesh:
    """The triangles of a mesh, with equal points merged."""

    #: Points of the mesh, (n, 3), float32 or float64.
    points: np.ndarray
    #: Triangles as numbers of points, (m, 3).
    faces: np.ndarray
    #: Cell of the user's mesh that each triangle is of, (m,).
    mesh_cells: np.ndarray
    #: Normals of the points if the mesh has any, (n, 3).
    normals: np.ndarray | None = None
    #: Texture coordinates of the points if the mesh has any, (n, 2).
    texture_coordinates: np.ndarray | None = None
    #: Edges of each triangle that are edges of its cell, bits 1, 2 and 4, (m,) uint8; all if None.
    edge_flags: np.ndarray | None = None


@dataclass
class _Level:
    """The triangles that are left at a level."""

    faces: np.ndarray
    is_border: np.ndarray
    #: Cell that made each triangle.
    made_by: np.ndarray
    samples: np.ndarray
    #: Triangle nearest to each sample, and its distance.
    sample_faces: np.ndarray
    sample_distances: np.ndarray
    #: Number of each triangle in the full mesh, -1 for simplified ones.
    numbers: np.ndarray
    #: Wedge of each corner, (m, 3), and texture coordinates of samples, (s, 5); (.., 0) without.
    wedges: np.ndarray
    sample_coordinates: np.ndarray


def build_hierarchy(
    mesh: TriangleMesh, progress: Callable[[float], Any] = lambda fraction: None
) -> Hierarchy:
    """Return the hierarchy of a mesh."""
    return _Builder(mesh, merged_points, progress).build(_LEVELS)


def build_draft(mesh: TriangleMesh) -> Hierarchy:
    """Return a hierarchy of one level, of a mesh with few points, to be drawn until it is built.

    Rossignac and Borrel, "Multi-resolution 3D approximations for rendering complex scenes", 1993.
    """
    return _Builder(mesh, clustered_points, lambda fraction: None).build(0)


class _Builder:
    """A hierarchy in the making."""

    def __init__(self, mesh, merge, progress):
        self._mesh, self._progress = mesh, progress
        self._rng = np.random.default_rng(0)
        points = np.asarray(mesh.points)
        self._origin = _box(points).astype(float).mean(0)
        points, self._vertex_of_point = merge(points - self._origin)
        faces = self._vertex_of_point[mesh.faces]
        is_area = has_three_corners(faces)
        self._faces, self._face_numbers = faces[is_area], np.flatnonzero(is_area)
        self._corner_wedges = np.zeros((len(self._faces), 0), np.int32)
        self._wedges: Wedges | None = None
        if mesh.texture_coordinates is not None:
            self._wedges = Wedges(mesh.texture_coordinates, self._vertex_of_point)
            self._corner_wedges = self._wedges.of_point[mesh.faces[is_area]]
        if not len(self._faces):
            raise ValueError('mesh must have triangles, got none with an area')
        # As they are drawn: what is locked keeps its place to the bit.
        self._points = points.astype(np.float32).astype(np.float64)
        self._bounds = _box(self._points)
        self._parents = np.full(len(points), -1, np.int32)
        self._level_starts = [0, len(points)]
        self._errors: list[float] = []
        self._boxes: list[np.ndarray] = []
        self._patches: list[tuple[int, int, np.ndarray]] = []
        self._patch_numbers: list[np.ndarray] = []

    def build(self, level_count) -> Hierarchy:
        """Simplify level by level until one cell is left, or none gets smaller."""
        level = self._full_level()
        for _ in range(level_count):
            cells = kd_cells(self._centers(level.faces), self._rng)
            if len(cells) == 1:
                break
            level, has_changed = self._coarser(level, cells)
            if not has_changed:
                break
        for ids in kd_cells(self._centers(level.faces), self._rng):
            self._record(level, ids, NO_CELL)
        self._progress(1.0)
        return self._finished()

    def _full_level(self) -> _Level:
        """Return the triangles of the full mesh, with a sample at each vertex."""
        faces, corners = self._faces, self._faces
        if self._wedges is not None:
            corners = self._corner_wedges
        used = np.unique(corners)
        owners = np.zeros(used[-1] + 1, np.int32)
        owners[corners.ravel()] = np.repeat(np.arange(len(faces), dtype=np.int32), 3)
        vertices, coordinates = used, np.zeros((len(used), 0))
        if self._wedges is not None:
            # One of each vertex: at a pole there may be hundreds.
            vertices, first = np.unique(self._wedges.vertices[used], return_index=True)
            used = used[first]
            coordinates = self._wedges.samples(used, self._points, faces, corners)
        return _Level(
            faces,
            edges_once(faces, len(self._points)),
            np.full(len(faces), NO_CELL, np.int32),
            self._points[vertices],
            owners[used],
            np.zeros(len(used)),
            self._face_numbers,
            self._corner_wedges,
            coordinates,
        )

    def _centers(self, faces) -> np.ndarray:
        points = self._points.astype(np.float32)
        return (points[faces[:, 0]] + points[faces[:, 1]] + points[faces[:, 2]]) / 3

    def _coarser(self, level, cells) -> tuple[_Level, bool]:
        """Return the next level, and whether a cell could be simplified."""
        sample_ids = self._samples_of(level, cells)
        vertices: list[np.ndarray] = []
        cell_wedges: list[np.ndarray] = []
        jobs = self._jobs(level, cells, sample_ids, vertices, cell_wedges)
        parts: list[_Level] = []
        merges: list[tuple[np.ndarray, np.ndarray]] = []
        new_points: list[np.ndarray] = []
        offset, next_vertex, has_changed = 0, len(self._points), False
        for k, simplified in enumerate(map(simplify_cell, jobs)):
            ids, samples = cells[k], sample_ids[k]
            if simplified is None:
                local = np.searchsorted(np.sort(ids), level.sample_faces[samples])
                ids = np.sort(ids)
                part = _kept(level, ids, samples, local + offset)
            else:
                new_vertices = np.flatnonzero(simplified.is_new)
                numbers = vertices[k][simplified.continued]
                numbers[new_vertices] = next_vertex + np.arange(len(new_vertices))
                next_vertex += len(new_vertices)
                new_points.append(simplified.points[new_vertices])
                merges.append(_merges(vertices[k], simplified, numbers))
                self._replace(level, ids, simplified.error)
                wedges = np.zeros((len(simplified.faces), 0), np.int32)
                if self._wedges is not None:
                    texture, is_new = simplified.texture, simplified.is_new
                    wedges = self._wedges.added(cell_wedges[k], texture, numbers, is_new)
                part = _Level(
                    numbers[simplified.faces],
                    simplified.is_border,
                    np.full(len(simplified.faces), len(self._errors) - 1, np.int32),
                    level.samples[samples],
                    (simplified.nearest + offset).astype(np.int32),
                    simplified.distances,
                    np.full(len(simplified.faces), -1),
                    wedges,
                    level.sample_coordinates[samples],
                )
                has_changed = True
            vertices[k] = cell_wedges[k] = _NOTHING
            parts.append(part)
            offset += len(part.faces)
            self._advance(len(level.faces), (k + 1) / len(cells))
        self._add_vertices(new_points, merges)
        return _joined(parts), has_changed

    def _jobs(self, level, cells, sample_ids, vertices, cell_wedges) -> Iterator[Cell]:
        """Yield the cells to simplify, and note the vertices and wedges of each."""
        for ids, samples in zip(cells, sample_ids, strict=True):
            own_vertices, faces = np.unique(level.faces[ids], return_inverse=True)
            vertices.append(own_vertices)
            own_wedges, texture = _NOTHING, None
            if self._wedges is not None:
                coordinates = level.sample_coordinates[samples]
                own_wedges, texture = self._wedges.cell(level.wedges[ids], coordinates)
            cell_wedges.append(own_wedges)
            yield Cell(
                self._points[own_vertices],
                faces.reshape(-1, 3).astype(np.int32),
                level.is_border[ids],
                level.samples[samples],
                min(len(samples), _SAMPLES),
                self._bounds,
                texture,
            )

    def _samples_of(self, level, cells) -> list[np.ndarray]:
        """Return the samples of each cell, at most as many as it needs."""
        cell_of_face = np.empty(len(level.faces), np.int32)
        for k, ids in enumerate(cells):
            cell_of_face[ids] = k
        cell_of_sample = cell_of_face[level.sample_faces]
        order = np.argsort(cell_of_sample, kind='stable')
        ends = np.searchsorted(cell_of_sample[order], np.arange(1, len(cells)))
        return [self._some(level, ids) for ids in np.split(order, ends)]

    def _some(self, level, ids) -> np.ndarray:
        """Return random samples of some, then those farthest off: small pieces have few."""
        if len(ids) <= _SAMPLES + _FARTHEST:
            return ids
        distances = level.sample_distances[ids]
        order = np.argpartition(distances, -_FARTHEST)
        others = ids[order[:-_FARTHEST]]
        farthest = ids[order[-_FARTHEST:]]
        return np.append(self._rng.choice(others, _SAMPLES, replace=False), farthest)

    def _advance(self, left, fraction):
        """Tell the fraction done: each level takes half as long as the one before."""
        done = 1 - left / len(self._faces) * (1 - fraction / 2)
        self._progress(min(done, 0.999))

    def _replace(self, level, ids, error):
        """Note that a cell has replaced triangles."""
        number = len(self._errors)
        children = np.unique(level.made_by[ids])
        children = children[children >= 0]
        corners = self._points[level.faces[ids].ravel()]
        boxes = np.array([_box(corners), *(self._boxes[c] for c in children)])
        self._boxes.append(np.stack([boxes[:, 0].min(0), boxes[:, 1].max(0)]))
        self._errors.append(max([error, *(self._errors[c] for c in children)]))
        self._record(level, ids, number)

    def _record(self, level, ids, replaced_by):
        """Note the patches of triangles that one cell replaces."""
        ids = ids[np.argsort(level.made_by[ids], kind='stable')]
        makers = level.made_by[ids]
        for part in np.split(ids, np.flatnonzero(makers[1:] != makers[:-1]) + 1):
            made_by = int(level.made_by[part[0]])
            corners = level.faces if self._wedges is None else level.wedges
            self._patches.append((made_by, replaced_by, corners[part]))
            self._patch_numbers.append(level.numbers[part] if made_by == NO_CELL else _NOTHING)

    def _add_vertices(self, new_points, merges):
        """Add the vertices of a new level, and note what was merged into them."""
        added = np.concatenate([np.zeros((0, 3)), *new_points])
        self._parents = np.append(self._parents, np.full(len(added), -1, np.int32))
        for children, parents in merges:
            self._parents[children] = parents
        self._points = np.concatenate([self._points, added])
        if self._wedges is not None:
            self._wedges.end_level()
        self._level_starts.append(len(self._points))

    def _finished(self) -> Hierarchy:
        # Those of the full mesh come first, and so do their triangles.
        order = sorted(range(len(self._patches)), key=lambda k: self._patches[k][0] != NO_CELL)
        drawn_points = self._points.astype(np.float32)
        patch_vertices, patch_triangles, boxes = [], [], []
        coordinates = [np.zeros((0, 2), np.float32)]
        for k in order:
            own_vertices, faces = np.unique(self._patches[k][2], return_inverse=True)
            if self._wedges is not None:
                coordinates.append(self._wedges.coordinates[own_vertices].astype(np.float32))
                own_vertices = self._wedges.vertices[own_vertices]
            patch_vertices.append(own_vertices.astype(np.int32))
            patch_triangles.append(faces.reshape(-1, 3).astype(np.uint16))
            boxes.append(_box(drawn_points[own_vertices]))
        areas, normals = self._areas_and_normals()
        numbers = np.concatenate([self._patch_numbers[k] for k in order]).astype(np.int64)
        flags = self._mesh.edge_flags
        cell_count = len(self._errors)
        hierarchy = Hierarchy(
            origin=self._origin,
            points=drawn_points,
            normals=np.zeros((0, 3), np.float32),
            parents=self._parents,
            level_starts=np.array(self._level_starts, np.int64),
            areas=areas,
            vertex_of_point=self._vertex_of_point,
            mesh_cells=np.asarray(self._mesh.mesh_cells)[numbers].astype(np.int64),
            edge_flags=np.zeros(0, np.uint8) if flags is None else flags[numbers],
            errors=np.array(self._errors).reshape(cell_count),
            boxes=np.array(self._boxes).reshape(cell_count, 2, 3),
            patch_cells=np.array([self._patches[k][:2] for k in order], np.int32),
            patch_boxes=np.array(boxes, np.float64),
            vertex_starts=np.cumsum([0, *map(len, patch_vertices)]),
            triangle_starts=np.cumsum([0, *map(len, patch_triangles)]),
            vertices=np.concatenate(patch_vertices),
            triangles=np.concatenate(patch_triangles),
            texture_coordinates=np.concatenate(coordinates),
        )
        return with_normals(hierarchy, normals)

    def _areas_and_normals(self):
        """Return areas around vertices, and normals of the mesh's points."""
        corners = self._points[self._faces]
        crosses = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        lengths = np.linalg.norm(crosses, axis=1)
        count = self._level_starts[1]
        areas = np.bincount(self._faces.ravel(), np.repeat(lengths, 3), count)
        # A point without area counts as little as can be, but has its own values.
        areas = np.maximum(areas, 1e-12 * max(areas.max(), 1e-300)).astype(np.float32)
        if self._mesh.normals is not None:
            return areas, self._mesh.normals
        # The mean of the facets' unit normals, as VTK has it.
        crosses /= np.maximum(lengths, 1e-300)[:, None]
        sums = [np.bincount(self._faces.ravel(), np.repeat(n, 3), count) for n in crosses.T]
        # `with_normals` divides by their lengths.
        return areas, np.stack(sums, 1)[self._vertex_of_point]


def _box(points) -> np.ndarray:
    """Return the lowest and highest coordinates of points, (2, 3)."""
    return np.array([[axis.min() for axis in points.T], [axis.max() for axis in points.T]])


def with_normals(hierarchy, normals) -> Hierarchy:
    """Return a hierarchy with unit normals of all vertices, from those of the mesh's points."""
    means = hierarchy.averaged(normals)
    lengths = np.linalg.norm(means, axis=1, keepdims=True)
    is_known = lengths[:, 0] > 0
    means = np.where(is_known[:, None], means / np.where(lengths > 0, lengths, 1), (0, 0, 1))
    arrays = hierarchy.to_arrays() | {'normals': means.astype(np.float32)}
    return Hierarchy(**arrays)


def clustered_points(points) -> tuple[np.ndarray, np.ndarray]:
    """Return one point of each cube of a grid that has any, and the place of each among them."""
    low, high = _box(points)
    extent = float((high - low).max()) or 1.0
    side = extent / _ROUGH_GRID
    occupied = _cubes(points[:: max(len(points) // _DRAFT_POINTS, 1)], low, side)[1]
    # The number of cubes that a surface meets grows with the square of the grid.
    side *= min(max((len(occupied) / _DRAFT_POINTS) ** 0.5, _ROUGH_GRID / _FINEST_GRID), 1.0)
    places, first = _cubes(points, low, side)
    return points[first], places


def _cubes(points, low, side) -> tuple[np.ndarray, np.ndarray]:
    """Return the cube of each point, numbered, and a point of each cube."""
    cubes = ((points - low) / side).astype(np.int64)
    shape = _box(cubes)[1] + 1
    keys = (cubes[:, 0] * shape[1] + cubes[:, 1]) * shape[2] + cubes[:, 2]
    point_of_key = np.full(int(shape.prod()), -1, np.int32)
    point_of_key[keys] = np.arange(len(keys), dtype=np.int32)
    occupied = np.flatnonzero(point_of_key >= 0)
    first = point_of_key[occupied]
    point_of_key[occupied] = np.arange(len(occupied), dtype=np.int32)
    return point_of_key[keys], first


def _merges(vertices, simplified, numbers) -> tuple[np.ndarray, np.ndarray]:
    """Return the vertices that new ones were made of, and these."""
    targets = simplified.merged_into
    is_merged = targets >= 0
    is_merged[is_merged] = simplified.is_new[targets[is_merged]]
    return vertices[is_merged], numbers[targets[is_merged]].astype(np.int32)


def _kept(level, ids, samples, sample_faces) -> _Level:
    """Return the triangles of a cell that could not be simplified."""
    return _Level(
        level.faces[ids],
        level.is_border[ids],
        level.made_by[ids],
        level.samples[samples],
        sample_faces.astype(np.int32),
        level.sample_distances[samples],
        level.numbers[ids],
        level.wedges[ids],
        level.sample_coordinates[samples],
    )


def _joined(parts) -> _Level:
    names = _Level.__dataclass_fields__
    return _Level(**{n: np.concatenate([getattr(p, n) for p in parts]) for n in names})
