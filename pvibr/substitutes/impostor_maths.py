"""Cards of impostors, and the parallax error of an image on a card."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.spatial import HalfspaceIntersection

from pvibr.maths.vectors import cross, unit_vectors
from pvibr.maths.views import View, frustum

# The centre of a card and its corners, as fractions of its sides.
_SHARES = np.array([[0.5, 0.5], [0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])


def _icosahedral() -> np.ndarray:
    """Return the corners and edge midpoints of an icosahedron, one of each antipodal pair."""
    gold = (1 + 5**0.5) / 2
    first: list[tuple[float, ...]] = [(0, 1, gold), (0, 1, -gold), (1, 0, 0)]
    first += [(1, j * gold, k * (gold + 1)) for j in (1, -1) for k in (1, -1)]
    normals = np.array([np.roll(n, shift) for n in first for shift in range(3)])
    return unit_vectors(normals)


_NORMALS = _icosahedral()
_CORNERS, _THICKNESS = 80, 1e-3
_BLOCK = 2**16  # points per batch


class Card(NamedTuple):
    """The planes through n objects' centres that face the eye, and the rectangles they cover.

    Rows of `axes` are right, up, toward the eye; `low`, `high` and `eye` count from `center`.
    """

    center: np.ndarray  # (n, 3)
    eye: np.ndarray  # (n, 3), or the unit vector toward it in a parallel view
    axes: np.ndarray  # (n, 3, 3)
    low: np.ndarray  # (n, 2), along right and up
    high: np.ndarray
    away: np.ndarray  # (n,), distance of the eye from the card, 1 in a parallel view
    depth: np.ndarray  # (n,), extent of the object to either side of the card

    def rows(self, index) -> Card:
        """Return a selection."""
        return Card(*(field[index] for field in self))


def box_corners(half) -> np.ndarray:
    """Return the corners (n, 8, 3) of boxes from half their edges, relative to their centres."""
    signs = np.array([[(i >> k & 1) * 2.0 - 1.0 for k in range(3)] for i in range(8)])
    return signs @ np.asarray(half, float)


def dop_corners(points) -> np.ndarray:
    """Return the corners, (80, 3), of a polytope of 42 faces that holds all points (a k-DOP).

    A rotated box covers about twice the area of its contents, this about a tenth more.
    """
    points = np.asarray(points, float).reshape(-1, 3)
    if not len(points):
        raise ValueError('points must have one or more rows, got none')
    centroid = points.mean(0)
    batches = (points[k : k + _BLOCK] - centroid for k in range(0, len(points), _BLOCK))
    ends = np.array([(along.min(1), along.max(1)) for along in (_NORMALS @ b.T for b in batches)])
    low_ends, high_ends = ends[:, 0].min(0), ends[:, 1].max(0)
    size = max(-low_ends.min(), high_ends.max())
    if size == 0.0:
        return np.tile(centroid, (_CORNERS, 1))
    # Flat shapes need some thickness, since the centroid must be inside.
    slab_reach = np.concatenate([high_ends, -low_ends]) / size + _THICKNESS
    face_normals = np.concatenate([_NORMALS, -_NORMALS])
    corners = HalfspaceIntersection(np.c_[face_normals, -slab_reach], np.zeros(3)).intersections
    return centroid + size * corners[np.minimum(np.arange(_CORNERS), len(corners) - 1)]


def fit_cards(center, corners, radius, eye, up, toward=None) -> Card:
    """Fit cards through the centres of objects, facing the eye (Schaufler 1995).

    `corners` (n, k, 3) are relative to the centres; `toward` the eye, for a parallel view.
    """
    to_eye = (
        np.asarray(eye, float) - center
        if toward is None
        else np.broadcast_to(toward, center.shape)
    )
    away = np.linalg.norm(to_eye, axis=1)
    eye_direction = to_eye / away[:, None]
    axes = _facing(eye_direction, np.asarray(up, float))
    x, y, z = np.einsum('nij,nkj->ink', axes, corners)
    if toward is None:
        perspective_scale = away[:, None] / (away[:, None] - z)
        x, y = x * perspective_scale, y * perspective_scale
    else:
        away = np.ones_like(away)
    sides = np.stack([x, y], -1)
    depth = np.minimum(np.abs(z).max(1), radius)
    return Card(center, to_eye, axes, sides.min(1), sides.max(1), away, depth)


def _facing(eye_direction, up):
    """Return right, up and back, (n, 3, 3), as upright as possible."""
    least_axis = np.eye(3)[np.argmin(np.abs(eye_direction), axis=1)]
    is_steep = np.abs(eye_direction @ up) > 0.999 * np.linalg.norm(up)
    right = cross(np.where(is_steep[:, None], least_axis, up), eye_direction)
    right /= np.linalg.norm(right, axis=1)[:, None]
    return np.stack([right, cross(eye_direction, right), eye_direction], axis=1)


def card_view(card, card_index, pad, *, parallel=False) -> View:
    """Return the view in which the image of card `k` is drawn, with a margin in world units."""
    axes = card.axes[card_index]
    low = card.low[card_index] - pad
    high = card.high[card_index] + pad
    half_depth = 1.001 * card.depth[card_index]
    eye_distance = 3.0 * half_depth if parallel else card.away[card_index]
    near, far = eye_distance - half_depth, eye_distance + half_depth
    view_from_world = np.eye(4)
    view_from_world[:3, :3] = axes
    view_from_world[:3, 3] = -axes @ (card.center[card_index] + eye_distance * axes[2])
    if parallel:
        clip_from_view = np.zeros((4, 4))
        clip_from_view[[0, 1], [0, 1]] = 2 / (high - low)
        clip_from_view[[0, 1], [3, 3]] = -(high + low) / (high - low)
        clip_from_view[2, 2:] = -2 / (far - near), -(far + near) / (far - near)
        clip_from_view[3, 3] = 1.0
    else:
        clip_from_view = frustum(low, high, near, far, eye_distance)
    return View(view_from_world, clip_from_view, float(near), float(far), parallel)


def displacement(card, eye, toward=None) -> np.ndarray:
    """Return the largest angle between a point and its image on the card, seen from `eye`, (n,).

    Radians; world units in a parallel view; inf where the eye is within the object's depth.
    """
    rect_points = card.low[:, None] + _SHARES * (card.high - card.low)[:, None]
    card_points = rect_points @ card.axes[:, :2]
    if toward is not None:
        depth_offsets = card.depth[:, None] * card.axes[:, 2]
        return np.linalg.norm(cross(depth_offsets, toward), axis=1)
    eye_rays = (card.eye[:, None] - card_points) / card.away[:, None, None]
    eye_offsets = np.asarray(eye, float) - card.center
    image_directions = card_points - eye_offsets[:, None]
    point_directions = image_directions + card.depth[:, None, None] * eye_rays
    cross_lengths = np.linalg.norm(cross(image_directions, point_directions), axis=2)
    dot_products = np.einsum('nki,nki->nk', image_directions, point_directions)
    is_ahead = np.einsum('ni,ni->n', eye_offsets, card.axes[:, 2]) > card.depth
    return np.where(is_ahead, np.arctan2(cross_lengths, dot_products).max(1), np.inf)


def stretch_of(view_centers, radius, tangent) -> np.ndarray:
    """Return the magnification of small angles off the screen's centre, (n,), 1 or more.

    `tangent` is that of the angle between the view's axis and a corner of the screen.
    """
    view_depths = np.maximum(-view_centers[:, 2], 1e-300)
    edge_slopes = (np.linalg.norm(view_centers[:, :2], axis=1) + radius) / view_depths
    return 1.0 + np.minimum(edge_slopes, tangent) ** 2
