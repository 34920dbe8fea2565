"""Warps of a picture to another view: the best fit of points, and how wrong it is.

Pixels are counted from the lower left corner of the screen; warps are (3, 3) matrices that take
homogeneous pixels of the picture to those of the screen.
"""

from __future__ import annotations

import numpy as np

from pvibr.maths.views import corners

# Corners that have an edge of a box between them: those whose numbers differ in one bit.
_EDGES = np.array([(i, i | 1 << k) for i in range(8) for k in range(3) if not i >> k & 1])
_TINY = 1e-12


def to_screen(clip, size) -> tuple[np.ndarray, np.ndarray]:
    """Return where points in clip space are on the screen, and which are in front of the eye.

    Parameters
    ----------
    clip : numpy.ndarray, shape (n, 4)
        Homogeneous.
    size : tuple of 2 int
        Width and height of the screen, pixels.

    Returns
    -------
    at : numpy.ndarray, shape (n, 2)
        Pixels; of no meaning for those that are not in front.
    ahead : numpy.ndarray, shape (n,), bool
        Those between the near plane and infinity.
    """
    w = clip[:, 3]
    ahead = (w > _TINY) & (clip[:, 2] >= -w)
    ndc = clip[:, :2] / np.where(ahead, w, 1.0)[:, None]
    return (ndc + 1) / 2 * size, ahead


def extents(clip_from_world, bounds, size) -> np.ndarray:
    """Return the rectangles that boxes cover on the screen and beyond it.

    What is behind the near plane is cut off first: it is seen nowhere, and would be projected to
    the other side.

    Parameters
    ----------
    clip_from_world : numpy.ndarray, shape (4, 4)
        Of the view.
    bounds : array_like, shape (n, 6)
        World units.
    size : tuple of 2 int
        Width and height of the screen, pixels.

    Returns
    -------
    numpy.ndarray, shape (n, 4)
        Left, bottom, right and top in pixels; left above right for what is behind.

    Examples
    --------
    >>> import numpy as np
    >>> from pvibr.maths.layers import extents
    >>> extents(np.diag([1.0, 1, -1, 1]), [[-0.5, 0.5, -2, 0, 0, 0.5]], (100, 100)).tolist()
    [[25.0, -50.0, 75.0, 50.0]]
    """
    points = corners(bounds)
    clip = points @ clip_from_world[:, :3].T + clip_from_world[:, 3]
    room = clip[..., 2] + clip[..., 3]  # 0 on the near plane
    first, second = clip[:, _EDGES[:, 0]], clip[:, _EDGES[:, 1]]
    a, b = room[:, _EDGES[:, 0]], room[:, _EDGES[:, 1]]
    crosses = (a > 0) != (b > 0)
    share = np.where(crosses, a / np.where(crosses, a - b, 1.0), 0.0)[..., None]
    found = np.concatenate([clip, first + share * (second - first)], 1)
    use = np.concatenate([room > 0, crosses], 1) & (found[..., 3] > _TINY)
    at = found[..., :2] / np.where(use, found[..., 3], 1.0)[..., None]
    at = (at + 1) / 2 * np.asarray(size, float)
    low = np.where(use[..., None], at, np.inf).min(1)
    high = np.where(use[..., None], at, -np.inf).max(1)
    return np.concatenate([low, high], 1)


def part_of(clip_from_view, size, rect) -> np.ndarray:
    """Return the projection whose picture is a rectangle of the screen, or beyond it.

    Parameters
    ----------
    clip_from_view : numpy.ndarray, shape (4, 4)
        The screen's.
    size : tuple of 2 int
        Width and height of the screen, pixels.
    rect : sequence of 4 float
        Left, bottom, right and top, pixels.

    Returns
    -------
    numpy.ndarray, shape (4, 4)
        The same depth; a point of the rectangle is where it was.

    Examples
    --------
    >>> import numpy as np
    >>> from pvibr.maths.layers import part_of
    >>> (part_of(np.eye(4), (100, 100), (0, 0, 50, 100)) @ [-0.5, 0, 0, 1]).tolist()
    [0.0, 0.0, 0.0, 1.0]
    """
    out = np.array(clip_from_view, float)
    for k in range(2):
        span = rect[2 + k] - rect[k]
        out[k] *= size[k] / span
        out[k] += ((size[k] - 2 * rect[k]) / span - 1) * np.asarray(clip_from_view)[3]
    return out


