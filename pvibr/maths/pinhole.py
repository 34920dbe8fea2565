"""Calibrated photographs: pinhole cameras with lens distortion, as OpenCV describes them."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from pvibr.core.arguments import checked_numbers
from pvibr.maths import _checks
from pvibr.maths.camera import CV_FROM_GL, PosedCamera, unit_or_nan
from pvibr.maths.distortion import coefficients, distort, undistort, valid_radius
from pvibr.maths.vectors import products

#: Allowed principal points as fractions of the size, if the size that K is for was stated, and if
#: it is guessed: a picture twice or half as large must be detected.
STATED, GUESSED = (-1.0, 2.0), (0.3, 0.7)
_BORDER = 257  # points on each side of a picture whose rays bound the field of view


@dataclass(frozen=True, eq=False)
class Pinhole(PosedCamera):
    """A calibrated photograph's camera, as OpenCV describes it.

    The camera's axes are x right, y down, z ahead; ``x_camera = R @ x_world + t``.

    Parameters
    ----------
    K : array_like, shape (3, 3)
        Focal lengths, skew and principal point in pixels: ``[[fx, s, cx], [0, fy, cy],
        [0, 0, 1]]``.
    R : array_like, shape (3, 3)
        Rotation from world to camera.
    t : array_like, shape (3,)
        World units.
    size : tuple of 2 int
        Width and height in pixels of the picture that K is for.
    distortion : array_like, optional
        k1, k2, p1, p2[, k3[, k4, k5, k6]]; see :func:`distort`.

    Raises
    ------
    ValueError
        If K is singular, not upper triangular or for a picture of another size, R is not a
        rotation, the distortion is invalid or leaves nothing visible, or a number is not finite.

    Examples
    --------
    >>> from pvibr.maths.pinhole import Pinhole
    >>> K = [[100.0, 0.0, 49.5], [0.0, 100.0, 24.5], [0.0, 0.0, 1.0]]
    >>> camera = Pinhole(K, np.eye(3), np.zeros(3), (100, 50))
    >>> uv, depth = camera.project([[0.0, 0.0, 4.0], [1.0, 0.5, 4.0], [0.0, 0.0, -4.0]])
    >>> uv.tolist(), depth.tolist()
    ([[0.5, 0.5], [0.75, 0.25], [nan, nan]], [4.0, 4.0, -4.0])
    """

    # Arguments are array_like; fields are read-only float64.
    K: np.ndarray
    R: np.ndarray
    t: np.ndarray
    size: tuple[int, int]
    distortion: np.ndarray = field(default_factory=lambda: np.zeros(0))

    def __post_init__(self):
        _checks.freeze(
            self,
            size=_checks.size_of(self.size),
            K=check_intrinsics(self.K),
            R=check_rotation(self.R),
            t=checked_numbers('t', self.t, (3,)),
            distortion=coefficients(self.distortion),
        )
        check_principal_point(self.K, self.size, STATED)
        self.undistorted_bounds()

    @property
    def uv_from_plane(self):
        """The affine 2x3 matrix from the (distorted) plane one unit ahead, y down, to uv."""
        width, height = self.size
        (fx, skew, cx), (_, fy, cy) = self.K[:2]
        return np.array(
            [
                [fx / width, skew / width, (cx + 0.5) / width],
                [0.0, -fy / height, 1.0 - (cy + 0.5) / height],
            ]
        )

    @cached_property
    def valid_radius(self):
        """See :func:`valid_radius`."""
        return valid_radius(self.distortion)

    def project(self, points):
        """Project points into the picture; NaN behind the camera and where the lens folds."""
        camera_points = products(self.R, _checks.points_of(points)) + self.t
        depth = camera_points[:, 2]
        in_front = (depth > self._rounding(points))[:, None]
        plane_points = np.full((len(camera_points), 2), np.nan)
        with np.errstate(over='ignore'):
            np.divide(camera_points[:, :2], depth[:, None], out=plane_points, where=in_front)
        return _affine(self.uv_from_plane, distort(plane_points, self.distortion)), depth

    def _rounding(self, points):
        """Return the depth that rounding alone may give a point in the plane of the camera."""
        number_type = getattr(points, 'dtype', np.dtype(np.float64))
        eps = np.finfo(number_type if number_type.kind == 'f' else np.float64).eps
        reach = products(np.abs(self.R[2:]), np.abs(_checks.points_of(points)))[:, 0]
        return 4 * eps * (reach + abs(self.t[2]))

    def rays(self, uv):
        """Return the rays through points of the picture; NaN where the lens sees nothing."""
        matrix = self.uv_from_plane
        plane = np.linalg.solve(matrix[:, :2], (np.asarray(uv, float) - matrix[:, 2]).T).T
        plane = undistort(plane, self.distortion)
        directions = np.column_stack([plane, np.ones(len(plane))]) @ np.linalg.inv(self.R).T
        return np.broadcast_to(self.position, directions.shape).copy(), unit_or_nan(directions)

    def texel(self, points):
        """Return the size of a pixel at points."""
        depth = _checks.points_of(points) @ self.R[2] + self.t[2]
        return depth / np.sqrt(self.K[0, 0] * self.K[1, 1])

    def undistorted_bounds(self):
        """Return the bounds of the field of view, in uv of the camera without its lens."""
        return self._bounds

    @cached_property
    def _bounds(self):
        if not self.distortion.any():
            return 0.0, 1.0, 0.0, 1.0
        matrix = self.uv_from_plane
        plane_points = np.linalg.solve(matrix[:, :2], (_border() - matrix[:, 2]).T).T
        visible = undistort(plane_points, self.distortion)
        if np.isfinite(self.valid_radius):
            # Where the lens ends within the picture, its field of view ends at this circle.
            angles = np.linspace(0, 2 * np.pi, 4 * _BORDER)
            circle = (1 - 1e-9) * self.valid_radius * np.c_[np.cos(angles), np.sin(angles)]
            uv = _affine(matrix, distort(circle, self.distortion))
            visible = np.concatenate([visible, circle[((uv >= 0) & (uv <= 1)).all(axis=1)]])
        visible = _affine(matrix, visible[np.isfinite(visible).all(axis=1)])
        if not len(visible):
            raise ValueError(
                f'distortion must leave rays through a picture of {self.size[0]} x {self.size[1]} '
                f'pixels with K {self.K.tolist()}, got {self.distortion.tolist()}'
            )
        low, high = visible.min(axis=0), visible.max(axis=0)
        return float(low[0]), float(high[0]), float(low[1]), float(high[1])

    def clip_from_view(self, near, far, margin=0.0):
        """Return the projection matrix of the whole field of view, without lens distortion."""
        if not 0 < near < far:
            raise ValueError(f'near must be above 0 and below far, got {near}, {far}')
        depth_row = np.array([0.0, 0.0, 1.0])
        clip_rows = self.clip_rows(self.uv_from_plane, depth_row, margin)
        depth_ratio = near / far
        matrix = np.zeros((4, 4))
        matrix[:2, :3] = clip_rows @ CV_FROM_GL
        matrix[2, 2:] = -(1 + depth_ratio) / (1 - depth_ratio), -2 * near / (1 - depth_ratio)
        matrix[3, 2] = -1.0
        return matrix + 0.0


def _border():
    """Return points along the four sides of a picture, corners included."""
    along = np.linspace(0, 1, _BORDER)
    zero, one = np.zeros_like(along), np.ones_like(along)
    sides = (along, zero), (along, one), (zero, along), (one, along)
    return np.concatenate([np.column_stack(side) for side in sides])


def check_intrinsics(K):
    """Return K scaled so that its last entry is 1; it must be regular and upper triangular."""
    K = checked_numbers('K', K, (3, 3))
    if K[1, 0] or K[2, 0] or K[2, 1]:
        raise ValueError(f'K must be upper triangular, got {K.tolist()}')
    if not (K.diagonal() > 0).all():
        raise ValueError(f'K must have a diagonal above 0, got {K.diagonal().tolist()}')
    return K / K[2, 2]


def check_rotation(R):
    """Return R as float64 after checking that it is a rotation."""
    R = checked_numbers('R', R, (3, 3))
    identity_error, determinant = np.abs(R @ R.T - np.eye(3)).max(), np.linalg.det(R)
    if identity_error > _checks.ROTATION_TOLERANCE or determinant < 0:
        raise ValueError(
            f'R must be a rotation, got {R.tolist()}: R @ R.T is off the identity by '
            f'{identity_error:.2g} (allowed: {_checks.ROTATION_TOLERANCE}), the determinant is '
            f'{determinant:.6g} (allowed: +1)'
        )
    return R


def check_principal_point(K, size, allowed):
    """Raise a ValueError if K is for a picture of another size, by its principal point."""
    relative_point = (K[:2, 2] + 0.5) / size
    if (relative_point < allowed[0]).any() or (relative_point > allowed[1]).any():
        raise ValueError(
            f'K must have its principal point between {allowed[0]} and {allowed[1]} of the size, '
            f'{size[0]} x {size[1]} pixels, got {K[:2, 2].tolist()}; if K is for another size, '
            'scale it (Pinhole.resized); if the picture is part of a larger one, pass the size '
            'that K is for (Pinhole(..., size=size))'
        )


def _affine(matrix, xy):
    return products(matrix[:, :2], xy) + matrix[:, 2]
