"""The mesh of a cut, gathered anew only when another one is drawn."""

from __future__ import annotations

import operator
from dataclasses import dataclass

import numpy as np

from pvibr.core import _vtk
from pvibr.large.patch_arrays import PatchArrays
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


class CutMesh:
    """Patches as one mesh of VTK, whose bounds are always those of the full mesh."""

    def __init__(self):
        self.data = _vtk.vtkPolyData()
        self._points = _vtk.vtkPoints()
        self.data.SetPoints(self._points)
        self.patches = np.zeros(0, int)
        self._key: tuple = ()
        self._source: tuple = ()
        self._arrays: PatchArrays | None = None
        #: Triangles of the patches.
        self.n_triangles = 0

    @property
    def nbytes(self) -> int:
        """GPU memory of its buffers, about: positions, normals, colours and indices."""
        return 28 * self._points.GetNumberOfPoints() + 12 * self.n_triangles

    def show(self, hierarchy, patches, look):
        """Let the mesh be of some patches, with the look of their vertices."""
        source = hierarchy, look.values, look.has_normals, look.has_texture, look.has_corners
        is_same = len(self._source) and all(map(operator.is_, source, self._source))
        edges = None if look.edges is None else look.edges.tobytes()
        key = patches.tobytes(), edges
        if key == self._key and is_same:
            return
        self._key, self._source, self.patches = key, source, patches
        if self._arrays is None or not is_same:
            self._arrays = PatchArrays.looked_up(hierarchy, look)
        self._arrays = arrays = self._arrays.moved_to(hierarchy, look, patches.tolist())
        self.n_triangles = len(arrays.triangles)
        self._set_triangles(hierarchy, arrays, look)
        columns, point_data = arrays.columns, self.data.GetPointData()
        point_data.SetNormals(_array('Normals', columns.get('normals')))
        point_data.SetTCoords(_array('Texture Coordinates', columns.get('coordinates')))
        name = '' if look.values is None else look.values.name
        point_data.SetScalars(_array(name, columns.get('scalars')))
        flags = None if look.edges is None else arrays.edge_flags(hierarchy, look.edges)
        point_data.SetAttribute(_array('vtkEdgeFlags', flags), _EDGE_FLAGS)
        self.data.Modified()

    def _set_triangles(self, hierarchy, arrays, look):
        points = arrays.columns['points']
        # Two corners hold the bounds, by which VTK also places what it uploads; they draw nothing.
        ends = np.array(hierarchy.bounds, points.dtype)
        self._points.SetData(_vtk.numpy_to_vtk(np.concatenate([points, ends])))
        # VTK reads no flags of edges beside indices of 32 bits.
        kind = np.int32 if look.edges is None else np.int64
        ends = np.repeat([[len(points)], [len(points) + 1]], 3, axis=1)
        triangles = np.concatenate([arrays.triangles, ends], dtype=kind)
        offsets = np.arange(0, 3 * len(triangles) + 1, 3, dtype=kind)
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
