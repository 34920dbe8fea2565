"""Cylinders and capsules by the million, ray-cast per pixel, without triangles."""

from __future__ import annotations

import numpy as np

from pvibr.core.arguments import check_one_of, naming
from pvibr.core.params import checked_flag
from pvibr.core.signatures import takes
from pvibr.points.point_arguments import as_points, lengths_of
from pvibr.points.quadric_geometry import CylinderGeometry
from pvibr.points.quadric_rays import CAPS
from pvibr.points.quadrics import Quadrics
from pvibr.points.replaced_items import item_property
from pvibr.things import appearance as look
from pvibr.things.placing import lengths_in, points_in


class Cylinders(Quadrics):
    """Cylinders by the million, ray-cast per pixel, without triangles.

    Parameters
    ----------
    points_a, points_b : array_like, shape (n, 3), dataset or table
        Ends of the axes, world units.
    radius : float or array_like, shape (n,)
        World units; radius 0 is not drawn.
    caps : {'flat', 'round', None}
        Flat ends, hemispheres, or open ends that show the inside.
    blend : bool
        Interpolate the colours of both ends along the axis; by default each half has the colour of
        its end, as in molecules.
    **looks
        As of :class:`pvibr.Spheres`; ``colors`` may have the shape (n, 2, 3), and ``scalars``
        (n, 2), for both ends.

    Raises
    ------
    TypeError, ValueError
        If an argument is invalid.

    Notes
    -----
    As for :class:`pvibr.Spheres`; those thinner than a pixel are drawn one pixel wide. Of
    length 0, those with round caps are spheres, and others are not drawn.

    Examples
    --------
    >>> import pyvista as pv
    >>> import pvibr
    >>> pl = pv.Plotter(off_screen=True)
    >>> bonds = pl.ibr.add(pvibr.Cylinders([[0, 0, 0]], [[0, 0, 2]], 0.5, scalars=[[0.0, 1.0]]))
    >>> tuple(bonds.bounds)
    (-0.5, 0.5, -0.5, 0.5, 0.0, 2.0)
    >>> pl.close()
    """

    points_a = item_property('points_a', 'First ends, shape (n, 3), in its own space.')
    points_b = item_property('points_b', 'Second ends, shape (n, 3), in its own space.')
    radius = item_property('radius', 'Radius of each, shape (n,), in its own space.')
    caps: str | None
    blend: bool

    @takes(looks=Quadrics)
    def __init__(self, points_a, points_b, radius=0.5, *, caps='flat', blend=False, **looks):
        check_one_of('caps', caps, CAPS)
        self.caps, self.blend = caps, bool(checked_flag('blend', blend))
        self._shape = CylinderGeometry.shape_of(self.caps, self.blend)
        super().__init__({'points_a': points_a, 'points_b': points_b, 'radius': radius}, **looks)

    def _arranged_from(self, given, nan_rows) -> dict:
        ends = {name: as_points(name, given[name], nan_rows) for name in ('points_a', 'points_b')}
        count, other_count = map(len, ends.values())
        if other_count != count:
            raise ValueError(
                f'points_b must have {count} rows, as points_a, got {other_count}; give both'
            )
        return {**ends, 'radius': lengths_of('radius', given['radius'], (count,), nan_rows)}

    def _check_linear(self, linear):
        super()._check_linear(linear)
        self._check_similar(
            linear, 'cylinders stay round: use add_instances of a cylinder mesh for others'
        )

    def _geometry_in(self, world):
        first_ends, second_ends, radii = self._arranged.values()
        ends = points_in(world, first_ends), points_in(world, second_ends)
        return CylinderGeometry(ends, lengths_in(world, radii), self.caps, self._shape)

    # -- looks of both ends -------------------------------------------------------------------

    def _as_scalars(self, scalars):
        with naming('scalars', scalars):
            paired = np.shape(scalars) == (len(self), 2)
        if paired:
            return look.as_scalars(np.ravel(scalars), 2 * len(self)).reshape(-1, 2)
        return super()._as_scalars(scalars)

    def _as_colors(self, colors, count=None):
        count = len(self) if count is None else count
        with naming('colors', colors):
            paired = np.ndim(colors) == 3
        if paired and np.shape(colors)[:2] == (count, 2):
            flat = np.reshape(colors, (-1, np.shape(colors)[2]))
            return look.as_colors(flat, 2 * count).reshape(-1, 2, 3)
        return super()._as_colors(colors, count)
