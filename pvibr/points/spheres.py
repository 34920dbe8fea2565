"""Spheres by the million, ray-cast per pixel, without triangles."""

from __future__ import annotations

from pvibr.core.signatures import takes
from pvibr.points.point_arguments import as_points, lengths_of
from pvibr.points.quadric_geometry import EllipsoidGeometry, SphereGeometry
from pvibr.points.quadrics import Quadrics
from pvibr.points.replaced_items import item_property
from pvibr.things.placing import is_similar, lengths_in, points_in


class Spheres(Quadrics):
    """Spheres by the million, ray-cast per pixel, without triangles.

    Parameters
    ----------
    points : array_like, shape (n, 3), dataset or table
        Centres, world units.
    radius : float or array_like, shape (n,)
        World units; radius 0 is not drawn.
    nan : {'raise', 'hide'}
        Refuse items with NaN among their positions and sizes, or hide them. NaN scalars have
        ``nan_color`` and ``nan_opacity``.
    **looks
        ``color``, ``colors``, ``scalars``, ``visible``, ``opacity``, ``lighting``, ``ambient``,
        ``diffuse``, ``specular``, ``specular_power``, ``pbr``, ``metallic``, ``roughness``,
        ``pickable``, ``name``, ``theme``, ``cmap``, ``clim``, ``n_colors``, ``nan_color``,
        ``nan_opacity``, ``below_color``, ``above_color``, ``log_scale``, ``flip_scalars``,
        ``categories`` and ``annotations``, as in ``add_mesh``, but colours, scalars, visibility
        and opacity per item; the alpha of colours multiplies the opacity.

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

    points = item_property('points', 'Centres, shape (n, 3), in its own space.')
    radius = item_property('radius', 'Radius of each, shape (n,), in its own space.')

    @takes(looks=Quadrics)
    def __init__(self, points, radius=0.5, **looks):
        super().__init__({'points': points, 'radius': radius}, **looks)

    def _arranged_from(self, given, nan_rows) -> dict:
        points = as_points('points', given['points'], nan_rows)
        radii = lengths_of('radius', given['radius'], (len(points),), nan_rows)
        return {'points': points, 'radius': radii}

    def _geometry_in(self, world):
        points, radii = self._arranged.values()
        centers = points_in(world, points)
        if world is None or is_similar(world[:3, :3]):
            return SphereGeometry(centers, lengths_in(world, radii))
        return EllipsoidGeometry.of_stretched(centers, radii, world[:3, :3])
