"""``mesh.ibr``: what a mesh can become."""

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
        """Return the mesh as images from all around, with their error.

        Parameters
        ----------
        **kwargs
            See :func:`pvibr.actors.bake.bake`.

        Returns
        -------
        pvibr.Atlas
            It can be saved, loaded and looked at.
        """
        from pvibr.actors.bake import bake

        return bake(self._mesh, **kwargs)
