"""Projection of several pictures onto one surface: sampling, weights, blending, exposure.

Arrays over views start with the view: v views, n points, c channels.
"""

from __future__ import annotations

import numpy as np

from pvibr.core.arguments import check_one_of, checked_number

#: Standard deviation of the logarithm of gains before any overlap is observed.
PRIOR = 0.5
#: Least deviation of an overlap: its samples are neighbours, not independent.
_TRUST = 1e-3
_CLIPPED = 0.02  # share of the range at either end where a camera's response is unreliable


def sample(image, uv, filter='linear'):
    """Return the colours (n, c) of a picture (h, w[, c]), top row first, at uv; NaN outside.

    A fourth channel is alpha: it weights the others where it varies between texels.
    """
    image = np.asarray(image)
    image = image[..., None] if image.ndim == 2 else image
    if image.ndim != 3 or not image.size:
        raise ValueError(
            f'image must have shape (h, w) or (h, w, c) and not be empty, got {image.shape}'
        )
    check_one_of('filter', filter, ('linear', 'nearest'))
    uv = np.asarray(uv, dtype=np.float64)
    inside = ((uv >= 0) & (uv <= 1)).all(axis=1)
    tall, wide, channels = image.shape
    pixel_x, pixel_y = uv[inside, 0] * wide - 0.5, (1 - uv[inside, 1]) * tall - 0.5
    texels, colors = image.reshape(-1, channels), np.full((len(uv), channels), np.nan)

    def texel(column, row):
        column, row = (np.clip(v, 0, n - 1).astype(int) for v, n in ((column, wide), (row, tall)))
        return texels.take(row * wide + column, axis=0)

    if filter == 'nearest':
        colors[inside] = texel(np.floor(pixel_x + 0.5), np.floor(pixel_y + 0.5))
        return colors
    column_0, row_0 = np.floor(pixel_x), np.floor(pixel_y)
    across, down = (pixel_x - column_0)[:, None], (pixel_y - row_0)[:, None]
    corners = [texel(column_0 + j, row_0 + i) for i in (0, 1) for j in (0, 1)]
    upper_colors, lower_colors = (
        (1 - across) * corners[k] + across * corners[k + 1] for k in (0, 2)
    )
    mixed = (1 - down) * upper_colors + down * lower_colors
    if channels == 4:
        shares = [v * h for v in (1 - down, down) for h in (1 - across, across)]
        _weight_by_alpha(mixed, np.stack(corners), np.stack(shares))
    colors[inside] = mixed
    return colors


def _weight_by_alpha(mixed, corners, shares):
    """Replace the colours of points between texels of different alpha by means weighted by it."""
    rows = np.flatnonzero((corners[..., 3] != corners[0, :, 3]).any(0))
    corners, weights = corners[:, rows], shares[:, rows] * corners[:, rows, 3:]
    sums = np.where(weights > 0, weights * corners[..., :3], 0).sum(0)
    total = weights.sum(0)
    mixed[rows, :3] = np.divide(sums, total, out=mixed[rows, :3], where=total > 0)


def border(uv, width):
    """Return weights that fall smoothly to zero within `width` (a fraction) of the edges."""
    checked_number('width', width, 0, 0.5)
    uv = np.asarray(uv, dtype=np.float64)
    edge_distance = np.minimum(uv, 1 - uv).min(axis=-1)
    if not width:
        return (edge_distance >= 0).astype(np.float64)
    edge_share = np.clip(np.nan_to_num(edge_distance) / width, 0.0, 1.0)
    return edge_share * edge_share * (3 - 2 * edge_share)


