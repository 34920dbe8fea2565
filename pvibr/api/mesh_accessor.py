"""``mesh.ibr``: conversions of a mesh to images, and glyphs of its arrays."""

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
        from pvibr.substitutes.billboard_cloud import billboard_cloud

        return billboard_cloud(self._mesh, **kwargs)

    def large(self, path, *, progress=None, workers=None, memory=None):
        """Build the hierarchy of a large mesh, and write it to a file with its point arrays.

        Parameters
        ----------
        path : str or Path
            The file, ``.pvl``; :class:`pvibr.LargeMesh` draws it.
        progress : bool, optional
            Show a progress bar; by default in terminals and notebooks.
        workers : int, optional
            Number of processes; by default one per core.
        memory : float, optional
            Memory of the build beyond the mesh's own, GB, at least 0.5; by default 2. Everything
            else is kept in a folder beside the file until it is complete: a call that was stopped
            goes on from there.

        Returns
        -------
        pathlib.Path
            The file, which is replaced once the new one is complete. A file of the same mesh is
            left as it is.

        Raises
        ------
        OSError
            If the file cannot be written; the old one is unchanged.
        ValueError
            If the path does not end in ``.pvl``, or the mesh has no triangles.

        Examples
        --------
        >>> import tempfile
        >>> import pyvista as pv
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     path = pv.Sphere().ibr.large(f'{folder}/ball.pvl')
        ...     pl = pv.Plotter(off_screen=True)
        ...     ball = pl.ibr.add_large_mesh(path)
        ...     pl.close()
        >>> path.name
        'ball.pvl'
        """
        from pvibr.large.build_file import write_large

        return write_large(self._mesh, path, progress, workers, memory)

    def glyph(
        self,
        orient=True,
        scale=True,
        factor=1.0,
        geom=None,
        indices=None,
        tolerance=None,
        absolute=False,
        clamping=False,
        rng=None,
        color_mode='scale',
        progress_bar=False,
    ):
        """Return what :meth:`pyvista.DataSetFilters.glyph` would return, for ``add_instances``.

        Parameters
        ----------
        orient : bool or str
            Vectors toward which x turns; True: the active ones.
        scale : bool or str
            Scalars, or vectors of these lengths, that scale; True: the active ones.
        factor : float
            Factor of all sizes.
        geom : mesh or sequence of meshes, optional
            Any meshes that ``add_instances`` takes; an arrow by default.
        indices : sequence of int, optional
            Position of each mesh in the table, from 0.
        tolerance : float, optional
            Distance within which points are merged, a fraction of the bounding box's diagonal.
        absolute : bool
            Whether `tolerance` is in world units.
        clamping : bool
            Map sizes from `rng` to [0, 1].
        rng : sequence of float, shape (2,), optional
            Range of the scalars; 0 to 1 by default.
        color_mode : {'scale', 'scalar', 'vector'}
            Colour by the size, the scalars, or the length of the vectors.
        progress_bar : bool
            Accepted for compatibility; only False is allowed.

        Returns
        -------
        Glyphs
            The first argument of ``plotter.ibr.add_instances``: meshes, poses, and scalars named
            as those of ``glyph``.

        Raises
        ------
        TypeError, ValueError
            If an argument is invalid, or an array does not exist.

        Warns
        -----
        PvibrWarning
            If `orient` or `scale` is True and there is no array, or several.

        Notes
        -----
        If `scale` names vectors and others are active, their lengths count, as in ``glyph``.

        Examples
        --------
        >>> import pyvista as pv
        >>> points = pv.PolyData([[0.0, 0, 0], [2, 0, 0]])
        >>> points['wind'] = [[0.0, 0, 1], [1, 1, 0]]
        >>> pl = pv.Plotter(off_screen=True)
        >>> arrows = pl.ibr.add_instances(points.ibr.glyph(orient='wind', scale=False))
        >>> arrows.n_instances
        2
        >>> pl.close()
        """
        if not isinstance(self._mesh, pv.DataSet):
            raise TypeError('glyph needs a dataset with points; combine() the blocks first')
        from pvibr.meshes.glyphs import glyph

        return glyph(
            self._mesh,
            orient,
            scale,
            factor,
            geom,
            indices,
            tolerance,
            absolute,
            clamping,
            rng,
            color_mode,
            progress_bar,
        )
