"""Half the triangles of one cell, with its border locked and its error measured."""

from __future__ import annotations

from dataclasses import dataclass, replace

import fast_simplification
import numpy as np
import scipy  # whose modules load when they are first used

from pvibr.large.textured_cell import (
    CellTexture,
    SimplifiedTexture,
    seams,
    simplified_texture,
    texture_distances,
)

#: Size to which a cell is scaled: thresholds of the simplifier are absolute.
_SIZE = 0.1
#: How fast the simplifier's threshold grows: slowly, which leaves smaller errors.
_AGGRESSIVENESS = 3.0
#: Triangles left, relative to those of the cell, from which simplification has failed.
_STUCK = 0.85
#: Share of a skirt's triangles that remains where the border is halved.
_SKIRT_SHARE = 0.85
#: Percentile of the distances of samples that is the error of a cell.
_PERCENTILE = 99.5
#: Distance of the farthest sample relative to the error of a cell, at most.
_OUTLIER = 3.0
#: Triangles, by their centres, among which the nearest of a sample is looked for; of one in so
#: many samples, those farthest off, among more.
_NEIGHBOURS, _FAR_SHARE, _FAR_NEIGHBOURS = 6, 16, 64


@dataclass(frozen=True)
class Cell:
    """The triangles of a cell, their points in double precision, and samples of the full mesh."""

    points: np.ndarray
    faces: np.ndarray
    #: Whether edge k of a face, from corner k to the next, is of the mesh's own border, (m, 3).
    is_border: np.ndarray
    #: Points of the full mesh, (s, 3).
    samples: np.ndarray
    #: Number of the first of these that are random; the others were farthest off before.
    random_count: int
    #: Bounds (low, high) that no point leaves, those of the full mesh, (2, 3).
    bounds: np.ndarray
    texture: CellTexture | None = None

    @property
    def held(self) -> np.ndarray:
        """Whether edge k of a face is to stay: of the mesh's own border, or a seam, (m, 3)."""
        if self.texture is None:
            return self.is_border
        return self.is_border | seams(self.faces, self.texture.wedges, len(self.points))


@dataclass(frozen=True)
class SimplifiedCell:
    """What replaces a cell."""

    points: np.ndarray
    faces: np.ndarray
    is_border: np.ndarray
    #: Point of the cell that each point continues; another one where it has moved.
    continued: np.ndarray
    #: Whether a point has moved, or others were merged into it.
    is_new: np.ndarray
    #: Point that each point of the cell was merged into, -1 for none.
    merged_into: np.ndarray
    #: Face nearest to each sample.
    nearest: np.ndarray
    #: Distance of each sample.
    distances: np.ndarray
    #: Distance that nearly all samples keep.
    error: float
    texture: SimplifiedTexture | None = None


def simplify_cell(cell) -> SimplifiedCell | None:
    """Return a cell with about half its triangles, or None where its border leaves too many."""
    low, high = cell.points.min(0), cell.points.max(0)
    size = float((high - low).max()) / _SIZE or 1.0
    names = 'points', 'samples', 'bounds'
    scaled = replace(cell, **{name: (getattr(cell, name) - low) / size for name in names})
    if cell.texture is not None:
        scaled = replace(scaled, texture=cell.texture.scaled(size))
    held = cell.held
    collapsed = _collapsed(scaled, held) if held.any() else None
    collapsed = collapsed or _collapsed(scaled)
    if collapsed is None:
        return None
    points, faces, kept, continued, merged_into = collapsed
    if not len(faces) or len(faces) > _STUCK * len(cell.faces):
        return None
    child_counts = np.bincount(merged_into[merged_into >= 0], minlength=len(points))
    points = np.clip(points, *scaled.bounds)
    is_new = (points != scaled.points[continued]).any(1) | (child_counts > 1)
    texture, squared = None, None
    if scaled.texture is not None:
        texture = simplified_texture(scaled.texture, scaled, points, kept, merged_into)
        squared = texture_distances(scaled, points, faces, texture)
    nearest, distances = nearest_faces(scaled.samples, points, faces, squared)
    error = _error_of(distances, cell.random_count)
    is_border = _border_of(cell, faces, continued, is_new)
    points = np.where(is_new[:, None], points * size + low, cell.points[continued])
    distances *= size
    found = nearest, distances, error * size, texture
    return SimplifiedCell(points, faces, is_border, continued, is_new, merged_into, *found)


