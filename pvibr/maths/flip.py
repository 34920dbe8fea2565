"""FLIP, the difference of pictures as perceived when flipping between them."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from scipy.sparse import csr_array

_PPD = 3840 * np.pi / 180  # pixels per degree of a screen 0.7 m wide, 0.7 m away, of 3840 pixels
# Contrast sensitivity of Y, Cx and Cz: factors and widths of Gaussians.
_SENSITIVITY = ((1.0, 0.0047),), ((1.0, 0.0053),), ((34.1, 0.04), (13.5, 0.025))
_RADIUS = int(np.ceil(3 * np.sqrt(0.04 / (2 * np.pi**2)) * _PPD))
_FEATURE = 0.5 * 0.082 * _PPD  # standard deviation of a feature's Gaussian, pixels
_QC, _PC, _PT, _QF = 0.7, 0.4, 0.95, 0.5
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
        self._colors, self._features = _seen(references)

    def maps(self, images):
        """Return the difference maps of as many pictures, (n, h, w), 0 (equal) to 1."""
        colors, features = _seen(images)
        color_off = np.abs(colors[0] - self._colors[0])
        color_off += np.hypot(colors[1] - self._colors[1], colors[2] - self._colors[2])
        color_off = color_off**_QC
        largest_difference = _largest()
        is_small = color_off < _PC * largest_difference
        color_off = np.where(
            is_small,
            color_off * (_PT / (_PC * largest_difference)),
            _PT
            + (color_off - _PC * largest_difference)
            * ((1 - _PT) / (largest_difference - _PC * largest_difference)),
        )
        feature_off = np.abs(features - self._features).max(0)
        return (color_off ** (1 - (feature_off / np.sqrt(2)) ** _QF)).transpose(1, 2, 0)


def flip(image, reference):
    """Return the FLIP difference map of two sRGB pictures, (h, w), 0 (equal) to 1."""
    return Flip(np.asarray(reference)[None]).maps(np.asarray(image)[None])[0]


def _seen(images):
    """Return perceived colours, and the strength of edges and of points, (columns, n, rows)."""
    srgb = np.asarray(images, np.float32).transpose(1, 0, 2, 3)
    linear_rgb = np.where(srgb <= 0.04045, srgb / 12.92, ((srgb + 0.055) / 1.055) ** 2.4)
    opponent = [_mixed(row, np.moveaxis(linear_rgb, -1, 0)) for row in _YCC]
    filtered_channels = [_blurred(c, s) for c, s in zip(opponent, _SENSITIVITY, strict=True)]
    return _perceived(filtered_channels), _featured(opponent[0] / 116)


def _perceived(opponent):
    """Return Hunt-adjusted L*a*b* of filtered opponent colours."""
    rgb_from_opponent = np.linalg.inv(_WHITE.astype(float)) @ _BACK
    linear_rgb = [np.clip(_mixed(row, opponent), 0, 1) for row in rgb_from_opponent]
    x, y, z = (_lightness(_mixed(row, linear_rgb)) for row in _WHITE)
    lightness = 116 * y - 16
    return np.stack([lightness, 5 * (x - y) * lightness, 2 * (y - z) * lightness])


def _mixed(row, channels):
    return sum(np.float32(factor) * channel for factor, channel in zip(row, channels, strict=True))


def _lightness(ratio):
    threshold = 6 / 29
    return np.where(ratio > threshold**3, np.cbrt(ratio), ratio / (3 * threshold**2) + 4 / 29)


def _featured(y):
    """Return the strength of edges and points, (2, columns, n, rows)."""
    smooth, slope, bend = (_turned(_along(y, kind)) for kind in ('smooth', 'slope', 'bend'))
    across_features = _along(smooth, 'slope'), _along(smooth, 'bend')
    pairs = zip(across_features, (slope, bend), strict=True)
    return np.stack([np.hypot(wide, _along(tall, 'smooth')) for wide, tall in pairs])


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
    filter_matrix = np.zeros((pixel_count, pixel_count))
    source_pixels = np.clip(np.arange(pixel_count)[:, None] + offsets, 0, pixel_count - 1)
    np.add.at(filter_matrix, (np.arange(pixel_count)[:, None], source_pixels), weights)
    return csr_array(filter_matrix.astype(np.float32))


@lru_cache(maxsize=1)
def _largest() -> float:
    """Return the largest difference of colours, that of green and blue."""
    colors = np.array([[0, 1, 0], [0, 0, 1]], float)
    green, blue = _perceived([c[:, None] for c in (_YCC @ colors.T)]).squeeze(-1).T
    off = green - blue
    return float((abs(off[0]) + np.hypot(off[1], off[2])) ** _QC)
