"""Spheres by the million, ray-cast per pixel, without triangles."""

from __future__ import annotations

import numpy as np

from pvibr.core.signatures import takes
from pvibr.points.billboard_cards import as_points
from pvibr.points.ellipsoids import ELLIPSOIDS, AxesQuadrics, moved_axes
from pvibr.points.quadric_cards import Shape, residual_texels
from pvibr.points.quadric_rays import meet_spheres
from pvibr.points.quadrics import Quadrics, lengths_of, with_scalars
from pvibr.points.unit_meshes import balls, linear
from pvibr.things.appearance import read_only
from pvibr.things.placing import is_similar


class Spheres(AxesQuadrics):
    """Spheres by the million, ray-cast per pixel, without triangles.

    Parameters
    ----------
    points : array_like, shape (n, 3), dataset or table
        Centres, world units.
    radius : float or array_like, shape (n,)
        World units; radius 0 is not drawn.
    **looks
        ``color``, ``colors``, ``scalars``, ``visible``, ``opacity``, ``lighting``, ``ambient``,
        ``diffuse``, ``specular``, ``specular_power``, ``pbr``, ``metallic``, ``roughness``,
        ``pickable``, ``name``, ``theme``, ``cmap``, ``clim``, ``n_colors``, ``nan_color``,
        ``below_color``, ``above_color``, ``log_scale``, ``flip_scalars``, ``categories`` and
        ``annotations``, as in ``add_mesh``, but colours, scalars, visibility and opacity per item;
        the alpha of colours multiplies the opacity.

    Raises
    ------
    TypeError, ValueError
        If an argument is invalid.

    Notes
    -----
    Silhouettes, normals and depth are exact at pixel centres, in perspective too. Spheres smaller
    than a pixel are drawn one pixel large; those of up to four pixels have a single depth. They
    are depth-tested, and cast and receive shadows. Translucent ones show their front, sorted from
    far to near, and cast no shadow. The mapper's clipping planes reveal their insides.

    Examples
    --------
    >>> import pyvista as pv
    >>> import pvibr
    >>> pl = pv.Plotter(off_screen=True)
    >>> balls = pl.ibr.add(pvibr.Spheres([[0, 0, 0], [2, 0, 0]], [1.0, 0.5]))
    >>> tuple(balls.bounds)
    (-1.0, 2.5, -1.0, 1.0, -1.0, 1.0)
    >>> pl.close()
    """

    shape = Shape('spheres', texels=1)

    @takes(looks=Quadrics)
    def __init__(self, points, radius=0.5, **looks):
        self._own_points = as_points(points)
        self._own_radii = lengths_of('radius', radius, (len(self),))
        self._place()
        super().__init__(**with_scalars(points, looks))

    @property
    def radius(self) -> np.ndarray:
        """Radius of each, shape (n,), in its own space."""
        return read_only(self._own_radii)

    @radius.setter
    def radius(self, radius):
        self._own_radii = lengths_of('radius', radius, (len(self),))
        self._moved()

    def _place(self):
        super()._place()
        self._radii, self._axes = self._scaled(self._own_radii), None
        if self._world is not None and self._is_stretched:
            (axes,) = moved_axes(self._world[:3, :3], np.eye(3)[None])
            self._axes = axes * self._own_radii[:, None, None]
            self._reach = self._own_radii * np.linalg.norm(axes, axis=0).max()

    @property
    def _is_stretched(self) -> bool:
        return self._world is not None and not is_similar(self._world[:3, :3])

    def _put(self):
        self._become(ELLIPSOIDS if self._is_stretched else Spheres.shape)
        super()._put()

    # -- drawn as ellipsoids while the set is stretched ---------------------------------------

    def _spheres(self):
        if self._axes is not None:
            return super()._spheres()
        return self._points, self._radii

    def _extents(self):
        if self._axes is not None:
            return super()._extents()
        return self._radii[:, None]

    def _rows(self, middles):
        if self._axes is not None:
            return super()._rows(middles)
        return np.column_stack([middles, self._radii])[:, None]

    def _bodies(self, indices=slice(None)):
        if self._axes is not None:
            return super()._bodies(indices)
        matrices = linear(self._points[indices], self._radii[indices, None, None] * np.eye(3))
        return [(*balls(self.prop), matrices, self._colored(indices))]

    def _residuals(self, eye, index):
        if self._axes is not None:
            return super()._residuals(eye, index)
        eye_distance, radii = np.linalg.norm(self._points[index] - eye, axis=1), self._radii[index]
        return residual_texels((eye_distance - radii) * (eye_distance + radii), radii**2)

    def _meet(self, start, direction, index):
        if self._axes is not None:
            return super()._meet(start, direction, index)
        return meet_spheres(start, direction, self._points[index], self._radii[index])