def moved(warp, points) -> np.ndarray:
    """Return where a warp takes points.

    Parameters
    ----------
    warp : numpy.ndarray, shape (3, 3)
        See the module.
    points : numpy.ndarray, shape (n, 2)
        Pixels.

    Returns
    -------
    numpy.ndarray, shape (n, 2)
        Pixels; inf for those on or beyond the horizon.
    """
    out = points @ warp[:, :2].T + warp[:, 2]
    ahead = out[:, 2:] > _TINY
    return np.where(ahead, out[:, :2] / np.where(ahead, out[:, 2:], 1.0), np.inf)


def fit_affine(source, target) -> np.ndarray:
    """Return the affine warp that takes points nearest to others, by least squares.

    Of points on one line or in one place, what they do not tell is left as it is.

    Parameters
    ----------
    source, target : numpy.ndarray, shape (n, 2)
        Pixels.

    Returns
    -------
    numpy.ndarray, shape (3, 3)
        The warp; without points, none.

    Examples
    --------
    >>> import numpy as np
    >>> from pvibr.maths.layers import fit_affine
    >>> square = np.array([[0.0, 0], [9, 0], [9, 9], [0, 9]])
    >>> fit_affine(square, 2 * square + 3).round(9).tolist()
    [[2.0, 0.0, 3.0], [0.0, 2.0, 3.0], [0.0, 0.0, 1.0]]
    """
    warp = np.eye(3)
    if not len(source):
        return warp
    middle, there = source.mean(0), target.mean(0)
    x, change = source - middle, (target - there) - (source - middle)
    square = x.T @ x
    # Directions in which the points reach no further than a pixel are no directions to fit.
    values, axes = np.linalg.eigh(square)
    good = values > len(x)
    inverse = (axes[:, good] / values[good]) @ axes[:, good].T
    warp[:2, :2] += (inverse @ (x.T @ change)).T
    warp[:2, 2] = there - warp[:2, :2] @ middle
    return warp


def fit_plane(pixels, inverse_depth) -> np.ndarray:
    """Return the plane nearest to points, as the camera that saw them has it.

    Parameters
    ----------
    pixels : numpy.ndarray, shape (n, 2)
        Where they were seen.
    inverse_depth : numpy.ndarray, shape (n,)
        One over their distances along the view, or these themselves in a parallel view: both are
        linear in pixels on a plane.

    Returns
    -------
    numpy.ndarray, shape (3,)
        What a homogeneous pixel is multiplied by.
    """
    if not len(pixels):
        return np.zeros(3)
    middle = pixels.mean(0)
    x, y = pixels - middle, inverse_depth - inverse_depth.mean()
    values, axes = np.linalg.eigh(x.T @ x)
    good = values > len(x)
    slope = (axes[:, good] / values[good]) @ axes[:, good].T @ (x.T @ y)
    return np.array([*slope, inverse_depth.mean() - slope @ middle])


def plane_warp(clip_from_view, view_from_pixel, plane, size, *, parallel) -> np.ndarray:
    """Return the warp of a plane to another view: exact for it, and for all if the eye stays.

    Parameters
    ----------
    clip_from_view : numpy.ndarray, shape (4, 4)
        Clip space now from view space then.
    view_from_pixel : numpy.ndarray, shape (3, 3)
        Of a homogeneous pixel then: the point at distance 1 along the view; in a parallel view its
        x and y.
    plane : numpy.ndarray, shape (3,)
        See :func:`fit_plane`.
    size : tuple of 2 int
        Width and height of the screen now, pixels.
    parallel : bool
        Whether the view then was parallel.

    Returns
    -------
    numpy.ndarray, shape (3, 3)
        The warp.
    """
    one = np.array([0.0, 0.0, 1.0])
    rows = [-plane, one] if parallel else [-one, plane]
    points = np.concatenate([view_from_pixel[:2], rows])
    x, y, _, w = np.asarray(clip_from_view) @ points
    return np.stack([(x + w) / 2 * size[0], (y + w) / 2 * size[1], w])


