"""FLIP, the difference of pictures as perceived when flipping between them."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
import scipy  # whose modules load when they are first used

_PPD = 3840 * np.pi / 180  # pixels per degree of a screen 0.7 m wide, 0.7 m away, of 3840 pixels
# Contrast sensitivity of Y, Cx and Cz: factors and widths of Gaussians.
_SENSITIVITY = ((1.0, 0.0047),), ((1.0, 0.0053),), ((34.1, 0.04), (13.5, 0.025))
_RADIUS = int(np.ceil(3 * np.sqrt(0.04 / (2 * np.pi**2)) * _PPD))
_FEATURE = 0.5 * 0.082 * _PPD  # standard deviation of a feature's Gaussian, pixels
_QC, _PC, _PT = 0.7, 0.4, 0.95
_PIXELS = 1 << 16  # of the pictures that are compared at a time
_DEGREE = 7  # of the polynomials in place of powers
_TAIL = 1e-6  # of a filter's largest weight: smaller ones are left out
_XYZ = np.array(
    [
        [10135552 / 24577794, 8788810 / 24577794, 4435075 / 24577794],
        [2613072 / 12288897, 8788810 / 12288897, 887015 / 12288897],
        [1425312 / 73733382, 8788810 / 73733382, 70074185 / 73733382],
    ]
)
# From linear RGB to X, Y and Z relative to white, and on to Y, Cx and Cz.
_WHITE = (_XYZ / _XYZ.sum(1, keepdims=True)).astype(np.float32)
_OPPONENT = np.array([[0, 116, 0], [500, -500, 0], [0, 200, -200]], float)
_YCC = (_OPPONENT @ _WHITE).astype(np.float32)
_BACK = (_WHITE @ np.linalg.inv(_YCC.astype(float))).astype(np.float32)


class Flip:
    """FLIP of sRGB pictures against references (n, h, w, 3), whose features are computed once.

    Andersson et al., "FLIP: A Difference Evaluator for Alternating Images", HPG 2020, at 67 pixels
    per degree. Filters are sparse matrices: far faster than the authors' package.
    """

    def __init__(self, references):
        references = np.asarray(references)
        # A few pictures at a time, which stay in the processor's cache.
        self._count = max(1, _PIXELS // max(references[0, ..., 0].size, 1))
        self._seen = [_seen(few) for few in self._batches(references)]

    def maps(self, images):
        """Return the difference maps of as many pictures, (n, h, w), 0 (equal) to 1."""
        batches = self._batches(np.asarray(images))
        pairs = zip(map(_seen, batches), self._seen, strict=True)
        return np.concatenate([_difference(*pair) for pair in pairs])

    def _batches(self, images):
        return [images[i : i + self._count] for i in range(0, len(images), self._count)]


def flip(image, reference):
    """Return the FLIP difference map of two sRGB pictures, (h, w), 0 (equal) to 1."""
    return Flip(np.asarray(reference)[None]).maps(np.asarray(image)[None])[0]


def _difference(seen, expected):
    """Return the difference maps of pictures as :func:`_seen` returns them, (n, h, w)."""
    (colors, features), (expected_colors, expected_features) = seen, expected
    lightness_off, *chroma_off = (c - e for c, e in zip(colors, expected_colors, strict=True))
    color_off = np.abs(lightness_off)
    color_off += np.sqrt(chroma_off[0] ** 2 + chroma_off[1] ** 2)
    feature_off = np.abs(features - expected_features).max(0)
    # Most pixels are equal: powers are slow.
    is_off = np.flatnonzero(color_off)
    exponents = 1 - np.sqrt(feature_off.ravel()[is_off] * np.float32(0.5**0.5))
    maps = np.zeros(color_off.shape, np.float32)
    maps.ravel()[is_off] = _redistributed(color_off.ravel()[is_off]) ** exponents
    return maps.transpose(1, 2, 0)


def _redistributed(color_off):
    """Return differences of colours relative to the largest, small ones spread."""
    largest_difference = _largest()
    color_off = color_off**_QC
    threshold = _PC * largest_difference
    large_off = _PT + (color_off - threshold) * ((1 - _PT) / (largest_difference - threshold))
    return np.where(color_off < threshold, color_off * (_PT / threshold), large_off)


def _seen(images):
    """Return perceived colours, and the strength of edges and of points, (columns, n, rows)."""
    srgb = np.ascontiguousarray(np.moveaxis(np.asarray(images, np.float32), (3, 1), (0, 1)))
    linear_rgb = _linear(srgb)
    opponent = [_mixed(row, linear_rgb) for row in _YCC]
    filtered_channels = [_blurred(c, s) for c, s in zip(opponent, _SENSITIVITY, strict=True)]
    return _perceived(filtered_channels), _featured(opponent[0] * np.float32(1 / 116))


def _perceived(opponent):
    """Return Hunt-adjusted L*a*b* of filtered opponent colours."""
    rgb_from_opponent = np.linalg.inv(_WHITE.astype(float)) @ _BACK
    linear_rgb = [np.clip(_mixed(row, opponent), 0, 1) for row in rgb_from_opponent]
    x, y, z = (_lightness(_mixed(row, linear_rgb)) for row in _WHITE)
    lightness = 116 * y - 16
    return np.stack([lightness, 5 * (x - y) * lightness, 2 * (y - z) * lightness])


def _linear(srgb):
    """Return linear light of sRGB, 0 to 1."""
    base = (srgb + np.float32(0.055)) * np.float32(1 / 1.055)
    light = base * base * _power(base, 0.4, 0.0904)
    return np.where(srgb <= 0.04045, srgb * np.float32(1 / 12.92), light)


def _lightness(ratio):
    """Return the lightness function of L*a*b* of ratios, 0 to 1."""
    threshold = 6 / 29
    dark = ratio * np.float32(1 / (3 * threshold**2)) + np.float32(4 / 29)
    return np.where(ratio > threshold**3, _power(ratio, 1 / 3, threshold**3), dark)


def _power(values, exponent, least):
    """Return a power of values from `least` to 1, within 1e-6."""
    # A polynomial of the fourth root: several times as fast as powers.
    roots = np.sqrt(np.sqrt(values))
    first, *factors = _polynomial(exponent, least)
    powers = roots * first
    for factor in factors[:-1]:
        powers += factor
        powers *= roots
    powers += factors[-1]
    return powers


@lru_cache(maxsize=8)
def _polynomial(exponent, least):
    """Return the factors, highest first, of a polynomial of the fourth root."""
    fit = np.polynomial.Chebyshev.interpolate(
        lambda root: root ** (4 * exponent), _DEGREE, [least**0.25, 1]
    )
    factors = fit.convert(kind=np.polynomial.Polynomial).coef[::-1]
    return tuple(factors.astype(np.float32))


def _mixed(row, channels):
    mixed, *others = (
        np.float32(factor) * channel for factor, channel in zip(row, channels, strict=True)
    )
    for channel in others:
        mixed += channel
    return mixed


def _featured(y):
    """Return the strength of edges and points, (2, columns, n, rows)."""
    smooth, slope, bend = (_turned(_along(y, kind)) for kind in ('smooth', 'slope', 'bend'))
    across_features = _along(smooth, 'slope'), _along(smooth, 'bend')
    pairs = zip(across_features, (slope, bend), strict=True)
    edges_and_points = ((wide, _along(tall, 'smooth')) for wide, tall in pairs)
    return np.stack([np.sqrt(wide**2 + tall**2) for wide, tall in edges_and_points])


def _blurred(channel, gaussians):
    """Return a channel filtered by a sum of Gaussians of unit weight, (columns, n, rows)."""
    pixel_offsets = np.arange(-_RADIUS, _RADIUS + 1) / _PPD
    filtered, weight_sum = 0.0, 0.0
    for factor, width in gaussians:
        weights = np.exp(-(np.pi**2) * pixel_offsets**2 / width)
        share = factor * np.sqrt(np.pi / width) * weights.sum() ** 2
        weight_sum += share
        filtered = filtered + np.float32(share) * _along(_turned(_along(channel, width)), width)
    return filtered / np.float32(weight_sum)


def _turned(values):
    return np.ascontiguousarray(values.transpose(2, 1, 0))


def _along(values, kind):
    """Return values filtered along their first axis."""
    # Not by dense matrices: BLAS's threads would spin while they wait.
    return (_band(len(values), kind) @ values.reshape(len(values), -1)).reshape(values.shape)


@lru_cache(maxsize=256)
def _band(pixel_count, kind):
    """Return the matrix of a filter along n pixels, the ends repeated outward."""
    if isinstance(kind, float):
        offsets = np.arange(-_RADIUS, _RADIUS + 1)
        weights = np.exp(-(np.pi**2) * (offsets / _PPD) ** 2 / kind)
        weights /= weights.sum()
    else:
        radius = int(np.ceil(3 * _FEATURE))
        offsets = np.arange(-radius, radius + 1)
        weights = np.exp(-(offsets**2) / (2 * _FEATURE**2))
        weights *= {'smooth': 1, 'slope': -offsets, 'bend': offsets**2 / _FEATURE**2 - 1}[kind]
        is_negative, is_positive = weights < 0, weights > 0
        weights[is_positive] /= weights[is_positive].sum()
        if is_negative.any():
            weights[is_negative] /= -weights[is_negative].sum()
    weights[np.abs(weights) < _TAIL * np.abs(weights).max()] = 0
    filter_matrix = np.zeros((pixel_count, pixel_count))
    source_pixels = np.clip(np.arange(pixel_count)[:, None] + offsets, 0, pixel_count - 1)
    np.add.at(filter_matrix, (np.arange(pixel_count)[:, None], source_pixels), weights)
    return scipy.sparse.csr_array(filter_matrix.astype(np.float32))


@lru_cache(maxsize=1)
def _largest() -> float:
    """Return the largest difference of colours, that of green and blue."""
    colors = np.array([[0, 1, 0], [0, 0, 1]], float)
    green, blue = _perceived([c[:, None] for c in (_YCC @ colors.T)]).squeeze(-1).T
    off = green - blue
    return float((abs(off[0]) + np.hypot(off[1], off[2])) ** _QC)
