"""Smooth shading of flat-shaded meshes, for lighter ones of facets too small to see."""

from __future__ import annotations

import numpy as np
import pyvista as pv

from pvibr.meshes.decimate import Welded, is_foliage, take_arrays
from pvibr.meshes.parts import Part

_FLAT, _GOURAUD = 0, 1  # VTK's
_CREASE = 30.0  # degrees between facets that stay apart
_BENT = 0.9999  # cosine between a normal and its facet's, about a degree
_SOME = 0.01  # of the corners
_NORMALS = 'pvibr_normals'


def smoothed(part) -> Part | None:
    """Return a flat-shaded part with the means of its facets' normals, but at creases.

    None if it is not flat-shaded, or no surface that bends elsewhere.
    """
    shading = part.actor.GetProperty().GetInterpolation()
    flat = shading == _FLAT or part.mesh.point_data.active_normals is None
    if not flat or part.alpha_cutoff is not None:
        return None
    welded = Welded.of(part.mesh)
    normals = _normals(welded)
    bent = (normals * welded.facets[:, None]).sum(2) < _BENT
    if bent.mean() < _SOME or is_foliage(welded):
        return None
    ids = welded.corners.ravel()
    faces: np.ndarray = np.arange(len(ids)).reshape(-1, 3)
    mesh = pv.PolyData.from_regular_faces(np.asarray(part.mesh.points)[ids], faces)
    mesh.point_data[_NORMALS] = normals.reshape(-1, 3).astype(np.float32)
    take_arrays(part.mesh, mesh, ids, welded.cells)
    mesh.point_data.active_normals_name = _NORMALS
    return part.with_mesh(mesh, max(shading, _GOURAUD))


def _normals(welded):
    """Return the normals at the corners of triangles, shape (m, 3, 3)."""
    mesh = pv.PolyData.from_regular_faces(welded.points, welded.faces).compute_normals(
        cell_normals=False,
        split_vertices=True,
        feature_angle=_CREASE,
        consistent_normals=False,
        auto_orient_normals=False,
        non_manifold_traversal=False,
    )
    return np.asarray(mesh.point_data.active_normals, float)[np.asarray(mesh.regular_faces)]
