"""Cylinders and capsules by the million, ray-cast per pixel, without triangles."""

from __future__ import annotations

import numpy as np

from pvibr.core.arguments import check_one_of, naming
from pvibr.core.params import checked_flag
from pvibr.core.signatures import takes
from pvibr.points.billboard_cards import as_points
from pvibr.points.quadric_cards import Shape, residual_texels
from pvibr.points.quadric_rays import CAPS, meet_cylinders
from pvibr.points.quadrics import Quadrics, lengths_of, with_scalars
from pvibr.points.unit_meshes import along, balls, linear, tubes
from pvibr.things import appearance as look
from pvibr.things.appearance import read_only


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

    caps: str | None
    blend: bool

    @takes(looks=Quadrics)
    def __init__(self, points_a, points_b, radius=0.5, *, caps='flat', blend=False, **looks):
        self._own_ends = as_points(points_a, 'points_a'), as_points(points_b, 'points_b')
        if len(self._own_ends[1]) != len(self):
            raise ValueError(
                f'points_b must have {len(self)} rows, as points_a, got {len(self._own_ends[1])}'
            )
        check_one_of('caps', caps, CAPS)
        self._own_radii = lengths_of('radius', radius, (len(self),))
        self._place()
        self.caps, self.blend = caps, bool(checked_flag('blend', blend))
        cap = {None: 0, 'flat': 1, 'round': 2}[caps]
        self.shape = Shape(
            'cylinders',
            texels=2,
            looks=2,
            largest_point=12.0,
            fill=0.4,
            open=caps is None,
            defines=(('CAPS', cap), ('BLEND', int(self.blend))),
        )
        super().__init__(**with_scalars(points_a, looks))

    def __len__(self):
        return len(self._own_ends[0])

    @property
    def points_a(self) -> np.ndarray:
        """First ends, shape (n, 3), in its own space."""
        return read_only(self._own_ends[0])

    @points_a.setter
    def points_a(self, points):
        self._own_ends = self._checked_points('points_a', points), self._own_ends[1]
        self._moved()

    @property
    def points_b(self) -> np.ndarray:
        """Second ends, shape (n, 3), in its own space."""
        return read_only(self._own_ends[1])

    @points_b.setter
    def points_b(self, points):
        self._own_ends = self._own_ends[0], self._checked_points('points_b', points)
        self._moved()

    @property
    def radius(self) -> np.ndarray:
        """Radius of each, shape (n,), in its own space."""
        return read_only(self._own_radii)

    @radius.setter
    def radius(self, radius):
        self._own_radii = lengths_of('radius', radius, (len(self),))
        self._moved()

    def _check_linear(self, linear):
        super()._check_linear(linear)
        self._check_similar(
            linear, 'cylinders stay round: use add_instances of a cylinder mesh for others'
        )

    def _place(self):
        first_ends, second_ends = self._own_ends
        self._ends = self._in_world(first_ends), self._in_world(second_ends)
        self._radii = self._scaled(self._own_radii)

    def _halves(self):
        """Return vectors from the centres to the second ends, half lengths, and directions."""
        halves = (self._ends[1] - self._ends[0]) / 2
        half_lengths = np.linalg.norm(halves, axis=1)
        unit_axes = np.where(half_lengths[:, None] > 0, halves, [0, 0, 1.0])
        return (
            halves,
            half_lengths,
            unit_axes / np.where(half_lengths > 0, half_lengths, 1)[:, None],
        )

    def _spheres(self):
        _, lengths, _ = self._halves()
        is_drawn = (self._radii > 0) & ((lengths > 0) | (self.caps == 'round'))
        reach = lengths + self._radii if self.caps == 'round' else np.hypot(lengths, self._radii)
        return (self._ends[0] + self._ends[1]) / 2, reach * is_drawn

    def _extents(self):
        halves, _, units = self._halves()
        disc_extents = 1.0 if self.caps == 'round' else np.sqrt(np.maximum(1 - units**2, 0))
        return np.abs(halves) + self._radii[:, None] * disc_extents

    def _rows(self, middles):
        _, lengths, units = self._halves()
        texels = [np.column_stack([middles, self._radii]), np.column_stack([units, lengths])]
        return np.stack(texels, 1)

    def _bodies(self, indices=slice(None)):
        halves, radii = self._halves()[0][indices], self._radii[indices]
        middles = self._spheres()[0][indices]
        first_colors = second_colors = item_colors = self._colored(indices)
        levels = tubes(self.prop, self.caps == 'flat')
        with np.errstate(invalid='ignore'):  # without length there is no tube
            if item_colors is None or item_colors.ndim == 2:
                bodies = [(*levels, along(middles, halves, radii), item_colors)]
            else:
                first_colors, second_colors = np.moveaxis(item_colors, 1, 0)
                bodies = [
                    (*levels, along(middles + side * halves / 2, halves / 2, radii), colors)
                    for side, colors in ((-1, first_colors), (1, second_colors))
                ]
        if self.caps == 'round':
            ball_axes = radii[:, None, None] * np.eye(3)
            for ends, colors in zip(self._ends, (first_colors, second_colors), strict=True):
                bodies.append((*balls(self.prop), linear(ends[indices], ball_axes), colors))
        return bodies

    def _residuals(self, eye, index):
        middles, (_, lengths, units) = self._spheres()[0], self._halves()
        offsets, radii = middles[index] - eye, self._radii[index]
        height = np.einsum('ni,ni->n', offsets, units[index])
        axis_distance = np.linalg.norm(offsets - height[:, None] * units[index], axis=1)
        end_heights = height[:, None] + lengths[index, None] * [-1, 1]
        residuals = (axis_distance - radii) * (axis_distance + radii)
        return residual_texels(residuals, radii**2, end_heights)

    def _meet(self, start, direction, index):
        middles, halves = self._spheres()[0][index], self._halves()[0][index]
        return meet_cylinders(start, direction, middles, halves, self._radii[index], self.caps)

    # -- looks of both ends -------------------------------------------------------------------

    def _as_scalars(self, scalars):
        with naming('scalars', scalars):
            paired = np.shape(scalars) == (len(self), 2)
        if paired:
            return look.as_scalars(np.ravel(scalars), 2 * len(self)).reshape(-1, 2)
        return super()._as_scalars(scalars)

    def _as_colors(self, colors):
        with naming('colors', colors):
            paired = np.ndim(colors) == 3
        if paired and np.shape(colors)[:2] == (len(self), 2):
            flat = np.reshape(colors, (-1, np.shape(colors)[2]))
            return look.as_colors(flat, 2 * len(self)).reshape(-1, 2, 3)
        return super()._as_colors(colors)
