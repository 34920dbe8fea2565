"""Cards of impostors, and the parallax error of an image on a card."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.spatial import HalfspaceIntersection

from pvibr.maths.vectors import unit_vectors
from pvibr.maths.views import View, frustum

# The middle of a card and its corners, as shares of its sides.
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
_BLOCK = 2**16  # points that are looked at together


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
        raise ValueError('points is empty: there must be one or more')
    middle = points.mean(0)
    ends = np.array(
        [_ends(points[k : k + _BLOCK] - middle) for k in range(0, len(points), _BLOCK)]
    )
    low, high = ends[:, 0].min(0), ends[:, 1].max(0)
    size = max(-low.min(), high.max())
    if size == 0.0:
        return np.tile(middle, (_CORNERS, 1))
    # A little thickness, since flat things have none, and the middle must be within.
    reach = np.concatenate([high, -low]) / size + _THICKNESS
    faces = np.concatenate([_NORMALS, -_NORMALS])
    found = HalfspaceIntersection(np.c_[faces, -reach], np.zeros(3)).intersections
    return middle + size * found[np.minimum(np.arange(_CORNERS), len(found) - 1)]


def _ends(points):
    along = _NORMALS @ points.T
    return along.min(1), along.max(1)


def fit_cards(center, corners, radius, eye, up, toward=None) -> Card:
    """Fit cards through the centres of objects, facing the eye (Schaufler 1995).

    `corners` (n, k, 3) are relative to the centres; `toward` the eye, for a parallel view.
    """
    out = (
        np.asarray(eye, float) - center
        if toward is None
        else np.broadcast_to(toward, center.shape)
    )
    away = np.linalg.norm(out, axis=1)
    back = out / away[:, None]
    axes = _facing(back, np.asarray(up, float))
    x, y, z = np.einsum('nij,nkj->ink', axes, corners)
    if toward is None:
        scale = away[:, None] / (away[:, None] - z)
        x, y = x * scale, y * scale
    else:
        away = np.ones_like(away)
    sides = np.stack([x, y], -1)
    depth = np.minimum(np.abs(z).max(1), radius)
    return Card(center, out, axes, sides.min(1), sides.max(1), away, depth)


def _facing(back, up):
    """Return right, up and back, (n, 3, 3), as upright as possible."""
    other = np.eye(3)[np.argmin(np.abs(back), axis=1)]
    steep = np.abs(back @ up) > 0.999 * np.linalg.norm(up)
    right = np.cross(np.where(steep[:, None], other, up), back)
    right /= np.linalg.norm(right, axis=1)[:, None]
    return np.stack([right, np.cross(back, right), back], axis=1)


def card_view(card, k, pad, *, parallel=False) -> View:
    """Return the view in which the image of card `k` is drawn, with a margin in world units."""
    axes, low, high = card.axes[k], card.low[k] - pad, card.high[k] + pad
    reach = 1.001 * card.depth[k]
    away = 3.0 * reach if parallel else card.away[k]
    near, far = away - reach, away + reach
    world = np.eye(4)
    world[:3, :3] = axes
    world[:3, 3] = -axes @ (card.center[k] + away * axes[2])
    if parallel:
        clip = np.zeros((4, 4))
        clip[[0, 1], [0, 1]], clip[[0, 1], [3, 3]] = 2 / (high - low), -(high + low) / (high - low)
        clip[2, 2:] = -2 / (far - near), -(far + near) / (far - near)
        clip[3, 3] = 1.0
    else:
        clip = frustum(low, high, near, far, away)
    return View(world, clip, float(near), float(far), parallel)


def displacement(card, eye, toward=None) -> np.ndarray:
    """Return the largest angle between a point and its image on the card, seen from `eye`, (n,).

    Radians; world units in a parallel view; inf where the eye is within the object's depth.
    """
    places = card.low[:, None] + _SHARES * (card.high - card.low)[:, None]
    on_card = places @ card.axes[:, :2]
    if toward is not None:
        moved = card.depth[:, None] * card.axes[:, 2]
        return np.linalg.norm(np.cross(moved, toward), axis=1)
    ray = (card.eye[:, None] - on_card) / card.away[:, None, None]
    now = np.asarray(eye, float) - card.center
    seen = on_card - now[:, None]
    point = seen + card.depth[:, None, None] * ray
    across = np.linalg.norm(np.cross(seen, point), axis=2)
    along = np.einsum('nki,nki->nk', seen, point)
    ahead = np.einsum('ni,ni->n', now, card.axes[:, 2]) > card.depth
    return np.where(ahead, np.arctan2(across, along).max(1), np.inf)


def stretch_of(middle, radius, tangent) -> np.ndarray:
    """Return the magnification of small angles off the screen's centre, (n,), 1 or more.

    `tangent` is that of the angle between the view's axis and a corner of the screen.
    """
    ahead = np.maximum(-middle[:, 2], 1e-300)
    slope = (np.linalg.norm(middle[:, :2], axis=1) + radius) / ahead
    return 1.0 + np.minimum(slope, tangent) ** 2
