"""The mesh of a cut, gathered anew only when another one is drawn."""

from __future__ import annotations

import operator

import numpy as np

from pvibr.core import _vtk
from pvibr.large.corners import Corners
from pvibr.large.cut import gathered, gathered_coordinates


class CutMesh:
    """Patches as one mesh of VTK, whose bounds are always those of the full mesh."""

    def __init__(self):
        self.data = _vtk.vtkPolyData()
        self._points = _vtk.vtkPoints()
        self.data.SetPoints(self._points)
        self.patches = np.zeros(0, int)
        self._key: tuple = ()
        self._shown: tuple = ()
        #: Triangles of the patches.
        self.n_triangles = 0

    @property
    def nbytes(self) -> int:
        """GPU memory of its buffers, about: positions, normals, colours and indices."""
        return 28 * self._points.GetNumberOfPoints() + 12 * self.n_triangles

    def show(self, hierarchy, patches, values, *, has_normals, has_texture=False):
        """Let the mesh be of some patches, with values of vertices as its scalars."""
        key, shown = (has_normals, has_texture, patches.tobytes()), (hierarchy, values)
        if key == self._key and all(map(operator.is_, shown, self._shown)):
            return
        self._key, self._shown, self.patches = key, shown, patches
        vertices, triangles = gathered(hierarchy, patches)
        coordinates = gathered_coordinates(hierarchy, patches) if has_texture else None
        self.n_triangles = len(triangles)
        corners = None
        if values is not None and values.by_triangle is not None:
            corners = Corners.of(hierarchy, patches, triangles, len(vertices))
            vertices, triangles = vertices[corners.places], corners.triangles
            coordinates = coordinates if coordinates is None else coordinates[corners.places]
        self._set_triangles(hierarchy, vertices, triangles)
        point_data = self.data.GetPointData()
        normals = hierarchy.normals[vertices] if has_normals else None
        point_data.SetNormals(_array('Normals', normals))
        point_data.SetTCoords(_array('Texture Coordinates', coordinates))
        scalars = None if values is None else values.by_vertex[vertices]
        if corners is not None:
            corners.set_values(scalars, values.by_triangle)
        point_data.SetScalars(_array('' if values is None else values.name, scalars))
        self.data.Modified()

    def _set_triangles(self, hierarchy, vertices, triangles):
        points = np.empty((len(vertices) + 2, 3))
        np.add(hierarchy.points[vertices], hierarchy.origin, out=points[:-2])
        # Two corners hold the bounds, by which VTK also places what it uploads; they draw nothing.
        points[-2:] = hierarchy.bounds
        ends = np.repeat(np.array([[0], [1]], np.int32) + len(vertices), 3, axis=1)
        triangles = np.concatenate([triangles, ends])
        self._points.SetData(_vtk.numpy_to_vtk(points))
        offsets = np.arange(0, 3 * len(triangles) + 1, 3, dtype=np.int32)
        cells = _vtk.vtkCellArray()
        cells.SetData(_vtk.numpy_to_vtk(offsets), _vtk.numpy_to_vtk(triangles.ravel()))
        self.data.SetPolys(cells)


def _array(name, values):
    """Return an array of VTK of values of vertices, and of the two that hold the bounds."""
    if values is None:
        return None
    last = values[:1] if len(values) else np.zeros((1, *values.shape[1:]), values.dtype)
    array = _vtk.numpy_to_vtk(np.concatenate([values, last, last]))
    array.SetName(name)
    return array
