"""Lines and points on the edges of polygons, which `clean()` makes of sliver triangles."""

from __future__ import annotations

import numpy as np

from pvibr.core import _vtk


def has_strays_only(data) -> bool:
    """Return True if all lines and points of polydata lie on edges of its polygons."""
    polygons, lines = data.GetPolys(), data.GetLines()
    if not data.GetNumberOfPolys() or data.GetNumberOfStrips():
        return False
    point_count = data.GetNumberOfPoints()
    corners = _vtk.vtk_to_numpy(polygons.GetConnectivityArray())
    loose_points = _vtk.vtk_to_numpy(data.GetVerts().GetConnectivityArray())
    polygon_edges = _sorted_edges(polygons, point_count, closed=True)
    line_edges = _sorted_edges(lines, point_count)
    on_corners, on_edges = np.isin(loose_points, corners), np.isin(line_edges, polygon_edges)
    return bool(on_corners.all() and on_edges.all())


def _sorted_edges(cells, count, *, closed=False):
    """Return a number for each undirected edge of cells."""
    corners = _vtk.vtk_to_numpy(cells.GetConnectivityArray()).astype(np.int64)
    ends = _vtk.vtk_to_numpy(cells.GetOffsetsArray())
    next_corners = np.roll(corners, -1)
    cell_ends = ends[1:][np.diff(ends) > 0] - 1
    if closed:
        next_corners[cell_ends] = corners[ends[:-1][np.diff(ends) > 0]]
    else:
        corners, next_corners = np.delete(corners, cell_ends), np.delete(next_corners, cell_ends)
    return np.minimum(corners, next_corners) * count + np.maximum(corners, next_corners)
