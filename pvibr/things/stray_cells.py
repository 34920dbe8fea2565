"""Cells that lie on the edges of polygons, such as the lines that `clean()` makes of slivers."""

from __future__ import annotations

import numpy as np

from pvibr.core import _vtk


def has_strays_only(data) -> bool:
    """Return True if the points and lines of polydata are corners and edges of its polygons."""
    polygons, lines = data.GetPolys(), data.GetLines()
    if not data.GetNumberOfPolys() or data.GetNumberOfStrips():
        return False
    count = data.GetNumberOfPoints()
    corners = _vtk.vtk_to_numpy(polygons.GetConnectivityArray())
    points = _vtk.vtk_to_numpy(data.GetVerts().GetConnectivityArray())
    edges = _sorted_edges(polygons, count, closed=True)
    return bool(
        np.isin(points, corners).all() and np.isin(_sorted_edges(lines, count), edges).all()
    )


def _sorted_edges(cells, count, *, closed=False):
    """Return a number for each edge of some cells, which has no direction."""
    corners = _vtk.vtk_to_numpy(cells.GetConnectivityArray()).astype(np.int64)
    ends = _vtk.vtk_to_numpy(cells.GetOffsetsArray())
    other = np.roll(corners, -1)
    last = ends[1:][np.diff(ends) > 0] - 1
    if closed:
        other[last] = corners[ends[:-1][np.diff(ends) > 0]]
    else:
        corners, other = np.delete(corners, last), np.delete(other, last)
    return np.minimum(corners, other) * count + np.maximum(corners, other)


def without_strays(data):
    """Return polydata without its points and lines; itself if it has none."""
    first = data.GetNumberOfVerts() + data.GetNumberOfLines() if data.IsA('vtkPolyData') else 0
    if not first:
        return data
    found = _vtk.vtkPolyData()
    found.ShallowCopy(data)
    found.SetVerts(_vtk.vtkCellArray())
    found.SetLines(_vtk.vtkCellArray())
    # Values of cells are in the order of points, lines and polygons.
    values, kept = data.GetCellData(), _vtk.vtkCellData()
    kept.CopyAllOn()
    kept.CopyAllocate(values)
    kept.CopyData(values, 0, data.GetNumberOfCells() - first, first)
    found.GetCellData().ShallowCopy(kept)
    return found
