"""Views of lights and projectors, in float64."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from pvibr.maths import octahedral

#: Clip space, -1 to 1, to texture space, 0 to 1: the bias matrix of Everitt et al.
TEXTURE_FROM_CLIP = np.array(
    [[0.5, 0, 0, 0.5], [0, 0.5, 0, 0.5], [0, 0, 0.5, 0.5], [0, 0, 0, 1.0]]
)
# Which of the six bounds of a box each corner has.
_CORNERS = np.array([[2 * k + ((i >> k) & 1) for k in range(3)] for i in range(8)])
# Along x, y and z, both ways, with an upward direction each.
_FACES = [(s * np.eye(3)[k], np.eye(3)[(k + 1) % 3]) for k in range(3) for s in (1.0, -1.0)]


@dataclass(frozen=True, eq=False)
class View:
    """A camera pose and its projection; the eye looks along -z, clip z is -w (near) to w (far).

    World units; `position` is by default that of `view_from_world`.
    """

    view_from_world: np.ndarray
    clip_from_view: np.ndarray
    near: float
    far: float
    parallel: bool
    position: np.ndarray | None = None

    @property
    def eye(self) -> np.ndarray:
        """Position, (3,), world units."""
        if self.position is not None:
            return self.position
        return -self.view_from_world[:3, :3].T @ self.view_from_world[:3, 3]

    def camera(self) -> tuple:
        """Return position, a point looked at, and the upward direction, world units."""
        axes, eye = self.view_from_world[:3, :3], self.eye
        return eye, eye - axes[2] * self.far, axes[1]

    def texture_from_world(self) -> np.ndarray:
        """Return the matrix that takes world space to texture space times w, (4, 4)."""
        return TEXTURE_FROM_CLIP @ self.clip_from_view @ self.view_from_world

    @cached_property
    def side_planes(self) -> np.ndarray:
        """Inward planes of the left, right, bottom and top, view space, (4, 4).

        Those of near and far follow the scene, and cull nothing.
        """
        return frustum_planes(self.clip_from_view)[:4]

    @cached_property
    def is_mirrored(self) -> bool:
        """Whether it is a mirror image, which reverses the winding of faces on the screen."""
        clip = self.clip_from_view
        handedness = np.linalg.det(self.view_from_world[:3, :3])
        return not handedness * clip[0, 0] * clip[1, 1] > 0

    def key(self) -> bytes:
        """Return the matrices as bytes."""
        return self.view_from_world.tobytes() + self.clip_from_view.tobytes()


def frustum_planes(clip_from_view):
    """Return the inward planes (left, right, bottom, top, near, far) of a projection, (6, 4).

    View space; Gribb and Hartmann, "Fast Extraction of Viewing Frustum Planes", 2001.
    """
    m = np.asarray(clip_from_view, float)
    planes = np.concatenate([m[3] + m[:3], m[3] - m[:3]])[[0, 3, 1, 4, 2, 5]]
    return planes / np.linalg.norm(planes[:, :3], axis=1, keepdims=True)


def look_along(eye, direction, up=None) -> np.ndarray:
    """Return view space from world space, (4, 4); any upward direction by default."""
    against_view = -np.asarray(direction, float) / np.linalg.norm(direction)
    if up is None:
        axes = octahedral.frame(against_view)
    else:
        right = np.cross(up, against_view)
        right /= np.linalg.norm(right)
        axes = np.stack([right, np.cross(against_view, right), against_view])
    view_from_world = np.eye(4)
    view_from_world[:3, :3] = axes
    view_from_world[:3, 3] = -axes @ np.asarray(eye, float)
    return view_from_world


def perspective(eye, direction, tangent, near, far, up=None) -> View:
    """Return a square perspective view; `tangent` is that of half the angle of view."""
    half_sides = np.full(2, float(tangent))
    clip_from_view = frustum(-half_sides, half_sides, near, far)
    return View(look_along(eye, direction, up), clip_from_view, float(near), float(far), False)


def frustum(low, high, near, far, distance=1.0) -> np.ndarray:
    """Return the perspective projection of a rectangle at a distance from the eye, (4, 4)."""
    projection = np.zeros((4, 4))
    projection[[0, 1], [0, 1]] = 2 * distance / (high - low)
    projection[[0, 1], [2, 2]] = (high + low) / (high - low)
    projection[2, 2:] = -(far + near) / (far - near), -2 * far * near / (far - near)
    projection[3, 2] = -1
    return projection


def around(eye, near, far, tangent=1.0) -> list[View]:
    """Return the six cube map views around a point, in the order +x, -x, +y, -y, +z, -z.

    A tangent a little over 1 makes neighbours overlap.
    """
    return [perspective(eye, d, tangent, near, far, up) for d, up in _FACES]


def orthographic(axes, low, high) -> View:
    """Return a parallel view of a box, `low` to `high` along `axes`: rows right, up and back."""
    low, high, axes = (np.asarray(value, float) for value in (low, high, axes))
    box_center, half_sides = (low + high) / 2, (high - low) / 2
    depth = 2 * half_sides[2]
    eye = np.array([box_center[0], box_center[1], high[2] + depth])
    view_from_world = np.eye(4)
    view_from_world[:3, :3] = axes
    view_from_world[:3, 3] = -eye
    clip_from_view = np.diag([1 / half_sides[0], 1 / half_sides[1], -2 / depth, 1.0])
    clip_from_view[2, 3] = -3.0  # near is depth, far is twice that: -(far + near) / (far - near)
    return View(view_from_world, clip_from_view, depth, 2 * depth, True)


def corners(bounds) -> np.ndarray:
    """Return the corners of boxes (n, 6), (n, 8, 3)."""
    return np.asarray(bounds, float).reshape(-1, 6)[:, _CORNERS]


def box_distance(point, bounds) -> float:
    """Return the distance of a point to the nearest of boxes (n, 6), 0 inside."""
    ranges, position = np.asarray(bounds, float).reshape(-1, 3, 2), np.asarray(point, float)
    outside = np.maximum(np.maximum(ranges[..., 0] - position, position - ranges[..., 1]), 0)
    return float(np.linalg.norm(outside, axis=1).min())


def may_see(view, bounds) -> np.ndarray:
    """Return which boxes (n, 6) may intersect a view, the near plane ignored."""
    low, high = np.moveaxis(np.asarray(bounds, float).reshape(-1, 3, 2), -1, 0)
    return may_see_boxes(view, low, high)


def may_see_boxes(view, low, high) -> np.ndarray:
    """Return which boxes may intersect a view, by corners (n, 3), as :func:`may_see` does."""
    clip = view.clip_from_view @ view.view_from_world
    # A box is outside if its centre is farther from the plane than its extent along the normal.
    planes = (
        np.stack([sign * clip[axis] for axis, sign in ((0, 1), (0, -1), (1, 1), (1, -1), (2, 1))])
        - clip[3]
    )
    middle, half = (low + high) / 2, (high - low) / 2
    is_outside = middle @ planes[:, :3].T + planes[:, 3] > half @ np.abs(planes[:, :3]).T
    return ~is_outside.any(1)


def covered(view, bounds, size) -> tuple[int, int, int, int]:
    """Return the pixel rectangle (left, bottom, right, top) of a picture that boxes may cover.

    The whole picture if a corner is not ahead.
    """
    box_corners = corners(bounds).reshape(-1, 3)
    clip_from_world = view.clip_from_view @ view.view_from_world
    x, y, _, w = clip_from_world[:, :3] @ box_corners.T + clip_from_world[:, 3:]
    if w.min() <= 0:
        return 0, 0, int(size[0]), int(size[1])
    left_edge, right, bottom, top = (
        min(max(rounding(round(float(extreme) * pixel_count / 2, 6)), 0), pixel_count)
        for screen_shares, pixel_count in ((x / w + 1, size[0]), (y / w + 1, size[1]))
        for rounding, extreme in (
            (math.floor, screen_shares.min()),
            (math.ceil, screen_shares.max()),
        )
    )
    return left_edge, bottom, right, top
