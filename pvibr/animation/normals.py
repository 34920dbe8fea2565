"""Point normals of a mesh whose points must not be split."""

from __future__ import annotations

import numpy as np
import pyvista as pv


def point_normals(mesh):
    """Return the normals of a mesh's points, without changing their number."""
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
    """Return the point normals of a mesh's polygons with its points moved."""
    shape = pv.PolyData(np.asarray(points, dtype=np.float64))
    shape.SetVerts(None)
    shape.SetPolys(mesh.GetPolys())
    shape.SetStrips(mesh.GetStrips())
    return point_normals(shape)
