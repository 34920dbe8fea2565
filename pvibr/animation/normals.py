"""Normals of the points of a mesh, of which none is split."""

from __future__ import annotations

import numpy as np
import pyvista as pv


def point_normals(mesh):
    """Return the normals of a mesh's points, without changing their number.

    Parameters
    ----------
    mesh : pyvista.PolyData
        The mesh.

    Returns
    -------
    numpy.ndarray, shape (v, 3)
        Its active normals; else those that its polygons have on average, zero where none is.

    Examples
    --------
    >>> import pyvista as pv
    >>> from pvibr.animation.normals import point_normals
    >>> point_normals(pv.Plane()).max(0).tolist()
    [0.0, 0.0, 1.0]
    """
    normals = mesh.point_data.active_normals
    if normals is not None:
        return normals
    if not mesh.GetNumberOfPolys() and not mesh.n_strips:
        return np.zeros((mesh.n_points, 3))
    computed = mesh.compute_normals(
        cell_normals=False, split_vertices=False, consistent_normals=False
    )
    return computed.point_data['Normals']


def normals_at(mesh, points):
    """Return the normals that a mesh's polygons give its points elsewhere.

    Parameters
    ----------
    mesh : pyvista.PolyData
        The mesh.
    points : array_like, shape (v, 3)
        Where its points are.

    Returns
    -------
    numpy.ndarray, shape (v, 3)
        Unit normals; zero where no polygon is.

    Examples
    --------
    >>> import pyvista as pv
    >>> from pvibr.animation.normals import normals_at
    >>> plane = pv.Plane()
    >>> normals_at(plane, plane.points[:, [1, 2, 0]])[0].tolist()
    [0.0, 1.0, 0.0]
    """
    shape = pv.PolyData(np.asarray(points, dtype=np.float64))
    shape.SetVerts(None)
    shape.SetPolys(mesh.GetPolys())
    shape.SetStrips(mesh.GetStrips())
    return point_normals(shape)
