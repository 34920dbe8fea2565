"""Rays from the eye against spheres, in double precision: what the shader of spheres must show."""

from __future__ import annotations

import numpy as np


def cast(frame, centers, radii):
    """Return what is seen of spheres at the middle of each pixel.

    Parameters
    ----------
    frame : pvibr.frame.Frame
        Camera and size.
    centers : array_like, shape (n, 3)
        World units.
    radii : float or array_like, shape (n,)
        World units.

    Returns
    -------
    ids : numpy.ndarray of int, shape (h, w), top row first
        The nearest sphere; n more where its inside is seen, cut open by the near plane; -1 for
        none.
    depth : numpy.ndarray, shape (h, w)
        Distance along the view's axis; infinite where there is none.
    normals : numpy.ndarray, shape (h, w, 3)
        Eye space, toward the eye.

    Examples
    --------
    >>> import numpy as np
    >>> from pvibr.frame import Frame
    >>> from pvibr.maths.sphere_rays import cast
    >>> frame = Frame(
    ...     None, None, (3, 3), (0, 0), np.eye(4), np.diag([1.0, 1, -1, 1]),
    ...     parallel=True, near=0.0, far=10.0, eye=np.zeros(3),
    ... )  # fmt: skip
    >>> ids, depth, _ = cast(frame, [[0, 0, -3]], 0.5)
    >>> ids.tolist(), float(depth[1, 1])
    ([[-1, -1, -1], [-1, 0, -1], [-1, -1, -1]], 2.5)
    """
    starts, ways = _rays(frame)
    view = frame.view_from_world
    spots = np.asarray(centers, float) @ view[:3, :3].T + view[:3, 3]
    ids = np.full(ways.shape[:2], -1)
    depth = np.full(ways.shape[:2], np.inf)
    normals = np.zeros_like(ways)
    square = (ways**2).sum(-1)
    for i, (c, r) in enumerate(zip(spots, np.broadcast_to(radii, len(spots)), strict=True)):
        away = c - starts
        along = (away * ways).sum(-1)
        root = along * along - square * ((away**2).sum(-1) - r * r)
        hit = root > 0
        root = np.sqrt(np.maximum(root, 0))
        t = (along - root) / square
        inside = t < frame.near
        t = np.where(inside, (along + root) / square, t)
        hit &= (t >= frame.near) & (t < depth) & (t <= frame.far)
        n = (starts + t[..., None] * ways - c) / r * np.where(inside, -1, 1)[..., None]
        ids[hit], depth[hit], normals[hit] = i + len(spots) * inside[hit], t[hit], n[hit]
    return ids, depth, normals


def _rays(frame):
    """Return where the ray of each pixel starts and, per unit of depth, where it goes."""
    width, height = frame.size
    x = (np.arange(width) + 0.5) / width * 2 - 1
    y = 1 - (np.arange(height) + 0.5) / height * 2
    m = frame.clip_from_view
    offset = m[:2, 3] if frame.parallel else -m[:2, 2]
    slopes = (np.stack(np.meshgrid(x, y), -1) - offset) / [m[0, 0], m[1, 1]]
    starts, ways = np.zeros((2, height, width, 3))
    (starts if frame.parallel else ways)[..., :2] = slopes
    ways[..., 2] = -1
    return starts, ways


def inner(ids) -> np.ndarray:
    """Return the pixels whose neighbours show the same, those at the border left out.

    Parameters
    ----------
    ids : numpy.ndarray, shape (h, w)
        What is seen.

    Returns
    -------
    numpy.ndarray of bool, shape (h, w)
        No edge is beside them.

    Examples
    --------
    >>> import numpy as np
    >>> from pvibr.maths.sphere_rays import inner
    >>> inner(np.array([[1, 1, 1, 2]] * 3)).tolist()[1]
    [False, True, False, False]
    """
    same = np.ones(ids.shape, bool)
    for axis in (0, 1):
        for step in (-1, 1):
            same &= np.roll(ids, step, axis) == ids
    same[[0, -1]] = same[:, [0, -1]] = False
    return same
