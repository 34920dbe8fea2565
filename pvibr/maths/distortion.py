"""Lens distortion of photographs: from the ideal image plane to the distorted one, and back.

The model is that of Brown, "Decentering Distortion of Lenses", Photogrammetric Engineering
32(3), 1966, with the rational radial term and the coefficient order of OpenCV.
"""

from __future__ import annotations

import numpy as np
from numpy.polynomial import Polynomial

from pvibr.core.arguments import as_array, check_finite

_TERMS = 0, 4, 5, 8


def distort(xy, distortion):
    """Return the distorted positions of points (n, 2) of the ideal plane one unit ahead, y down.

    NaN at :func:`valid_radius` and beyond, where the formula folds back into the picture.
    """
    lens_terms = coefficients(distortion)
    xy = np.asarray(xy, dtype=np.float64)
    if not lens_terms.any():
        return xy.copy()
    in_range = np.hypot(*xy.T) < valid_radius(lens_terms)
    distorted = np.full_like(xy, np.nan)
    with np.errstate(over='ignore', invalid='ignore'):  # any result far out counts as outside
        distorted[in_range] = _distorted(xy[in_range], lens_terms)
    return distorted


def undistort(xy, distortion):
    """Return the ideal positions of distorted points, (n, 2); NaN where there is none.

    Newton's method with halved steps; the Jacobian is positive definite within the valid radius.
    """
    lens_terms = coefficients(distortion)
    distorted = np.asarray(xy, dtype=np.float64)
    if not lens_terms.any():
        return distorted.copy()
    max_radius = valid_radius(lens_terms)
    radius = np.hypot(*distorted.T)
    with np.errstate(divide='ignore', over='ignore', invalid='ignore'):
        ideal = distorted * np.fmin(1.0, 0.5 * max_radius / radius)[:, None]
        miss = distorted - _distorted(ideal, lens_terms)
        length, tolerance = np.ones(len(ideal)), 4 * np.finfo(float).eps * (1 + radius)
        for _ in range(100):
            todo = np.flatnonzero((np.hypot(*miss.T) > tolerance) & (length > 1e-12))
            if not len(todo):
                break
            trial = ideal[todo] + length[todo, None] * _newton(ideal[todo], miss[todo], lens_terms)
            trial_residuals = distorted[todo] - _distorted(trial, lens_terms)
            is_better = np.hypot(*trial_residuals.T) < np.hypot(*miss[todo].T)
            is_better &= np.hypot(*trial.T) < max_radius
            ideal[todo[is_better]] = trial[is_better]
            miss[todo[is_better]] = trial_residuals[is_better]
            length[todo] = np.where(is_better, np.fmin(1.0, 2 * length[todo]), 0.5 * length[todo])
    return np.where((np.hypot(*miss.T) <= 1e-9 * (1 + radius))[:, None], ideal, np.nan)


def valid_radius(distortion):
    """Return the radius on the ideal image plane up to which a lens is one-to-one, or infinity."""
    k1, k2, p1, p2, k3, k4, k5, k6 = coefficients(distortion)
    above = Polynomial([1, 0, k1, 0, k2, 0, k3])
    below = Polynomial([1, 0, k4, 0, k5, 0, k6])
    radius = Polynomial([0, 1])
    growth = (radius * above).deriv() * below - radius * above * below.deriv()
    tangential = 6 * np.hypot(p1, p2) * radius
    limits = below, growth - tangential * below * below, above - tangential * below
    # All three start with 1, so in 1/r they are monic, and tiny last terms are harmless.
    inverse = np.concatenate([np.roots(polynomial.trim().coef) for polynomial in limits])
    real_inverses = inverse.real[np.abs(inverse.imag) <= 1e-9 * np.abs(inverse)]
    with np.errstate(divide='ignore', over='ignore'):
        return float(1 / real_inverses.max(initial=0.0))


def coefficients(distortion):
    """Return all 8 coefficients k1, k2, p1, p2, k3, k4, k5, k6 of a lens; missing ones are 0."""
    terms = np.ravel(as_array('distortion', distortion, np.float64))
    if len(terms) not in _TERMS:
        raise ValueError(
            f'distortion must be 0, 4, 5 or 8 numbers (k1, k2, p1, p2, ...), got {len(terms)}'
        )
    terms = np.pad(terms, (0, 8 - len(terms)))
    check_finite('distortion', terms)
    return terms


def _distorted(xy, lens_terms):
    k1, k2, p1, p2, k3, k4, k5, k6 = lens_terms
    x, y = xy.T
    r2 = x * x + y * y
    radial = (1 + r2 * (k1 + r2 * (k2 + r2 * k3))) / (1 + r2 * (k4 + r2 * (k5 + r2 * k6)))
    return np.stack(
        [
            x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x),
            y * radial + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y,
        ],
        axis=1,
    )


def _newton(xy, residuals, lens_terms):
    """Return the Newton steps that reduce the residuals."""
    k1, k2, p1, p2, k3, k4, k5, k6 = lens_terms
    x, y = xy.T
    r2 = x * x + y * y
    above = 1 + r2 * (k1 + r2 * (k2 + r2 * k3))
    below = 1 + r2 * (k4 + r2 * (k5 + r2 * k6))
    slope = (k1 + r2 * (2 * k2 + 3 * k3 * r2)) * below - above * (k4 + r2 * (2 * k5 + 3 * k6 * r2))
    radial, slope = above / below, 2 * slope / (below * below)
    xx = radial + slope * x * x + 2 * p1 * y + 6 * p2 * x
    xy_ = slope * x * y + 2 * p1 * x + 2 * p2 * y
    yy = radial + slope * y * y + 6 * p1 * y + 2 * p2 * x
    a, b = residuals.T
    return np.stack([yy * a - xy_ * b, xx * b - xy_ * a], axis=1) / (xx * yy - xy_ * xy_)[:, None]
