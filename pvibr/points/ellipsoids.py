"""Ellipsoids by the million, ray-cast per pixel, without triangles."""

from __future__ import annotations

import numpy as np

from pvibr.core.arguments import as_array
from pvibr.core.signatures import takes
from pvibr.maths.quaternions import to_matrices
from pvibr.points.billboard_cards import as_points
from pvibr.points.quadric_geometry import EllipsoidGeometry
from pvibr.points.quadrics import Quadrics, lengths_of, points_property, with_scalars
from pvibr.things.appearance import read_only
from pvibr.things.placing import points_in


class Ellipsoids(Quadrics):
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

    points = points_property()
    geometry: EllipsoidGeometry

    @takes(looks=Quadrics)
    def __init__(self, points, radii=0.5, orientation=None, **looks):
        self._own_points = as_points(points)
        self._radii = lengths_of('radii', radii, (len(self), 3))
        self._turns = _checked_turns(orientation, len(self))
        super().__init__(**with_scalars(points, looks))

    def __len__(self):
        return len(self._own_points)

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
        return self.geometry.axes

    def _geometry_in(self, world):
        centers, linear_map = points_in(world, self._own_points), None
        if world is not None:
            linear_map = world[:3, :3]
        return EllipsoidGeometry.of_turned(centers, self._radii, self._turns, linear_map)


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