def stretch(warp, at) -> tuple[float, float]:
    """Return how much longer the longest and the shortest steps become around a pixel.

    Parameters
    ----------
    warp : numpy.ndarray, shape (3, 3)
        See the module.
    at : array_like, shape (2,)
        A pixel of the picture.

    Returns
    -------
    longest : float
        1 where nothing changes.
    shortest : float
        As well.
    """
    x, y, w = warp @ [*at, 1.0]
    if w <= _TINY:
        return np.inf, 0.0
    slope = (warp[:2, :2] - np.outer([x / w, y / w], warp[2, :2])) / w
    longest, shortest = np.linalg.svd(slope, compute_uv=False)
    return float(longest), float(shortest)


def reaches(warp, rect, open_sides, size) -> bool:
    """Return True if a picture covers the screen wherever it was cut off.

    Parameters
    ----------
    warp : numpy.ndarray, shape (3, 3)
        From the picture to the screen.
    rect : sequence of 4 float
        Left, bottom, right and top of the picture, pixels.
    open_sides : sequence of 4 bool
        At which of these sides there is more than the picture shows.
    size : tuple of 2 int
        Width and height of the screen, pixels.
    """
    if not any(open_sides):
        return True
    if abs(np.linalg.det(warp)) < _TINY:
        return False
    (w, h), back = size, np.linalg.inv(warp)
    back = back * np.sign(back[2] @ [w / 2, h / 2, 1.0] or 1.0)
    screen = moved(back, np.array([[0.0, 0.0], [w, 0.0], [w, h], [0.0, h]]))
    if not np.isfinite(screen).all():
        return False
    low, high = screen.min(0), screen.max(0)
    within = low[0] >= rect[0], low[1] >= rect[1], high[0] <= rect[2], high[1] <= rect[3]
    return all(ok or not is_open for ok, is_open in zip(within, open_sides, strict=True))


def split_by_depth(nearest, farthest, count, *, ratio=True) -> np.ndarray:
    """Return which layer each of some boxes belongs to.

    Layers have equal ranges of the logarithm of the distance: the same step of the eye moves what
    is in them by as much against each other. Boxes that reach over more than two such ranges, and
    twice what most of them do, have one more layer for themselves: the ground is such a box.

    Parameters
    ----------
    nearest, farthest : numpy.ndarray, shape (n,)
        Distances of each, above 0 where they are logarithmic.
    count : int
        Layers of those that reach less far.
    ratio : bool, optional
        Whether ranges are of logarithms; in parallel projection they are of distances.

    Returns
    -------
    numpy.ndarray, shape (n,), int
        Numbers from 0, the nearest; `count` for those that reach over all.

    Examples
    --------
    >>> import numpy as np
    >>> from pvibr.maths.layers import split_by_depth
    >>> near = np.array([1.0, 9.0, 95.0, 1.0])
    >>> split_by_depth(near, np.array([1.5, 11.0, 105.0, 100.0]), 3).tolist()
    [0, 1, 2, 3]
    """
    low, high = (np.log(d) if ratio else np.asarray(d, float) for d in (nearest, farthest))
    middle = (low + high) / 2
    # What is wide has its middle anywhere: the others say how far apart they are.
    span = max(np.ptp(middle), _TINY) / count
    wide = high - low > 2 * max(span, np.median(high - low)) if len(low) > 1 else high < low
    if not (~wide).any():
        return np.full(len(low), count)
    start = middle[~wide].min()
    span = max(np.ptp(middle[~wide]), _TINY) / count
    found = np.clip(((middle - start) / span).astype(int), 0, count - 1)
    return np.where(wide, count, found)