def weights(cosines, texels=None, borders=None, masks=None, method='feather', power=1.0):
    """Return the weight of each view at each point, (v, n), of sum 1, or 0 where no view shows it.

    From cosines (of the normal and the view), pixel widths, border and mask weights, all (v, n).
    """
    check_one_of('method', method, ('feather', 'best'))
    checked_number('power', power, 0)
    cosines = np.asarray(cosines, dtype=np.float64)
    if cosines.ndim != 2:
        raise ValueError(f'cosines must have shape (views, points), got {cosines.shape}')
    score = np.where(cosines > 0, np.maximum(cosines, 0.0) ** power, 0.0)
    for name, factor in ('borders', borders), ('masks', masks):
        if factor is not None:
            score *= np.clip(np.nan_to_num(_like(cosines, name, factor)), 0.0, 1.0)
    if texels is not None:
        texels = _like(cosines, 'texels', texels)
        is_usable = (texels > 0) & (texels < np.inf) & (score > 0)
        # Relative to the finest, so that no unit of length overflows.
        finest = np.where(is_usable, texels, np.inf).min(axis=0, initial=np.inf)
        ratio = np.divide(finest, texels, out=np.zeros_like(score), where=is_usable)
        score *= ratio * ratio
    if method == 'best':
        is_best = np.arange(len(score))[:, None] == score.argmax(axis=0) if len(score) else score
        score = np.where(is_best & (score > 0), 1.0, 0.0) if len(score) else score
    score_sums = score.sum(axis=0)
    return np.divide(score, score_sums, out=np.zeros_like(score), where=score_sums > 0)


def blend(colors, weights):
    """Return the weighted mean colour of each point, (n, c); NaN where nothing has a weight."""
    colors, weights = _views(colors, weights)
    # Relative to the largest, so that products of small weights keep their digits.
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
        raise ValueError(f'limits must increase, got {limits}')
    colors, weights = _views(colors, weights)
    edge = _CLIPPED * (high - low)
    usable = (colors > max(low + edge, 0.0)) & (colors < high - edge) & (weights[..., None] > 0)
    log_colors = np.log(np.where(usable, colors, 1.0))
    channels = [slice(None)] if common else [slice(c, c + 1) for c in range(colors.shape[2])]
    gains = [_log_gains(log_colors[..., c], usable[..., c]) for c in channels]
    gains = np.exp(np.array(gains).reshape(len(channels), len(colors)).T)
    return gains[:, 0] if common else gains


def _log_gains(log_colors, is_usable):
    view_count = len(log_colors)
    normal_matrix = np.eye(view_count) / PRIOR**2
    right_side = np.zeros(view_count)
    for i in range(view_count):
        for j in range(i + 1, view_count):
            shared_points = is_usable[i] & is_usable[j]
            if not shared_points.any():
                continue
            log_differences = log_colors[j][shared_points] - log_colors[i][shared_points]
            median_difference, certainty = _median(log_differences)
            normal_matrix[[i, j], [i, j]] += certainty
            normal_matrix[[i, j], [j, i]] -= certainty
            right_side[[i, j]] += certainty * median_difference, -certainty * median_difference
    return np.linalg.solve(normal_matrix, right_side)


def _median(values):
    """Return the median and the inverse of its variance."""
    median = np.median(values)
    # 1.48 turns the median distance into a standard deviation, 1.25 a mean's into a median's.
    spread = 1.48 * np.median(np.abs(values - median)) if len(values) > 2 else PRIOR
    return median, 1 / ((1.25 * spread) ** 2 / len(values) + _TRUST**2)


def _views(colors, weights):
    """Return colours and weights as float64; the weight is 0 where a colour is not finite."""
    colors = np.asarray(colors, dtype=np.float64)
    if colors.ndim != 3:
        raise ValueError(f'colors must have shape (views, points, channels), got {colors.shape}')
    has_color = np.isfinite(colors).all(axis=2)
    weights = has_color if weights is None else _like(has_color, 'weights', weights)
    if (weights < 0).any():
        raise ValueError(f'weights must not be negative, got {np.nanmin(weights)}')
    return colors, np.where(has_color & (weights > 0), weights, 0.0)


def _like(shape_of, name, values):
    values = np.asarray(values, dtype=np.float64)
    if values.shape != shape_of.shape:
        raise ValueError(
            f'{name} must have shape (views, points) = {shape_of.shape}, got {values.shape}'
        )
    return values
