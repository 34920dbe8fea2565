"""Ellipsoids by the million, ray-cast per pixel, without triangles."""

from __future__ import annotations

import numpy as np

from pvibr.core.arguments import as_array
from pvibr.core.nan_rows import filled
from pvibr.core.signatures import takes
from pvibr.maths.quaternions import to_matrices
from pvibr.points.point_arguments import as_points, lengths_of
from pvibr.points.quadric_geometry import EllipsoidGeometry
from pvibr.points.quadrics import Quadrics
from pvibr.points.replaced_items import item_property
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

    points = item_property('points', 'Centres, shape (n, 3), in its own space.')
    radii = item_property('radii', 'Semi-axes, shape (n, 3), in its own space.')
    # Overrides the actor's, which its methods and user matrix still set.
    orientation = item_property(
        'orientation', 'Directions of the axes in columns, (n, 3, 3); set matrices or quaternions.'
    )
    geometry: EllipsoidGeometry

    @takes(looks=Quadrics)
    def __init__(self, points, radii=0.5, orientation=None, **looks):
        given = {'points': points, 'radii': radii, 'orientation': orientation}
        super().__init__(given, **looks)

    def _arranged_from(self, given, nan_rows) -> dict:
        points = as_points('points', given['points'], nan_rows)
        radii = lengths_of('radii', given['radii'], (len(points), 3), nan_rows)
        turns = _checked_turns(given['orientation'], len(points), nan_rows)
        return {'points': points, 'radii': radii, 'orientation': turns}

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
        points, radii, turns = self._arranged.values()
        linear_map = None if world is None else world[:3, :3]
        return EllipsoidGeometry.of_turned(points_in(world, points), radii, turns, linear_map)


def _checked_turns(orientation, count, nan_rows):
    turns = (1.0, 0, 0, 0) if orientation is None else orientation
    turns = as_array('orientation', turns, float)
    quaternion_shapes = (4,), (count, 4)
    if turns.shape not in (*quaternion_shapes, (3, 3), (count, 3, 3)):
        raise ValueError(
            f'orientation must be quaternions, (4,) or ({count}, 4), or matrices, (3, 3) or '
            f'({count}, 3, 3), got shape {turns.shape}'
        )
    if len(turns) == count and turns.shape not in ((4,), (3, 3)):
        turns = filled(nan_rows, 'orientation', turns)
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