def _error_of(distances, random_count) -> float:
    """Return the error of distances: what nearly all keep, and of which none is a multiple."""
    if not random_count:
        return 0.0
    most = np.percentile(distances[:random_count], _PERCENTILE)
    return float(max(most, distances.max() / _OUTLIER))


def _collapsed(cell, held=None):
    """Return points and faces, which faces and points these continue, and where points went.

    Return None if it is unknown. Edges that are held have a skirt.
    """
    points, faces, skirt_count = cell.points, cell.faces, 0
    if held is not None:
        points, faces = _with_skirt(cell, held)
        skirt_count = len(faces) - len(cell.faces)
    target = max(len(cell.faces) // 2 + int(_SKIRT_SHARE * skirt_count), 2)
    new_points, new_faces, collapses = fast_simplification.simplify(
        np.ascontiguousarray(points),
        np.ascontiguousarray(faces, np.int32),
        target_count=target,
        agg=_AGGRESSIVENESS,
        preserve_border=True,
        return_collapses=True,
    )
    survivors = _survivors(len(points), collapses)
    # Points without triangles are left out of the result, in which all others keep their order.
    mapped = survivors[faces]
    kept = np.flatnonzero(has_three_corners(mapped))
    continued = np.unique(mapped[kept])
    if len(continued) != len(new_points):
        return None
    own_count, own_new = len(cell.points), int(np.searchsorted(continued, len(cell.points)))
    if skirt_count and not _keeps_skirt(survivors, own_count):
        return None
    rank = np.full(len(points), -1, np.int32)
    rank[continued] = np.arange(len(continued))
    new_faces = np.asarray(new_faces, np.int32)
    new_faces = new_faces[(new_faces < own_new).all(1)]
    kept = kept[kept < len(cell.faces)]
    if cell.texture is not None and not np.array_equal(rank[mapped[kept]], new_faces):
        return None
    merged_into = rank[survivors[:own_count]]
    return new_points[:own_new], new_faces, kept, continued[:own_new], merged_into


def _survivors(count, collapses) -> np.ndarray:
    """Return the point that each of a number of points was merged into, often itself."""
    survivors = np.arange(count)
    collapses = np.asarray(collapses).reshape(-1, 2)
    survivors[collapses[:, 1]] = collapses[:, 0]
    while True:
        further = survivors[survivors]
        if np.array_equal(further, survivors):
            return survivors
        survivors = further


def _with_skirt(cell, held) -> tuple[np.ndarray, np.ndarray]:
    """Return a cell with triangles that go down from edges that are held."""
    # They make a border interior, so that it is simplified as well, and their planes hold it.
    points, faces = cell.points, cell.faces
    edges = np.stack([faces, np.roll(faces, -1, axis=1)], 2)[held]
    corners = points[faces]
    face_normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals = np.stack(
        [np.bincount(faces.ravel(), np.repeat(n, 3), len(points)) for n in face_normals.T], 1
    )
    border, places = np.unique(edges, return_inverse=True)
    low = places.reshape(-1, 2) + len(points)
    normals = normals[border]
    normals /= np.linalg.norm(normals, axis=1, keepdims=True) + 1e-300
    depth = 2 * np.linalg.norm(points[edges[:, 1]] - points[edges[:, 0]], axis=1).mean()
    skirt = np.concatenate(
        [np.c_[edges[:, 1], edges[:, 0], low[:, 0]], np.c_[edges[:, 1], low[:, 0], low[:, 1]]]
    )
    return np.concatenate([points, points[border] - depth * normals]), np.concatenate(
        [faces, skirt]
    )


def _keeps_skirt(survivors, own_count) -> bool:
    """Return True if the lower points of a skirt stayed, and nothing was merged into them."""
    stayed = survivors[own_count:] == np.arange(own_count, len(survivors))
    return bool(stayed.all() and (survivors[:own_count] < own_count).all())


def has_three_corners(faces) -> np.ndarray:
    """Return whether the corners of faces are different points."""
    first, second, third = faces.T
    return (first != second) & (second != third) & (third != first)


def edges_once(faces, count) -> np.ndarray:
    """Return whether edge k of each face is used by no other face, (m, 3)."""
    ends = np.sort(np.stack([faces, np.roll(faces, -1, axis=1)], 2).reshape(-1, 2), axis=1)
    keys = ends[:, 0].astype(np.int64) * count + ends[:, 1]
    order = np.argsort(keys, kind='stable')
    sorted_keys = keys[order]
    is_first = np.r_[True, sorted_keys[1:] != sorted_keys[:-1]]
    is_once = np.empty(len(keys), bool)
    is_once[order] = is_first & np.r_[is_first[1:], True]
    return is_once.reshape(-1, 3)


def _border_of(cell, faces, continued, is_new) -> np.ndarray:
    """Return which edges of the new faces are of the mesh's own border, not of the cell's."""
    is_once = edges_once(faces, len(continued))
    if not cell.is_border.any():
        return np.zeros_like(is_once)
    is_cut = edges_once(cell.faces, len(cell.points)) & ~cell.is_border
    old_ends = np.stack([cell.faces, np.roll(cell.faces, -1, axis=1)], 2)[is_cut]
    ids = np.where(is_new, -1, continued)
    new_ends = ids[np.stack([faces, np.roll(faces, -1, axis=1)], 2)]
    count = len(cell.points)
    old_keys = old_ends.min(1).astype(np.int64) * count + old_ends.max(1)
    new_keys = new_ends.min(2).astype(np.int64) * count + new_ends.max(2)
    return is_once & ~(np.isin(new_keys, old_keys) & (new_ends >= 0).all(2))


def nearest_faces(places, points, faces, squared=None) -> tuple[np.ndarray, np.ndarray]:
    """Return the face nearest to each place among those around it, and its distance.

    `squared` returns squared distances of some places from faces near them.
    """
    corners = points[faces]
    if squared is None:

        def squared(own, near):
            return _squared_distances(places[own][:, None], corners[near])

    tree = scipy.spatial.cKDTree(corners.mean(1), balanced_tree=False, compact_nodes=False)
    nearest, distances = _nearest_of(tree, places, np.arange(len(places)), _NEIGHBOURS, squared)
    # The nearest may be a large face, the centre of which is far.
    far = np.argsort(distances)[-(len(distances) // _FAR_SHARE) :]
    nearest[far], distances[far] = _nearest_of(tree, places, far, _FAR_NEIGHBOURS, squared)
    return nearest, distances


def _nearest_of(tree, places, own, count, squared) -> tuple[np.ndarray, np.ndarray]:
    """Return the nearest of the faces with the nearest centres, and its distance."""
    faces = np.minimum(tree.query(places[own], min(count, tree.n))[1], tree.n - 1)
    faces = faces.reshape(len(own), -1)
    all_squared = squared(own, faces)
    best, rows = all_squared.argmin(1), np.arange(len(own))
    return faces[rows, best], np.sqrt(all_squared[rows, best])


def _squared_distances(places, corners) -> np.ndarray:
    """Return squared distances of places (..., 3) from triangles (..., 3, 3)."""
    # Of the plane where the place is above the triangle, else of the nearest edge.
    starts, sides = corners, np.roll(corners, -1, axis=-2) - corners
    to_place = places[..., None, :] - starts
    along = (to_place * sides).sum(-1) / np.maximum((sides * sides).sum(-1), 1e-300)
    gaps = to_place - np.clip(along, 0, 1)[..., None] * sides
    edge_distances = (gaps * gaps).sum(-1).min(-1)
    normals = np.cross(sides[..., 0, :], sides[..., 1, :])
    lengths = np.maximum((normals * normals).sum(-1), 1e-300)
    heights = (to_place[..., 0, :] * normals).sum(-1)
    inward = (np.cross(normals[..., None, :], sides) * to_place).sum(-1)
    is_above = (inward >= 0).all(-1)
    return np.where(is_above, heights * heights / lengths, edge_distances)
