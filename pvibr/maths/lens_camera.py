"""Calibrated cameras with any lens, and the pinholes that stand in for them."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from pvibr.core.arguments import checked_numbers
from pvibr.maths import _checks
from pvibr.maths.camera import PosedCamera
from pvibr.maths.lenses import Lens
from pvibr.maths.pinhole import Pinhole, check_intrinsics, check_rotation
from pvibr.maths.vectors import products

#: Directions of the faces of a cube: rows right, down and ahead, in the camera's axes.
_FACES = (
    np.eye(3),
    np.array([[0, 0, -1], [0, 1, 0], [1, 0, 0]]),  # to the right
    np.array([[0, 0, 1], [0, 1, 0], [-1, 0, 0]]),  # to the left
    np.array([[1, 0, 0], [0, 0, -1], [0, 1, 0]]),  # down
    np.array([[1, 0, 0], [0, 0, 1], [0, -1, 0]]),  # up
    np.array([[-1, 0, 0], [0, 1, 0], [0, 0, -1]]),  # behind
)
_OVERLAP = 4  # pixels that neighbouring faces share
_LARGEST = 4096  # pixels along a face
_WIDEST = np.cos(np.radians(75))  # of rays that a single pinhole may have


@dataclass(frozen=True, eq=False)
class LensCamera(PosedCamera):
    """A calibrated camera with a lens of any projection: a fisheye, a panorama.

    The camera's axes are x right, y down, z ahead; ``x_camera = R @ x_world + t``.

    Parameters
    ----------
    K : array_like, shape (3, 3)
        Matrix from the image plane of unit focal length to pixels; integer coordinates are pixel
        centres.
    R : array_like, shape (3, 3)
        Rotation from world to camera.
    t : array_like, shape (3,)
        World units.
    size : tuple of 2 int
        Width and height in pixels.
    lens : Lens
        The projection.

    Raises
    ------
    ValueError
        If K is singular or not upper triangular, R is not a rotation, or a number is not finite.

    Examples
    --------
    >>> from pvibr.maths.lens_camera import LensCamera
    >>> from pvibr.maths.lenses import Lens
    >>> K = [[100 / np.pi, 0, 49.5], [0, 100 / np.pi, 49.5], [0, 0, 1]]
    >>> camera = LensCamera(K, np.eye(3), np.zeros(3), (100, 100), Lens('equidistant'))
    >>> uv, depth = camera.project([[2.0, 0.0, 0.0]])
    >>> uv.round(9).tolist(), depth.tolist()
    ([[1.0, 0.5]], [0.0])
    """

    K: np.ndarray
    R: np.ndarray
    t: np.ndarray
    size: tuple[int, int]
    lens: Lens

    def __post_init__(self):
        lens: object = self.lens
        if not isinstance(lens, Lens):
            raise TypeError(f'lens must be a Lens, got {lens!r:.80}')
        _checks.freeze(
            self,
            size=_checks.size_of(self.size),
            K=check_intrinsics(self.K),
            R=check_rotation(self.R),
            t=checked_numbers('t', self.t, (3,)),
        )

    def project(self, points):
        """Project points into the picture; NaN where the lens shows nothing."""
        camera_points = products(self.R, _checks.points_of(points)) + self.t
        pixels = products(self.K[:2, :2], self.lens.image(camera_points)) + self.K[:2, 2]
        u, v = ((pixels + 0.5) / self.size).T
        return np.c_[u, 1 - v], camera_points[:, 2]

    def rays(self, uv):
        """Return the rays through points of the picture; NaN where the lens sees nothing."""
        u, v = np.asarray(uv, float).T
        pixels = np.c_[u, 1 - v] * self.size - 0.5
        local = self.lens.directions((pixels - self.K[:2, 2]) @ np.linalg.inv(self.K[:2, :2]).T)
        directions = local @ np.linalg.inv(self.R).T
        return np.broadcast_to(self.position, directions.shape).copy(), directions

    def texel(self, points):
        """Return the size of a pixel at points, as in the middle of the picture."""
        distance = np.linalg.norm(_checks.points_of(points) - self.position, axis=1)
        return distance / np.sqrt(np.linalg.det(self.K))

    def as_pinhole(self, tolerance=0.01):
        """Return the best-fit pinhole camera with rational distortion.

        Parameters
        ----------
        tolerance : float, optional
            Maximum error of any point of the picture, in pixels.

        Returns
        -------
        Pinhole
            Of the same picture.

        Raises
        ------
        ValueError
            If the error is larger: the lens is too wide for a single pinhole.

        Examples
        --------
        >>> from pvibr.maths.lens_camera import LensCamera
        >>> from pvibr.maths.lenses import Lens
        >>> K = [[100.0, 0, 49.5], [0, 100, 49.5], [0, 0, 1]]
        >>> camera = LensCamera(K, np.eye(3), np.zeros(3), (100, 100), Lens('equidistant'))
        >>> seen, _ = camera.as_pinhole().project([[0.3, 0.2, 1.0]])
        >>> bool((abs(100 * (seen - camera.project([[0.3, 0.2, 1.0]])[0])) < 0.01).all())
        True
        """
        pinhole, max_error = self._nearest
        if not max_error <= tolerance:
            raise ValueError(
                f'lens must fit one pinhole camera within {tolerance:g} px, got {max_error:.3g} '
                f'for {self.lens.kind!r}; use Photo.slides, as Projector(photo) does'
            )
        return pinhole

    @cached_property
    def _nearest(self):
        """The nearest pinhole or None, and by how many pixels it is off."""
        pinhole = self._fitted()
        if pinhole is None:
            return None, np.inf
        unit_points = (self._directions(41) - self.t) @ self.R  # one unit away
        pixel_errors = (pinhole.project(unit_points)[0] - self.project(unit_points)[0]) * self.size
        return pinhole, float(np.abs(pixel_errors).max())

    def _directions(self, count):
        """Return directions of a grid over the picture in the camera's axes; NaN outside."""
        u, v = np.meshgrid(*[np.linspace(0, 1, count)] * 2)
        return self.rays(np.c_[u.ravel(), v.ravel()])[1] @ self.R.T

    def _fitted(self):
        """Return a pinhole by linear least squares, reweighted by the denominator, or None."""
        directions = self._directions(32)
        if self.lens.is_panorama or not (directions[:, 2] > _WIDEST).all():
            return None
        focal_scale = self.lens.focus
        ideal = directions[:, :2] / directions[:, 2:]
        target = self.lens.image(directions) / focal_scale
        radius_squared = (ideal**2).sum(1)
        radius_unit = radius_squared.max()
        powers = (radius_squared / radius_unit)[:, None] ** [1, 2, 3]
        below, (x, y) = np.ones(len(radius_squared)), ideal.T
        for _ in range(12):
            rows = []
            for k, twist in enumerate(
                ([2 * x * y, radius_squared + 2 * x * x], [radius_squared + 2 * y * y, 2 * x * y])
            ):
                radial = np.c_[ideal[:, k, None] * powers, -target[:, k, None] * powers]
                rows.append(np.c_[radial, np.transpose(twist) * below[:, None]] / below[:, None])
            right_side = ((target - ideal) / below[:, None]).T.ravel()
            solution = np.linalg.lstsq(np.concatenate(rows), right_side, rcond=1e-14)[0]
            below = 1 + powers @ solution[3:6]
            if not (below > 0).all():
                return None
        terms = solution[:6] / np.tile(radius_unit ** np.arange(1, 4), 2)
        distortion = np.array([*terms[:2], *solution[6:], *terms[2:]])
        try:
            K = self.K * [[focal_scale, focal_scale, 1]]
            return Pinhole(K, self.R, self.t, self.size, distortion)
        except ValueError:
            return None

    def faces(self):
        """Return pinhole cameras at the same place that together see what it sees.

        Returns
        -------
        list of Pinhole
            A single one up to 120 degrees, else square pictures of faces of a cube; at the
            resolution of the middle of the picture.

        Examples
        --------
        >>> from pvibr.maths.lens_camera import LensCamera
        >>> from pvibr.maths.lenses import Lens
        >>> K = [[200 / np.pi, 0, 199.5], [0, 200 / np.pi, 99.5], [0, 0, 1]]
        >>> camera = LensCamera(K, np.eye(3), np.zeros(3), (400, 200), Lens('spherical'))
        >>> [face.size for face in camera.faces()]
        [(132, 132), (132, 132), (132, 132), (132, 132), (132, 132), (132, 132)]
        """
        focal_length = np.sqrt(np.linalg.det(self.K)) * self.lens.focus
        directions = self._directions(33)
        if not self.lens.is_panorama and (directions[:, 2] > 0.5).all():
            return [self._undistorted(focal_length, directions[:, :2] / directions[:, 2:])]
        side = int(min(2 * np.ceil(focal_length) + _OVERLAP, _LARGEST))
        focal_length = min(focal_length, (side - _OVERLAP) / 2)
        face_center = (side - 1) / 2
        K = np.array([[focal_length, 0, face_center], [0, focal_length, face_center], [0, 0, 1]])
        faces = [Pinhole(K, turn @ self.R, turn @ self.t, (side, side)) for turn in _FACES]
        return [face for face in faces if self._shows(face)]

    def _undistorted(self, focal_length, plane_points):
        """Return a pinhole camera whose picture holds points of the plane one unit ahead."""
        low = focal_length * plane_points.min(axis=0)
        high = focal_length * plane_points.max(axis=0)
        size = np.ceil(high - low).astype(int) + _OVERLAP
        shrink_factor = min(1.0, 2 * _LARGEST / size.max())
        size = np.ceil(size * shrink_factor).astype(int)
        K = np.diag([focal_length * shrink_factor, focal_length * shrink_factor, 1.0])
        K[:2, 2] = (size - 1) / 2 - shrink_factor * (low + high) / 2
        return Pinhole(K, self.R, self.t, tuple(size))

    def _shows(self, face):
        """Return whether the picture covers any of a face."""
        u, v = np.meshgrid(*[np.linspace(0, 1, 33)] * 2)
        origins, directions = face.rays(np.c_[u.ravel(), v.ravel()])
        with np.errstate(invalid='ignore'):
            uv = self.project(origins + directions)[0]
            return bool(((uv >= 0) & (uv <= 1)).all(axis=1).any())
