"""Colours dilated into excluded texels, so that filters of straight RGBA mix in nothing else.

Shaders that blend what they sample, and VTK's own, filter colour and alpha apart: what transparent
texels hold shows beside them, unless it is the colour of their neighbours.
"""

from __future__ import annotations

import numpy as np


def filled(picture):
    """Return an RGBA picture, uint8, with colours dilated into its transparent texels."""
    row, column = np.nonzero(picture[..., 3] == 0)
    if not len(row):
        return picture
    # The full size is never held as floats: photographs have tens of millions of pixels.
    half_size = sum(premultiplied(q) for q in _quarters(picture)) / 4
    picture = picture.copy()
    picture[row, column, :3] = dilated(half_size)[row // 2, column // 2, :3]
    return picture


def premultiplied(picture):
    """Return an RGBA picture, uint8, as float32 from 0 to 1 with colours times alpha."""
    values = picture.astype(np.float32) / 255
    values[..., :3] *= values[..., 3:]
    return values


def straight(picture):
    """Return a premultiplied RGBA picture, uint8, with colours that are not."""
    alpha = np.maximum(picture[..., 3:], 1).astype(np.float32)
    colors = np.minimum(np.rint(picture[..., :3] * (255 / alpha)), 255)
    return np.concatenate([colors.astype(np.uint8), picture[..., 3:]], 2)


def _quarters(picture):
    """Return the four pictures of every second row and column, padded with zeros."""
    height, width = picture.shape[:2]
    picture = np.pad(picture, ((0, height % 2), (0, width % 2), (0, 0)))
    return [picture[i::2, j::2] for i in (0, 1) for j in (0, 1)]


def dilated(picture):
    """Return premultiplied RGBA from 0 to 1 as straight uint8, dilated into transparent texels.

    Pull-push interpolation: Gortler et al., "The Lumigraph", SIGGRAPH 1996, section 3.4.
    """
    levels = [picture]
    while max(levels[-1].shape[:2]) > 1:
        levels.append(sum(_quarters(levels[-1])) / 4)
    colors = np.zeros((1, 1, 3), np.float32)
    for level in reversed(levels):
        row, column = (np.arange(n) // 2 for n in level.shape[:2])
        alpha = level[..., 3:]
        straight = level[..., :3] / np.maximum(alpha, 1e-6)
        colors = np.where(alpha > 0, straight, colors[row][:, column])
    rgba = np.concatenate([colors, picture[..., 3:]], 2)
    return np.rint(255 * rgba.clip(0, 1)).astype(np.uint8)
