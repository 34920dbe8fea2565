"""The mesh of a cut, gathered anew only when another one is drawn."""

from __future__ import annotations

import operator
from dataclasses import dataclass

import numpy as np

from pvibr.core import _vtk
from pvibr.large.corners import Corners
from pvibr.large.cut import gathered, gathered_coordinates
from pvibr.large.vertex_values import Values

_EDGE_FLAGS = _vtk.vtkDataSetAttributes.EDGEFLAG


@dataclass(frozen=True, eq=False)
class CutLook:
    """What the vertices of patches have beside positions."""

    values: Values | None = None
    has_normals: bool = False
    has_texture: bool = False
    #: Patches of the full mesh whose edges are drawn; None where no edges are.
    edges: np.ndarray | None = None

    @property
    def has_corners(self) -> bool:
        """Whether triangles of the full mesh have corners of their own."""
        has_cell_values = self.values is not None and self.values.by_triangle is not None
        return has_cell_values or self.edges is not None

    @property
    def key(self) -> tuple:
        """All but the values, to be compared."""
        edges = None if self.edges is None else self.edges.tobytes()
        return self.has_normals, self.has_texture, edges


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

    def show(self, hierarchy, patches, look):
        """Let the mesh be of some patches, with the look of their vertices."""
        key, shown = (patches.tobytes(), *look.key), (hierarchy, look.values)
        if key == self._key and all(map(operator.is_, shown, self._shown)):
            return
        self._key, self._shown, self.patches = key, shown, patches
        vertices, triangles = gathered(hierarchy, patches)
        coordinates = gathered_coordinates(hierarchy, patches) if look.has_texture else None
        self.n_triangles = len(triangles)
        corners = None
        if look.has_corners:
            corners = Corners.of(hierarchy, patches, triangles, len(vertices))
            vertices, triangles = vertices[corners.places], corners.triangles
            coordinates = coordinates if coordinates is None else coordinates[corners.places]
        # VTK reads no flags of edges beside indices of 32 bits.
        kind = np.int32 if look.edges is None else np.int64
        self._set_triangles(hierarchy, vertices, triangles.astype(kind, copy=False))
        point_data = self.data.GetPointData()
        normals = hierarchy.normals[vertices] if look.has_normals else None
        point_data.SetNormals(_array('Normals', normals))
        point_data.SetTCoords(_array('Texture Coordinates', coordinates))
        self._set_scalars(vertices, look.values, corners)
        flags = None
        if corners is not None and look.edges is not None:
            flags = corners.edge_flags(hierarchy, look.edges, len(vertices))
        point_data.SetAttribute(_array('vtkEdgeFlags', flags), _EDGE_FLAGS)
        self.data.Modified()

    def _set_scalars(self, vertices, values, corners):
        if values is None:
            self.data.GetPointData().SetScalars(None)
            return
        scalars = values.by_vertex[vertices]
        if corners is not None and values.by_triangle is not None:
            corners.set_values(scalars, values.by_triangle)
        self.data.GetPointData().SetScalars(_array(values.name, scalars))

    def _set_triangles(self, hierarchy, vertices, triangles):
        points = np.empty((len(vertices) + 2, 3))
        np.add(hierarchy.points[vertices], hierarchy.origin, out=points[:-2])
        # Two corners hold the bounds, by which VTK also places what it uploads; they draw nothing.
        points[-2:] = hierarchy.bounds
        ends = np.repeat(np.array([[0], [1]], triangles.dtype) + len(vertices), 3, axis=1)
        triangles = np.concatenate([triangles, ends])
        self._points.SetData(_vtk.numpy_to_vtk(points))
        offsets = np.arange(0, 3 * len(triangles) + 1, 3, dtype=triangles.dtype)
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
