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

from pvibr.maths.arguments import as_array, check_one_of

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
                    f'{name} is {numbers.tolist()!r:.80}; it must be a row of finite numbers.'
                )
            object.__setattr__(self, name, tuple(numbers.tolist()))
        late: object = self.late
        if not isinstance(late, (bool, np.bool_)):
            raise TypeError(f'late = {late!r:.80}: must be True or False')
        wanted = KINDS[self.kind][1]
        if wanted is not None and len(self.values) != wanted:
            raise ValueError(f'values is {self.values}; {self.kind!r} takes {wanted}.')

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
            grows = np.isfinite(radii[1:]) & (np.diff(radii) > 0)
        end = _SAMPLES if grows.all() else int(np.argmin(grows)) + 1
        return angles[:end], radii[:end]

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
                tall = np.arctan2(y, level) if self.kind == 'spherical' else y / level
                return np.where(
                    (level + across > 0)[:, None], np.c_[np.arctan2(x, z), tall], np.nan
                )
            angle = np.arctan2(across, z)
            flat = np.c_[x, y] / np.where(across > 0, across, 1.0)[:, None]
            xy = self._off_axis(flat, angle)
        return np.where((angle <= self.max_angle)[:, None], xy, np.nan)

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
            turned = xy * (np.interp(radius, radii, angles) / np.where(radius, radius, 1))[:, None]
            for _ in range(30):
                miss = self._azimuthal(turned) - xy
                dx, dy = (
                    (self._azimuthal(turned + h) - self._azimuthal(turned - h)) / (2 * _STEP)
                    for h in _STEP * np.eye(2)
                )
                det = dx[:, 0] * dy[:, 1] - dx[:, 1] * dy[:, 0]
                step = np.c_[
                    dy[:, 1] * miss[:, 0] - dy[:, 0] * miss[:, 1],
                    dx[:, 0] * miss[:, 1] - dx[:, 1] * miss[:, 0],
                ]
                turned = turned - np.nan_to_num(step / det[:, None])
                if not (np.abs(step) > 1e-15).any():
                    break
            found = _from_azimuthal(turned)
            good = np.abs(self._azimuthal(turned) - xy).max(axis=1) <= 1e-9 * (1 + radius)
        good &= np.hypot(*turned.T) <= self.max_angle
        return np.where(good[:, None], found, np.nan)

    def _panorama_directions(self, xy):
        around, tall = xy.T
        inside = np.abs(around) <= np.pi + 1e-9
        if self.kind == 'spherical':
            inside &= np.abs(tall) <= _HALF + 1e-9
            level, down = np.cos(tall), np.sin(tall)
        else:
            level, down = 1 / np.hypot(1, tall), tall / np.hypot(1, tall)
        found = np.c_[level * np.sin(around), down, level * np.cos(around)]
        return np.where(inside[:, None], found, np.nan)

    def _azimuthal(self, turned):
        """Return the image of points whose distance from 0 is the angle to the axis."""
        angle = np.hypot(*turned.T)
        return self._off_axis(turned / np.where(angle > 0, angle, 1.0)[:, None], angle)

    def _radius(self, angle):
        rho = _base_radius(self.kind, self.values, angle)
        return rho * self._factor(rho * rho)

    def _factor(self, s):
        return sum((k * s ** (i + 1) for i, k in enumerate(self.radial)), np.ones_like(s))

    def _off_axis(self, flat, angle):
        """Return the image of unit vectors across the axis at angles to it."""
        rho = _base_radius(self.kind, self.values, angle)
        plain = flat * rho[:, None]
        bent = plain * self._factor(rho * rho)[:, None]
        if not (self.tangential or self.prism):
            return bent
        x, y = (bent if self.late else plain).T
        s = x * x + y * y
        p1, p2, p3, p4 = (*self.tangential, 0.0, 0.0, 0.0, 0.0)[:4]
        sx1, sx2, sy1, sy2 = self.prism or (0.0,) * 4
        more = 1 + s * (p3 + s * p4)
        dx = (2 * p1 * x * y + p2 * (s + 2 * x * x)) * more + s * (sx1 + s * sx2)
        dy = (2 * p2 * x * y + p1 * (s + 2 * y * y)) * more + s * (sy1 + s * sy2)
        return bent + np.c_[dx, dy]


def _base_radius(kind, values, angle):
    """Return the radius before distortion of angles to the axis."""
    if kind in ('perspective', 'dual'):
        share = values[0] if kind == 'dual' else 1.0
        return share * np.tan(angle) + (1 - share) * angle
    if kind == 'equisolid':
        return 2 * np.sin(angle / 2)
    if kind == 'polynomial':
        return np.polynomial.polynomial.polyval(angle, values)
    if kind == 'fov':
        half = 2 * np.tan(values[0] / 2)
        if abs(values[0]) < 1e-8:
            return np.tan(angle)
        return np.arctan(half * np.tan(angle)) / values[0]
    sine, cosine = np.sin(angle), np.cos(angle)
    if kind == 'division':
        return 2 * sine / (cosine + np.sqrt(cosine * cosine - 4 * values[0] * sine * sine))
    if kind == 'unified':
        alpha, beta = values
        rho = np.sqrt(beta * sine * sine + cosine * cosine)
        return sine / (alpha * rho + (1 - alpha) * cosine)
    if kind == 'inverse':
        return _inverse_cubic(values[0], np.tan(angle))
    return angle


def _inverse_cubic(k, wanted):
    """Return the smallest r >= 0 with r (1 + k r^2) = wanted; NaN if there is none."""
    if k == 0:
        return wanted
    if k > 0:  # sinh and sin solve the cubic without cancellation
        scale = 2 / np.sqrt(3 * k)
        return scale * np.sinh(np.arcsinh(1.5 * wanted * np.sqrt(3 * k)) / 3)
    scale = 2 / np.sqrt(-3 * k)
    return scale * np.sin(np.arcsin(1.5 * wanted * np.sqrt(-3 * k)) / 3)


def _from_azimuthal(turned):
    """Return unit vectors of points whose distance from 0 is the angle to the axis."""
    angle = np.hypot(*turned.T)
    flat = turned * np.sinc(angle / np.pi)[:, None]
    return np.c_[flat, np.cos(angle)]
