"""``mesh.ibr``: conversions of a mesh to images."""

from __future__ import annotations

import pyvista as pv


@pv.register_dataset_accessor('ibr', pv.MultiBlock)
@pv.register_dataset_accessor('ibr', pv.DataSet)
class IBRAccessor:
    """Image-based rendering of a mesh.

    Parameters
    ----------
    mesh : pyvista.DataSet or pyvista.MultiBlock
        The mesh.

    Examples
    --------
    >>> import pyvista as pv
    >>> callable(pv.Sphere().ibr.bake)
    True
    """

    def __init__(self, mesh):
        self._mesh = mesh

    def bake(self, **kwargs):
        """Bake images of the mesh from all directions, and measure their error.

        Parameters
        ----------
        **kwargs
            See :func:`pvibr.instances.levels.bake`.

        Returns
        -------
        pvibr.Atlas
            The images; they can be saved, loaded and viewed.
        """
        from pvibr.instances.levels import bake

        return bake(self._mesh, **kwargs)

    def billboard_cloud(self, **kwargs):
        """Return the mesh as a few textured rectangles, within an error bound.

        Parameters
        ----------
        **kwargs
            See ``billboard_cloud``: ``epsilon`` is the bound, a fraction of the bounding box's
            diagonal, ``planes`` a number of planes instead, ``patches`` triangles between planes.

        Returns
        -------
        pvibr.BillboardCloud
            A textured mesh for any viewer, and its error.
        """
        from pvibr.billboard_clouds.cloud import billboard_cloud

        return billboard_cloud(self._mesh, **kwargs)
