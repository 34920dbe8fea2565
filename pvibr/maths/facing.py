"""Orientation of cards toward an eye, and the eye of a view matrix."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from pvibr.core.arguments import check_one_of
from pvibr.maths.quaternions import to_matrices
from pvibr.maths.vectors import as_units, unit_vectors

#: Whether a card is fixed, turns about an axis or its centre, or lies parallel to the screen.
FACINGS = 'world', 'cylindrical', 'spherical', 'screen'
TOWARDS = 'point', 'plane'
#: Sine of the angle between axis and view below which the axis does not determine right.
ALIGNED = 1e-4
#: Cosine of the angle between an axis and x from which azimuth 0 is y.
CLOSE = 0.9


class Eye(NamedTuple):
    """A camera's position and unit axes in world space, (3,) each; it looks along `direction`."""

    position: np.ndarray
    right: np.ndarray
    up: np.ndarray
    direction: np.ndarray


def eye_of(view_from_world) -> Eye:
    """Return the camera of a view matrix [R t]: its position is -R^T t, its up R^T y.

    Parameters
    ----------
    view_from_world : array_like, shape (4, 4)
        A rotation and a translation; the eye looks along -z of view space.

    Returns
    -------
    Eye
        float64.

    Raises
    ------
    ValueError
        If the upper left 3x3 is not a rotation.

    Examples
    --------
    >>> from pvibr.maths.facing import eye_of
    >>> from pvibr.maths.views import look_along
    >>> eye = eye_of(look_along([1, 2, 3], [0, 1, 0], [0, 0, 1]))
    >>> eye.position.tolist(), eye.direction.tolist(), eye.up.tolist()
    ([1.0, 2.0, 3.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0])
    """
    view = np.asarray(view_from_world, float)
    R, t = view[:3, :3], view[:3, 3]
    if not np.allclose(R @ R.T, np.eye(3), rtol=0, atol=1e-6) or np.linalg.det(R) < 0:
        raise ValueError(f'view_from_world must start with a rotation, got {R.tolist()}')
    return Eye(-R.T @ t, R[0], R[1], -R[2])


def cards(
    points,
    view_from_world,
    facing='spherical',
    *,
    axis=None,
    towards='point',
    orientation=None,
    rotation=0.0,
    parallel=False,
):
    """Return the axes of cards: right, up, and the normal toward the eye.

    If the eye is on a card's axis, right is the camera's; a cylindrical card is seen edge-on.

    Parameters
    ----------
    points : array_like, shape (n, 3)
        World units.
    view_from_world : array_like, shape (4, 4)
        See :func:`eye_of`.
    facing : {'spherical', 'cylindrical', 'screen', 'world'}
        Turned to the eye; about `axis` only; parallel to the screen; or fixed.
    axis : array_like, shape (3,) or (n, 3), optional
        Up on the cards: by default z for cylindrical, the camera's up for spherical ones.
    towards : {'point', 'plane'}
        Turned to the eye's position, or to its plane and so all alike.
    orientation : array_like, shape (4,) or (n, 4), optional
        Quaternions (w, x, y, z) of ``'world'`` cards: right from x, up from y, normal from z.
    rotation : array_like, shape () or (n,)
        Radians counter-clockwise, as seen from the normal's side.
    parallel : bool
        Whether the projection is parallel.

    Returns
    -------
    numpy.ndarray, shape (n, 3, 3)
        Rotations of columns right, up, normal, world space.

    Raises
    ------
    ValueError
        If a name is unknown, or `axis` or `orientation` is zero.

    Examples
    --------
    >>> from pvibr.maths.facing import cards
    >>> from pvibr.maths.views import look_along
    >>> view = look_along([0, -5, 5], [0, 1, -1], [0, 0, 1])
    >>> cards([[0, 0, 0]], view, 'cylindrical')[0].T.round(3).tolist()
    [[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]]
    """
    check_one_of('facing', facing, FACINGS)
    check_one_of('towards', towards, TOWARDS)
    points = np.asarray(points, float).reshape(-1, 3)
    eye = eye_of(view_from_world)
    if facing == 'world':
        axes = _turned(orientation, len(points))
    elif facing == 'screen':
        axes = np.tile(np.stack([eye.right, eye.up, -eye.direction], 1), (len(points), 1, 1))
    else:
        toward = _toward(points, eye, towards == 'plane' or parallel)
        if axis is None:
            axis = eye.up if facing == 'spherical' else (0.0, 0.0, 1.0)
        axes = _upright(toward, as_units('axis', axis), eye.right, facing == 'cylindrical')
    return _rolled(axes, rotation)


