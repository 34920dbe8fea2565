"""Lenses of any projection: fisheyes, division and inverse models, panoramas.

Kannala and Brandt, "A Generic Camera Model and Calibration Method for Conventional, Wide-Angle,
and Fish-Eye Lenses", PAMI 28(8), 2006; Fitzgibbon, "Simultaneous linear estimation of multiple
view geometry and lens distortion", CVPR 2001; Devernay and Faugeras, "Straight lines have to be
straight", MVA 13, 2001; Khomutenko et al., "An Enhanced Unified Camera Model", RA-L 1(1), 2016.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from pvibr.core.arguments import as_array, check_one_of

_HALF = np.pi / 2
#: By kind: the largest angle to the axis, and how many values it takes (None: any number).
KINDS = {
    'perspective': (_HALF, 0),
    'equidistant': (np.pi, 0),
    'equisolid': (np.pi, 0),
    'division': (_HALF, 1),
    'inverse': (_HALF, 1),
    'fov': (_HALF, 1),
    'unified': (_HALF, 2),
    'dual': (_HALF, 1),
    'polynomial': (np.pi, None),
    'spherical': (np.pi, 0),
    'cylindrical': (np.pi, 0),
}
_SAMPLES = 4096  # of the radius over the angle
_STEP = 1e-6  # of the derivatives of the inverse


@dataclass(frozen=True)
class Lens:
    """A map from directions to the image plane of unit focal length, x right, y down.

    Parameters
    ----------
    kind : str
        Radius as a function of the angle to the axis: ``'perspective'``, ``'equidistant'``,
        ``'equisolid'``, ``'division'`` (k), ``'inverse'`` (the undistorted from the distorted
        radius, ``r (1 + k r^2)``), ``'fov'`` (omega), ``'unified'`` (alpha, beta), ``'dual'``
        (share of the perspective), ``'polynomial'`` (coefficients of the angle's powers); or the
        angles themselves: ``'spherical'`` and ``'cylindrical'``.
    values : tuple of float, optional
        Parameters of the kind.
    radial : tuple of float, optional
        Factors of even powers of that radius: k1, k2, ...
    tangential : tuple of float, optional
        p1, p2 as in OpenCV; p3 and p4 multiply these by ``1 + p3 r^2 + p4 r^4``.
    prism : tuple of 4 float, optional
        Factors of r^2 and r^4 along x, then along y.
    late : bool, optional
        Whether the tangential and prism terms are those of the radially distorted point.

    Raises
    ------
    ValueError
        If the kind is unknown, takes other values, or a number is not finite.

    Examples
    --------
    >>> from pvibr.maths.lenses import Lens
    >>> Lens('equidistant', radial=(0.1,)).image([[1.0, 0.0, 0.0]]).round(4).tolist()
    [[1.9584, 0.0]]
    """

    kind: str = 'perspective'
    values: Sequence[float] = ()
    radial: Sequence[float] = ()
    tangential: Sequence[float] = ()
    prism: Sequence[float] = ()
    late: bool = False

    def __post_init__(self):
        check_one_of('kind', self.kind, KINDS)
        for name in ('values', 'radial', 'tangential', 'prism'):
            numbers = as_array(name, getattr(self, name), float)
            if numbers.ndim != 1 or not np.isfinite(numbers).all():
                raise ValueError(
                    f'{name} must be a row of finite numbers, got {numbers.tolist()!r:.80}'
                )
            object.__setattr__(self, name, tuple(numbers.tolist()))
        late: object = self.late
        if not isinstance(late, (bool, np.bool_)):
            raise TypeError(f'late must be True or False, got {late!r:.80}')
        value_count = KINDS[self.kind][1]
        if value_count is not None and len(self.values) != value_count:
            raise ValueError(
                f'values must have {value_count} numbers for {self.kind!r}, got {self.values}'
            )

    @property
    def is_panorama(self) -> bool:
        """Whether x and y are angles about two axes, not a radius about one."""
        return self.kind in ('spherical', 'cylindrical')

    @cached_property
    def _profile(self):
        """Angles and radii without the tangential terms, as far as the radius grows."""
        angles = np.linspace(0, KINDS[self.kind][0], _SAMPLES + 1)[:-1]
        with np.errstate(all='ignore'):
            radii = self._radius(angles)
            is_growing = np.isfinite(radii[1:]) & (np.diff(radii) > 0)
        valid_count = _SAMPLES if is_growing.all() else int(np.argmin(is_growing)) + 1
        return angles[:valid_count], radii[:valid_count]

    @property
    def focus(self) -> float:
        """The radius over the angle at the axis: 1 but for some kinds."""
        return 1.0 if self.is_panorama else float(self._radius(np.array([_STEP]))[0] / _STEP)

    @property
    def max_angle(self) -> float:
        """The largest angle to the axis that the lens maps one to one, in radians."""
        return float(self._profile[0][-1])

    def image(self, directions):
        """Return where the lens shows directions.

        Parameters
        ----------
        directions : array_like, shape (n, 3)
            In the camera's axes, x right, y down, z ahead; of any length.

        Returns
        -------
        numpy.ndarray, shape (n, 2), float64
            On the plane of unit focal length; NaN where it shows nothing.
        """
        x, y, z = np.asarray(directions, float).T
        across = np.hypot(x, y)
        with np.errstate(all='ignore'):
            if self.is_panorama:
                level = np.hypot(x, z)
                vertical = np.arctan2(y, level) if self.kind == 'spherical' else y / level
                return np.where(
                    (level + across > 0)[:, None], np.c_[np.arctan2(x, z), vertical], np.nan
                )
            axis_angle = np.arctan2(across, z)
            unit_xy = np.c_[x, y] / np.where(across > 0, across, 1.0)[:, None]
            xy = self._off_axis(unit_xy, axis_angle)
        return np.where((axis_angle <= self.max_angle)[:, None], xy, np.nan)

    def directions(self, xy):
        """Return the directions that a lens shows at points.

        Newton's method from the radial part, which the tangential terms hardly change.

        Parameters
        ----------
        xy : array_like, shape (n, 2)
            On the plane of unit focal length.

        Returns
        -------
        numpy.ndarray, shape (n, 3), float64
            Unit vectors; NaN where the lens shows nothing.
        """
        xy = np.asarray(xy, float)
        if self.is_panorama:
            return self._panorama_directions(xy)
        angles, radii = self._profile
        radius = np.hypot(*xy.T)
        with np.errstate(all='ignore'):
            polar = xy * (np.interp(radius, radii, angles) / np.where(radius, radius, 1))[:, None]
            for _ in range(30):
                miss = self._azimuthal(polar) - xy
                dx, dy = (
                    (self._azimuthal(polar + shift) - self._azimuthal(polar - shift)) / (2 * _STEP)
                    for shift in _STEP * np.eye(2)
                )
                determinant = dx[:, 0] * dy[:, 1] - dx[:, 1] * dy[:, 0]
                step = np.c_[
                    dy[:, 1] * miss[:, 0] - dy[:, 0] * miss[:, 1],
                    dx[:, 0] * miss[:, 1] - dx[:, 1] * miss[:, 0],
                ]
                polar = polar - np.nan_to_num(step / determinant[:, None])
                if not (np.abs(step) > 1e-15).any():
                    break
            unit_directions = _from_azimuthal(polar)
            converged = np.abs(self._azimuthal(polar) - xy).max(axis=1) <= 1e-9 * (1 + radius)
        converged &= np.hypot(*polar.T) <= self.max_angle
        return np.where(converged[:, None], unit_directions, np.nan)

    def _panorama_directions(self, xy):
        longitude, vertical = xy.T
        is_inside = np.abs(longitude) <= np.pi + 1e-9
        if self.kind == 'spherical':
            is_inside &= np.abs(vertical) <= _HALF + 1e-9
            level, down = np.cos(vertical), np.sin(vertical)
        else:
            level, down = 1 / np.hypot(1, vertical), vertical / np.hypot(1, vertical)
        directions = np.c_[level * np.sin(longitude), down, level * np.cos(longitude)]
        return np.where(is_inside[:, None], directions, np.nan)

    def _azimuthal(self, azimuthal):
        """Return the image of points whose distance from 0 is the angle to the axis."""
        axis_angle = np.hypot(*azimuthal.T)
        return self._off_axis(
            azimuthal / np.where(axis_angle > 0, axis_angle, 1.0)[:, None], axis_angle
        )

    def _radius(self, axis_angle):
        rho = _base_radius(self.kind, self.values, axis_angle)
        return rho * self._factor(rho * rho)

    def _factor(self, r2):
        return sum((k * r2 ** (i + 1) for i, k in enumerate(self.radial)), np.ones_like(r2))

    def _off_axis(self, unit_xy, axis_angle):
        """Return the image of unit vectors across the axis at angles to it."""
        rho = _base_radius(self.kind, self.values, axis_angle)
        undistorted = unit_xy * rho[:, None]
        distorted = undistorted * self._factor(rho * rho)[:, None]
        if not (self.tangential or self.prism):
            return distorted
        x, y = (distorted if self.late else undistorted).T
        r2 = x * x + y * y
        p1, p2, p3, p4 = (*self.tangential, 0.0, 0.0, 0.0, 0.0)[:4]
        sx1, sx2, sy1, sy2 = self.prism or (0.0,) * 4
        scale = 1 + r2 * (p3 + r2 * p4)
        dx = (2 * p1 * x * y + p2 * (r2 + 2 * x * x)) * scale + r2 * (sx1 + r2 * sx2)
        dy = (2 * p2 * x * y + p1 * (r2 + 2 * y * y)) * scale + r2 * (sy1 + r2 * sy2)
        return distorted + np.c_[dx, dy]


def _base_radius(kind, values, axis_angle):
    """Return the radius before distortion of angles to the axis."""
    if kind in ('perspective', 'dual'):
        share = values[0] if kind == 'dual' else 1.0
        return share * np.tan(axis_angle) + (1 - share) * axis_angle
    if kind == 'equisolid':
        return 2 * np.sin(axis_angle / 2)
    if kind == 'polynomial':
        return np.polynomial.polynomial.polyval(axis_angle, values)
    if kind == 'fov':
        half = 2 * np.tan(values[0] / 2)
        if abs(values[0]) < 1e-8:
            return np.tan(axis_angle)
        return np.arctan(half * np.tan(axis_angle)) / values[0]
    sine, cosine = np.sin(axis_angle), np.cos(axis_angle)
    if kind == 'division':
        return 2 * sine / (cosine + np.sqrt(cosine * cosine - 4 * values[0] * sine * sine))
    if kind == 'unified':
        alpha, beta = values
        rho = np.sqrt(beta * sine * sine + cosine * cosine)
        return sine / (alpha * rho + (1 - alpha) * cosine)
    if kind == 'inverse':
        return _inverse_cubic(values[0], np.tan(axis_angle))
    return axis_angle


def _inverse_cubic(k, undistorted_radius):
    """Return the smallest r >= 0 with r (1 + k r^2) = wanted; NaN if there is none."""
    if k == 0:
        return undistorted_radius
    if k > 0:  # sinh and sin solve the cubic without cancellation
        scale = 2 / np.sqrt(3 * k)
        return scale * np.sinh(np.arcsinh(1.5 * undistorted_radius * np.sqrt(3 * k)) / 3)
    scale = 2 / np.sqrt(-3 * k)
    return scale * np.sin(np.arcsin(1.5 * undistorted_radius * np.sqrt(-3 * k)) / 3)


def _from_azimuthal(azimuthal):
    """Return unit vectors of points whose distance from 0 is the angle to the axis."""
    axis_angle = np.hypot(*azimuthal.T)
    unit_xy = azimuthal * np.sinc(axis_angle / np.pi)[:, None]
    return np.c_[unit_xy, np.cos(axis_angle)]
