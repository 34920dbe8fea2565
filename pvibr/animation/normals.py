"""Point normals of a mesh whose points must not be split, and its winding."""

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


def with_flipped_winding(mesh):
    """Return a surface with reversed winding that shares everything else."""
    if mesh.n_verts or mesh.n_lines or mesh.n_strips or not mesh.is_all_triangles:
        return mesh.flip_faces()
    flipped_mesh = mesh.copy(deep=False)
    flipped_mesh.regular_faces = np.ascontiguousarray(mesh.regular_faces[:, ::-1])
    return flipped_mesh


def normals_at(mesh, points):
    """Return the point normals of a mesh's polygons with its points moved."""
    moved_mesh = pv.PolyData(np.asarray(points, dtype=np.float64))
    moved_mesh.SetVerts(None)
    moved_mesh.SetPolys(mesh.GetPolys())
    moved_mesh.SetStrips(mesh.GetStrips())
    return point_normals(moved_mesh)