def azimuths(points, view_from_world, axis=(0.0, 0.0, 1.0), *, parallel=False):
    """Return the azimuths about an axis from which an eye sees points.

    Parameters
    ----------
    points : array_like, shape (n, 3)
        World units.
    view_from_world : array_like, shape (4, 4)
        See :func:`eye_of`.
    axis : array_like, shape (3,) or (n, 3)
        Counter-clockwise about it; 0 is x, or y where the axis is close to x.
    parallel : bool
        Whether the projection is parallel.

    Returns
    -------
    numpy.ndarray, shape (n,)
        Radians from -pi to pi.

    Examples
    --------
    >>> from pvibr.maths.facing import azimuths
    >>> from pvibr.maths.views import look_along
    >>> azimuths([[0, 0, 0]], look_along([0, 5, 9], [0, -1, 0], [0, 0, 1])).round(4).tolist()
    [1.5708]
    """
    points = np.asarray(points, float).reshape(-1, 3)
    toward = _toward(points, eye_of(view_from_world), parallel)
    axis = np.broadcast_to(as_units('axis', axis), points.shape)
    return _azimuths(toward, axis)


def turned_azimuths(axes, rotation):
    """Return the azimuths about rotated axes of what had azimuth 0 before, radians."""
    axes, rotation = as_units('axes', axes), np.asarray(rotation, float)
    axis_rows = axes.reshape(-1, 3)
    azimuth_angles = _azimuths(_azimuth_zero(axis_rows) @ rotation.T, axis_rows @ rotation.T)
    return azimuth_angles.reshape(axes.shape[:-1])


def _azimuth_zero(axis):
    """Return the directions of azimuth 0 about axes, (n, 3)."""
    reference_axis = np.where(np.abs(axis[:, :1]) < CLOSE, (1.0, 0.0, 0.0), (0.0, 1.0, 0.0))
    return reference_axis - axis * (axis * reference_axis).sum(1, keepdims=True)


def _azimuths(toward, axis):
    zero = _azimuth_zero(axis)
    return np.arctan2((toward * np.cross(axis, zero)).sum(1), (toward * zero).sum(1))


def _toward(points, eye, to_plane):
    """Return unit vectors from points to the eye, or against its direction."""
    against_view = np.tile(-eye.direction, (len(points), 1))
    if to_plane:
        return against_view
    to_eye = unit_vectors(eye.position - points)
    return np.where(to_eye.any(axis=1, keepdims=True), to_eye, against_view)


def _upright(toward, axis, camera_right, about_axis):
    """Return axes of cards whose up is closest to an axis, or the axis itself."""
    axis = np.broadcast_to(axis, toward.shape)
    right = np.cross(axis, toward)
    sines = np.linalg.norm(right, axis=1, keepdims=True)
    fixed_axis = axis if about_axis else toward
    fallback_right = camera_right - fixed_axis * (fixed_axis @ camera_right)[:, None]
    right = np.where(sines > ALIGNED, right, fallback_right)
    right = unit_vectors(right)
    up, normal = (axis, np.cross(right, axis)) if about_axis else (np.cross(toward, right), toward)
    return np.stack([right, up, normal], 2)


def _turned(orientation, count):
    if orientation is None:
        orientation = 1.0, 0.0, 0.0, 0.0
    quaternions = as_units('orientation', orientation).reshape(-1, 4)
    return np.broadcast_to(to_matrices(quaternions), (count, 3, 3))


def _rolled(axes, rotation):
    """Return axes rotated about their normal."""
    roll_angles = np.broadcast_to(np.asarray(rotation, float), (len(axes),))[:, None]
    right, up, normal = np.moveaxis(axes, 2, 0)
    cosines, sines = np.cos(roll_angles), np.sin(roll_angles)
    return np.stack([cosines * right + sines * up, cosines * up - sines * right, normal], 2)
