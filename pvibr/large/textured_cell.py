"""Texture coordinates of a simplified cell: seams stay, and what slides on the surface is error.

A wedge is the corners of triangles at a vertex that share texture coordinates; an edge is a seam
where its triangles have other wedges. Hoppe, "New Quadric Metric for Simplifying Meshes with
Appearance Attributes", IEEE Visualization 1999.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import scipy  # whose modules load when they are first used


@dataclass(frozen=True)
class CellTexture:
    """Texture coordinates of the wedges and samples of a cell."""

    #: Wedge of each corner of the cell's faces, (m, 3).
    wedges: np.ndarray
    #: Texture coordinates of each wedge, (w, 2).
    coordinates: np.ndarray
    #: Texture coordinates of each sample, and their metric on the surface, (s, 5).
    samples: np.ndarray

    def scaled(self, size) -> CellTexture:
        """Return it for a cell whose coordinates were divided by a size."""
        return replace(self, samples=self.samples / (1, 1, *[size * size] * 3))


@dataclass(frozen=True)
class SimplifiedTexture:
    """Texture coordinates of what replaces a cell."""

    #: Wedge of each corner of the faces, (n, 3).
    wedges: np.ndarray
    #: Texture coordinates of each wedge, (w, 2), and its point.
    coordinates: np.ndarray
    points: np.ndarray
    #: Wedge of the cell that each continues, where its point did not move.
    continued: np.ndarray


def seams(faces, wedges, count) -> np.ndarray:
    """Return whether edge k of each face is a seam, of one of its faces, (m, 3)."""
    ends, own = (np.stack([c, np.roll(c, -1, axis=1)], 2).reshape(-1, 2) for c in (faces, wedges))
    is_down = ends[:, 0] > ends[:, 1]
    ends[is_down], own[is_down] = ends[is_down, ::-1], own[is_down, ::-1]
    keys = ends[:, 0].astype(np.int64) * count + ends[:, 1]
    order = np.argsort(keys, kind='stable')
    is_first = np.r_[True, np.diff(keys[order]) != 0]
    firsts = order[is_first][np.cumsum(is_first) - 1]
    is_seam = np.empty(len(keys), bool)
    is_seam[order] = (own[order] != own[firsts]).any(1)
    return is_seam.reshape(-1, 3)


def simplified_texture(texture, cell, points, kept, merged_into) -> SimplifiedTexture:
    """Return the texture coordinates of the faces of a cell that were kept.

    `points` are the new ones, of which `merged_into` tells that of each old one, -1 for none.
    """
    components = _merged_wedges(texture, merged_into[cell.faces])
    new_corners, places = np.unique(components[texture.wedges[kept]], return_inverse=True)
    count = len(new_corners)
    rank = np.full(len(texture.coordinates), -1)
    rank[new_corners] = np.arange(count)
    new_wedges = rank[components]  # of each old one
    owners, continued = np.empty(count, int), np.empty(count, int)
    own_corners = new_wedges[texture.wedges]
    is_used = own_corners >= 0
    owners[own_corners[is_used]] = merged_into[cell.faces][is_used]
    continued[own_corners[is_used]] = texture.wedges[is_used]
    # Of the surface that was there, on the same side of the seam: nothing slides.
    faces, wedges = is_used.nonzero()[0], own_corners[is_used]
    corners, spots = cell.points[cell.faces[faces]], points[owners[wedges]]
    weights = closest_weights(spots, corners)
    gaps = np.einsum('ij,ijk->ik', weights, corners) - spots
    distances = np.einsum('ij,ij->i', gaps, gaps)
    order = np.lexsort((distances, wedges))
    best = order[np.r_[True, np.diff(wedges[order]) != 0]]
    own = texture.coordinates[texture.wedges[faces[best]]]
    coordinates = np.einsum('ij,ijk->ik', weights[best], own)
    return SimplifiedTexture(places.reshape(-1, 3), coordinates, owners, continued)


def _merged_wedges(texture, new_points) -> np.ndarray:
    """Return a number for each wedge, equal where edges between them have vanished."""
    starts, ends = texture.wedges, np.roll(texture.wedges, -1, axis=1)
    has_vanished = (new_points == np.roll(new_points, -1, axis=1)) & (new_points >= 0)
    pairs, count = (starts[has_vanished], ends[has_vanished]), len(texture.coordinates)
    graph = scipy.sparse.coo_array((np.ones(len(pairs[0])), pairs), (count, count))
    return scipy.sparse.csgraph.connected_components(graph, directed=False)[1]


def texture_distances(cell, points, faces, texture):
    """Return a function of samples and faces near them: squared distances on the surface.

    With the way that the texture slides between them, so many units of length.
    """
    coordinates = texture.coordinates[texture.wedges]

    def squared(samples, near):
        places, corners = cell.samples[samples][:, None], points[faces[near]]
        weights = closest_weights(places, corners)
        gaps = np.einsum('...j,...jk->...k', weights, corners) - places
        own = cell.texture.samples[samples][:, None]
        slides = np.einsum('...j,...jk->...k', weights, coordinates[near]) - own[..., :2]
        u, v = slides[..., 0], slides[..., 1]
        ways = own[..., 2] * u * u + 2 * own[..., 3] * u * v + own[..., 4] * v * v
        return (gaps * gaps).sum(-1) + np.maximum(ways, 0)

    return squared


def closest_weights(places, corners) -> np.ndarray:
    """Return barycentric coordinates of the points of triangles closest to places, (..., 3).

    Ericson, "Real-Time Collision Detection", 2005, 5.1.5.
    """
    sides = np.roll(corners, -1, axis=-2) - corners
    to_place = places[..., None, :] - corners
    first, second = sides[..., 0, :], -sides[..., 2, :]
    a, b, c = (_dot(*pair) for pair in ((first, first), (first, second), (second, second)))
    along_first, along_second = _dot(to_place[..., 0, :], first), _dot(to_place[..., 0, :], second)
    area = a * c - b * b
    safe_area = np.where(area > 0, area, 1.0)
    v = (c * along_first - b * along_second) / safe_area
    w = (a * along_second - b * along_first) / safe_area
    inner = np.stack([1 - v - w, v, w], -1)
    shares = np.clip(_dot(to_place, sides) / np.maximum(_dot(sides, sides), 1e-300), 0, 1)
    gaps = to_place - shares[..., None] * sides
    nearest = _dot(gaps, gaps).argmin(-1)
    share = np.take_along_axis(shares, nearest[..., None], -1)
    outer = np.zeros_like(inner)
    np.put_along_axis(outer, nearest[..., None], 1 - share, -1)
    np.put_along_axis(outer, (nearest[..., None] + 1) % 3, share, -1)
    is_inside = (area > 0) & (inner >= 0).all(-1)
    return np.where(is_inside[..., None], inner, outer)


def _dot(first, second) -> np.ndarray:
    return np.einsum('...i,...i->...', first, second)
