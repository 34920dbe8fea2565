"""Meshes and files as triangles, with the arrays of their points."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pyvista as pv

from pvibr.io.trimesh_meshes import as_dataset, is_trimesh
from pvibr.large.build import TriangleMesh
from pvibr.meshes.mesh_files import has_graph, read_mesh
from pvibr.meshes.surfaces import check_points, polygons_of, surface_of

#: Name of the array that follows cells of a mesh to its triangles.
_CELL = 'pvibr_mesh_cell'
_SCENE = 'mesh must be one mesh, got a scene: pass one of its meshes, or merge them first'


@dataclass
class Source:
    """The triangles of a mesh, and what may colour them."""

    #: The triangles; None where a file holds their hierarchy.
    mesh: TriangleMesh | None
    #: Arrays of the points of `mesh` by name.
    arrays: dict[str, np.ndarray] = field(default_factory=dict)
    #: Name of the array that is active, or None.
    active: str | None = None
    #: Arrays of the cells of the user's mesh by name, and the number of its cells.
    cell_arrays: dict[str, np.ndarray] = field(default_factory=dict)
    cell_count: int = 0
    #: Number of the points of the user's mesh, and which of these are those of `mesh`; None for
    #: all.
    point_count: int = 0
    points: np.ndarray | None = None

    @property
    def triangle_count(self) -> int:
        """Number of triangles, 0 where a file holds their hierarchy."""
        return 0 if self.mesh is None else len(self.mesh.faces)


def source_of(mesh) -> Source:
    """Return the triangles of a mesh, or of a file of one."""
    if has_graph(mesh):
        raise TypeError(_SCENE)
    if isinstance(mesh, str | Path):
        mesh = read_mesh(mesh)
    if is_trimesh(mesh, 'Trimesh'):
        mesh = as_dataset(mesh, None, None)
    if isinstance(mesh, pv.MultiBlock):
        raise TypeError(_SCENE + ', as mesh.combine()')
    if not isinstance(mesh, pv.DataSet):
        raise TypeError(
            f'mesh must be a PyVista dataset, a trimesh mesh or a path, got {type(mesh).__name__}'
        )
    check_points(mesh)
    if isinstance(mesh, pv.PolyData) and mesh.is_all_triangles and not _has_strokes(mesh):
        faces = mesh.regular_faces
        return _source(mesh, mesh, faces, np.arange(len(faces)), None)
    tagged = mesh.copy(deep=False)
    tagged.cell_data[_CELL] = np.arange(mesh.n_cells)
    tagged.point_data[_CELL] = np.arange(mesh.n_points)
    surface = polygons_of(surface_of(tagged)).triangulate()
    if not surface.n_cells:
        raise ValueError('mesh must have triangles, got none')
    points, mesh_cells = (np.asarray(d[_CELL]) for d in (surface.point_data, surface.cell_data))
    return _source(mesh, surface, surface.regular_faces, mesh_cells, points)


def _has_strokes(mesh) -> bool:
    return bool(mesh.n_verts + mesh.n_lines + mesh.n_strips)


def _source(mesh, surface, faces, mesh_cells, points) -> Source:
    names = [name for name in surface.point_data if name != _CELL]
    info = mesh.active_scalars_info
    is_shown = info.name is not None and info.association.name in ('POINT', 'CELL')
    active = info.name if is_shown else None
    normals = surface.point_data.active_normals
    triangles = TriangleMesh(
        np.asarray(surface.points),
        np.asarray(faces),
        mesh_cells,
        None if normals is None else np.asarray(normals),
    )
    arrays = {name: np.asarray(surface.point_data[name]) for name in names}
    cell_arrays = {name: np.asarray(mesh.cell_data[name]) for name in mesh.cell_data}
    counts = mesh.n_cells, mesh.n_points
    return Source(triangles, arrays, active, cell_arrays, *counts, points)
