"""Projection of several pictures onto one surface: sampling, weights, blending, exposure.

Arrays over views start with the view: v views, n points, c channels.
"""

from __future__ import annotations

import numpy as np

from pvibr.maths.arguments import check_one_of, checked_number

#: Gains are thought to be within this of 1, as a natural logarithm, before any overlap is seen.
PRIOR = 0.5
#: Overlaps are never trusted beyond this: their samples are neighbours, not independent.
_TRUST = 1e-3
_CLIPPED = 0.02  # share of the range at either end where a camera's response is not to be trusted


def sample(image, uv, filter='linear'):
    """Return the colours (n, c) of a picture (h, w[, c]), top row first, at uv; NaN outside."""
    image = np.asarray(image)
    image = image[..., None] if image.ndim == 2 else image
    if image.ndim != 3 or not image.size:
        raise ValueError(
            f'image has the shape {image.shape}; it must be (h, w) or (h, w, c), not empty.'
        )
    check_one_of('filter', filter, ('linear', 'nearest'))
    uv = np.asarray(uv, dtype=np.float64)
    inside = ((uv >= 0) & (uv <= 1)).all(axis=1)
    high, wide, channels = image.shape
    x, y = uv[inside, 0] * wide - 0.5, (1 - uv[inside, 1]) * high - 0.5
    texels, colors = image.reshape(-1, channels), np.full((len(uv), channels), np.nan)

    def texel(column, row):
        column, row = (np.clip(v, 0, n - 1).astype(int) for v, n in ((column, wide), (row, high)))
        return texels.take(row * wide + column, axis=0)

    if filter == 'nearest':
        colors[inside] = texel(np.floor(x + 0.5), np.floor(y + 0.5))
        return colors
    left, top = np.floor(x), np.floor(y)
    across, down = (x - left)[:, None], (y - top)[:, None]
    above, below = (
        (1 - across) * texel(left, row) + across * texel(left + 1, row) for row in (top, top + 1)
    )
    colors[inside] = (1 - down) * above + down * below
    return colors


def border(uv, width):
    """Return weights that fall smoothly to zero within `width` (a fraction) of the edges."""
    checked_number('width', width, 0, 0.5)
    uv = np.asarray(uv, dtype=np.float64)
    inward = np.minimum(uv, 1 - uv).min(axis=-1)
    if not width:
        return (inward >= 0).astype(np.float64)
    s = np.clip(np.nan_to_num(inward) / width, 0.0, 1.0)
    return s * s * (3 - 2 * s)


def weights(cosines, texels=None, borders=None, masks=None, method='feather', power=1.0):
    """Return the weight of each view at each point, (v, n), of sum 1, or 0 where no view shows it.

    From cosines (of the normal and the view), pixel widths, border and mask weights, all (v, n).
    """
    check_one_of('method', method, ('feather', 'best'))
    checked_number('power', power, 0)
    cosines = np.asarray(cosines, dtype=np.float64)
    if cosines.ndim != 2:
        raise ValueError(f'cosines have the shape {cosines.shape}; it must be (views, points).')
    score = np.where(cosines > 0, np.maximum(cosines, 0.0) ** power, 0.0)
    for name, factor in ('borders', borders), ('masks', masks):
        if factor is not None:
            score *= np.clip(np.nan_to_num(_like(cosines, name, factor)), 0.0, 1.0)
    if texels is not None:
        texels = _like(cosines, 'texels', texels)
        usable = (texels > 0) & (texels < np.inf) & (score > 0)
        # Relative to the finest, so that no unit of length leaves the range of numbers.
        finest = np.where(usable, texels, np.inf).min(axis=0, initial=np.inf)
        ratio = np.divide(finest, texels, out=np.zeros_like(score), where=usable)
        score *= ratio * ratio
    if method == 'best':
        first = np.arange(len(score))[:, None] == score.argmax(axis=0) if len(score) else score
        score = np.where(first & (score > 0), 1.0, 0.0) if len(score) else score
    total = score.sum(axis=0)
    return np.divide(score, total, out=np.zeros_like(score), where=total > 0)


def blend(colors, weights):
    """Return the weighted mean colour of each point, (n, c); NaN where nothing has a weight."""
    colors, weights = _views(colors, weights)
    # Relative to the largest, so that no product of small weights is rounded to its last bit.
    largest = weights.max(axis=0, initial=0.0)
    weights = np.divide(weights, largest, out=np.zeros_like(weights), where=largest > 0)
    mixed = np.einsum('vn,vnc->nc', weights, np.where(weights[..., None] > 0, colors, 0.0))
    total = weights.sum(axis=0)[:, None]
    return np.divide(mixed, total, out=np.full_like(mixed, np.nan), where=total > 0)


def exposure_gains(colors, weights=None, limits=(0.0, 255.0), common=False):
    """Return gains (v, c), or (v,) if `common`, that equalize the exposure of overlapping views.

    Brown and Lowe, "Automatic Panoramic Image Stitching using Invariant Features", International
    Journal of Computer Vision 74(1), 2007, section 6, here on logarithms.
    """
    low, high = limits
    if not low < high:
        raise ValueError(f'limits are {limits}; the first must be below the second.')
    colors, weights = _views(colors, weights)
    edge = _CLIPPED * (high - low)
    usable = (colors > max(low + edge, 0.0)) & (colors < high - edge) & (weights[..., None] > 0)
    logs = np.log(np.where(usable, colors, 1.0))
    channels = [slice(None)] if common else [slice(c, c + 1) for c in range(colors.shape[2])]
    gains = [_log_gains(logs[..., c], usable[..., c]) for c in channels]
    gains = np.exp(np.array(gains).reshape(len(channels), len(colors)).T)
    return gains[:, 0] if common else gains


def _log_gains(logs, usable):
    count = len(logs)
    normal = np.eye(count) / PRIOR**2
    right = np.zeros(count)
    for i in range(count):
        for j in range(i + 1, count):
            both = usable[i] & usable[j]
            if not both.any():
                continue
            difference = logs[j][both] - logs[i][both]
            middle, certainty = _median(difference)
            normal[[i, j], [i, j]] += certainty
            normal[[i, j], [j, i]] -= certainty
            right[[i, j]] += certainty * middle, -certainty * middle
    return np.linalg.solve(normal, right)


def _median(values):
    """Return the median and the inverse of its variance."""
    middle = np.median(values)
    # 1.48 makes a standard deviation of the median distance, 1.25 that of a median from a mean's.
    spread = 1.48 * np.median(np.abs(values - middle)) if len(values) > 2 else PRIOR
    return middle, 1 / ((1.25 * spread) ** 2 / len(values) + _TRUST**2)


def _views(colors, weights):
    """Return colours and weights as float64; the weight is 0 where a colour is not finite."""
    colors = np.asarray(colors, dtype=np.float64)
    if colors.ndim != 3:
        raise ValueError(
            f'colors have the shape {colors.shape}; it must be (views, points, channels).'
        )
    shown = np.isfinite(colors).all(axis=2)
    weights = shown if weights is None else _like(shown, 'weights', weights)
    if (weights < 0).any():
        raise ValueError(f'weights have a minimum of {np.nanmin(weights)}; none may be negative.')
    return colors, np.where(shown & (weights > 0), weights, 0.0)


def _like(shape_of, name, values):
    values = np.asarray(values, dtype=np.float64)
    if values.shape != shape_of.shape:
        raise ValueError(
            f'{name} have the shape {values.shape}; it must be {shape_of.shape}: views, points.'
        )
    return values
