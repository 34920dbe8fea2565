"""Lens distortion of photographs: from the ideal image plane to the distorted one, and back.

The model is that of Brown, "Decentering Distortion of Lenses", Photogrammetric Engineering
32(3), 1966, with the rational radial term and the coefficient order of OpenCV.
"""

from __future__ import annotations

import numpy as np
from numpy.polynomial import Polynomial

from pvibr.maths.arguments import as_array, check_finite

_TERMS = (0, 4, 5, 8)


def distort(xy, distortion):
    """Return the distorted positions of points (n, 2) of the ideal plane one unit ahead, y down.

    NaN at :func:`valid_radius` and beyond, where the formula folds back into the picture.
    """
    lens = coefficients(distortion)
    xy = np.asarray(xy, dtype=np.float64)
    if not lens.any():
        return xy.copy()
    inside = np.hypot(*xy.T) < valid_radius(lens)
    moved = np.full_like(xy, np.nan)
    with np.errstate(over='ignore', invalid='ignore'):  # far out is outside, whatever it is
        moved[inside] = _distorted(xy[inside], lens)
    return moved


def undistort(xy, distortion):
    """Return the ideal positions of distorted points, (n, 2); NaN where there is none.

    Newton's method with halved steps; the Jacobian is positive definite within the valid radius.
    """
    lens = coefficients(distortion)
    wanted = np.asarray(xy, dtype=np.float64)
    if not lens.any():
        return wanted.copy()
    limit = valid_radius(lens)
    radius = np.hypot(*wanted.T)
    with np.errstate(divide='ignore', over='ignore', invalid='ignore'):
        found = wanted * np.fmin(1.0, 0.5 * limit / radius)[:, None]
        miss = wanted - _distorted(found, lens)
        length, tolerance = np.ones(len(found)), 4 * np.finfo(float).eps * (1 + radius)
        for _ in range(100):
            todo = np.flatnonzero((np.hypot(*miss.T) > tolerance) & (length > 1e-12))
            if not len(todo):
                break
            tried = found[todo] + length[todo, None] * _newton(found[todo], miss[todo], lens)
            rest = wanted[todo] - _distorted(tried, lens)
            better = np.hypot(*rest.T) < np.hypot(*miss[todo].T)
            better &= np.hypot(*tried.T) < limit
            found[todo[better]], miss[todo[better]] = tried[better], rest[better]
            length[todo] = np.where(better, np.fmin(1.0, 2 * length[todo]), 0.5 * length[todo])
    return np.where((np.hypot(*miss.T) <= 1e-9 * (1 + radius))[:, None], found, np.nan)


def valid_radius(distortion):
    """Return the radius on the ideal image plane up to which a lens is one-to-one, or infinity."""
    k1, k2, p1, p2, k3, k4, k5, k6 = coefficients(distortion)
    above = Polynomial([1, 0, k1, 0, k2, 0, k3])
    below = Polynomial([1, 0, k4, 0, k5, 0, k6])
    radius = Polynomial([0, 1])
    growth = (radius * above).deriv() * below - radius * above * below.deriv()
    tangential = 6 * np.hypot(p1, p2) * radius
    ends = below, growth - tangential * below * below, above - tangential * below
    # All three start with 1, so in 1/r they are monic: tiny last terms do no harm.
    inverse = np.concatenate([np.roots(end.trim().coef) for end in ends])
    real = inverse.real[np.abs(inverse.imag) <= 1e-9 * np.abs(inverse)]
    with np.errstate(divide='ignore', over='ignore'):
        return float(1 / real.max(initial=0.0))


def coefficients(distortion):
    """Return all 8 coefficients k1, k2, p1, p2, k3, k4, k5, k6 of a lens; missing ones are 0."""
    terms = np.ravel(as_array('distortion', distortion, np.float64))
    if len(terms) not in _TERMS:
        raise ValueError(
            f'distortion has {len(terms)} numbers; it must have 0, 4, 5 or 8: k1, k2, p1, p2, ..'
        )
    terms = np.pad(terms, (0, 8 - len(terms)))
    check_finite('distortion', terms)
    return terms


def _distorted(xy, lens):
    k1, k2, p1, p2, k3, k4, k5, k6 = lens
    x, y = xy.T
    s = x * x + y * y
    radial = (1 + s * (k1 + s * (k2 + s * k3))) / (1 + s * (k4 + s * (k5 + s * k6)))
    return np.stack(
        [
            x * radial + 2 * p1 * x * y + p2 * (s + 2 * x * x),
            y * radial + p1 * (s + 2 * y * y) + 2 * p2 * x * y,
        ],
        axis=1,
    )


def _newton(xy, miss, lens):
    """Return the Newton steps that reduce the residuals."""
    k1, k2, p1, p2, k3, k4, k5, k6 = lens
    x, y = xy.T
    s = x * x + y * y
    above, below = 1 + s * (k1 + s * (k2 + s * k3)), 1 + s * (k4 + s * (k5 + s * k6))
    slope = (k1 + s * (2 * k2 + 3 * k3 * s)) * below - above * (k4 + s * (2 * k5 + 3 * k6 * s))
    radial, slope = above / below, 2 * slope / (below * below)
    xx = radial + slope * x * x + 2 * p1 * y + 6 * p2 * x
    xy_ = slope * x * y + 2 * p1 * x + 2 * p2 * y
    yy = radial + slope * y * y + 6 * p1 * y + 2 * p2 * x
    a, b = miss.T
    return np.stack([yy * a - xy_ * b, xx * b - xy_ * a], axis=1) / (xx * yy - xy_ * xy_)[:, None]
