"""Ellipsoids by the million, ray-cast per pixel, without triangles."""

from __future__ import annotations

from typing import Any

import numpy as np

from pvibr.core.arguments import as_array
from pvibr.core.signatures import takes
from pvibr.maths.quaternions import to_matrices
from pvibr.points.billboard_cards import as_points
from pvibr.points.quadric_cards import Shape, residual_texels
from pvibr.points.quadric_rays import meet_ellipsoids
from pvibr.points.quadrics import PointQuadrics, Quadrics, lengths_of, with_scalars
from pvibr.points.unit_meshes import balls, linear
from pvibr.things.appearance import read_only
from pvibr.things.placing import is_similar

_FLATTEST = 1e-4  # least semi-axis over the largest, for float precision
ELLIPSOIDS = Shape('ellipsoids', texels=3, largest_point=12.0, fill=0.4)


class AxesQuadrics(PointQuadrics):
    """Ellipsoids by their semi-axes in world space.

    Parameters are those of :class:`pvibr.Ellipsoids`.
    """

    #: Semi-axes in columns, shape (n, 3, 3), and the largest of their lengths.
    _axes: Any
    _reach: np.ndarray

    def _spheres(self):
        return self._points, self._reach

    @np.errstate(over='ignore')
    def _extents(self):
        return np.linalg.norm(self._axes, axis=2)

    def _rows(self, middles):
        return np.concatenate([self._axes.swapaxes(1, 2), middles[:, :, None]], 2)

    def _bodies(self, indices=slice(None)):
        matrices = linear(self._points[indices], self._axes[indices])
        return [(*balls(self.prop), matrices, self._colored(indices))]

    def _residuals(self, eye, index):
        axes = self._axes[index]
        with np.errstate(divide='ignore', invalid='ignore'):  # length 0 is not drawn
            scaled_axes = axes / (axes**2).sum(1, keepdims=True)
        scaled = np.einsum('nji,nj->ni', scaled_axes, self._points[index] - eye)
        scaled_distance = np.linalg.norm(scaled, axis=1)
        return residual_texels((scaled_distance - 1) * (scaled_distance + 1), 1.0)

    def _meet(self, start, direction, index):
        return meet_ellipsoids(start, direction, self._points[index], self._axes[index])


class Ellipsoids(AxesQuadrics):
    """Ellipsoids by the million, ray-cast per pixel, without triangles.

    Parameters
    ----------
    points : array_like, shape (n, 3), dataset or table
        Centres, world units.
    radii : float or array_like, shape (n, 3) or (3,)
        Semi-axes, world units, raised to 1e-4 of the largest; if all are 0, nothing is drawn.
    orientation : array_like, shape (n, 4), (4,), (n, 3, 3) or (3, 3), optional
        Quaternions (w, x, y, z), or matrices with the directions of the axes in columns, such as
        numpy's eigenvectors; they may be mirrored.
    **looks
        As of :class:`pvibr.Spheres`.

    Raises
    ------
    TypeError, ValueError
        If an argument is invalid.

    Notes
    -----
    As for :class:`pvibr.Spheres`; those thinner than a pixel are drawn one pixel wide.

    Examples
    --------
    >>> import pyvista as pv
    >>> import pvibr
    >>> import numpy as np
    >>> tensor = np.diag([1.0, 4.0, 9.0])
    >>> values, vectors = np.linalg.eigh(tensor)
    >>> pl = pv.Plotter(off_screen=True)
    >>> things = pl.ibr.add(pvibr.Ellipsoids([[0, 0, 0]], np.sqrt(values), vectors))
    >>> tuple(things.bounds)
    (-1.0, 1.0, -2.0, 2.0, -3.0, 3.0)
    >>> pl.close()
    """

    shape = ELLIPSOIDS

    @takes(looks=Quadrics)
    def __init__(self, points, radii=0.5, orientation=None, **looks):
        self._own_points = as_points(points)
        self._radii = lengths_of('radii', radii, (len(self), 3))
        self._turns = _checked_turns(orientation, len(self))
        self._place()
        super().__init__(**with_scalars(points, looks))

    @property
    def radii(self) -> np.ndarray:
        """Semi-axes, shape (n, 3), in its own space."""
        return read_only(self._radii)

    @radii.setter
    def radii(self, radii):
        self._radii = lengths_of('radii', radii, (len(self), 3))
        self._moved()

    @property  # type: ignore[override]
    def orientation(self) -> np.ndarray:
        """Directions of the axes in columns, (n, 3, 3); set matrices or quaternions."""
        # Overrides the actor's, which its methods and user matrix still set.
        return read_only(self._turns)

    @orientation.setter
    def orientation(self, orientation):
        self._turns = _checked_turns(orientation, len(self))
        self._moved()

    def axes(self) -> np.ndarray:
        """Return the semi-axes as drawn, in columns.

        Returns
        -------
        numpy.ndarray, shape (n, 3, 3)
            World units; of length 0 if nothing is drawn.
        """
        self.follow()
        return self._axes

    def _place(self):
        super()._place()
        largest = self._radii.max(1, initial=0.0)
        axes = self._turns * np.maximum(self._radii, _FLATTEST * largest[:, None])[:, None]
        if self._world is not None:
            axes = moved_axes(self._world[:3, :3], axes)
            largest = np.linalg.norm(axes, axis=1).max(1, initial=0.0)
        self._axes, self._reach = axes, largest


def moved_axes(linear, axes):
    """Return semi-axes, (n, 3, 3) in columns, of ellipsoids transformed by a matrix."""
    sheared_axes = linear @ axes
    if is_similar(linear):
        return sheared_axes
    directions, lengths, _ = np.linalg.svd(sheared_axes)
    largest = lengths.max(1, keepdims=True, initial=0.0)
    return directions * np.maximum(lengths, _FLATTEST * largest)[:, None]


def _checked_turns(orientation, count):
    turns = (1.0, 0, 0, 0) if orientation is None else orientation
    turns = as_array('orientation', turns, float)
    quaternion_shapes = (4,), (count, 4)
    if turns.shape not in (*quaternion_shapes, (3, 3), (count, 3, 3)):
        raise ValueError(
            f'orientation must be quaternions, (4,) or ({count}, 4), or matrices, (3, 3) or '
            f'({count}, 3, 3), got shape {turns.shape}'
        )
    if turns.shape in quaternion_shapes:
        length = np.linalg.norm(turns, axis=-1, keepdims=True)
        if not (np.isfinite(length) & (length > 0)).all():
            raise ValueError(
                'orientation must be finite quaternions (w, x, y, z) of length above 0'
            )
        turns = to_matrices(turns / length)
    if not np.allclose(turns.swapaxes(-1, -2) @ turns, np.eye(3), rtol=0, atol=1e-4):
        raise ValueError('orientation must have orthonormal columns')
    return np.broadcast_to(turns, (count, 3, 3)).copy()
