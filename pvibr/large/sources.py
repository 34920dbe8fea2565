"""Meshes and files as triangles, with the arrays of their points."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import pyvista as pv

from pvibr.core.files import naming_file
from pvibr.large.build import TriangleMesh
from pvibr.large.given_mesh import given_mesh
from pvibr.large.joined_meshes import is_triangles
from pvibr.large.material_atlas import COLORS
from pvibr.large.original_cells import edge_flags
from pvibr.meshes.surfaces import check_points, polygons_of, surface_of

#: Names of arrays that follow cells of a mesh, and polygons of its surface, to triangles.
_CELL, _POLYGON = 'pvibr_mesh_cell', 'pvibr_polygon'
NO_COORDINATES = (
    'texture must be with texture coordinates, which the mesh does not have; '
    'see mesh.texture_map_to_plane()'
)


@dataclass
class Source:
    """The triangles of a mesh, and what may colour them."""

    #: The triangles; None where a file holds their hierarchy.
    mesh: TriangleMesh | None
    #: Arrays of the points of `mesh` by name.
    arrays: dict[str, Any] = field(default_factory=dict)
    #: Name of the array that is active, or None.
    active: str | None = None
    #: Arrays of the cells of the user's mesh by name, and the number of its cells.
    cell_arrays: dict[str, Any] = field(default_factory=dict)
    cell_count: int = 0
    #: Number of the points of the user's mesh, and which of these are those of `mesh`; None for
    #: all.
    point_count: int = 0
    points: np.ndarray | None = None
    #: Image of its materials, (h, w, 3 or 4) uint8, or None.
    image: np.ndarray | None = None

    def look(self) -> dict[str, Any]:
        """Return the keywords of `add_mesh` that show its image."""
        if self.image is None:
            return {}
        texture = pv.Texture(np.ascontiguousarray(self.image))
        texture.interpolate = texture.mipmap = True
        colors = {'scalars': self.active} if self.active == COLORS else {}
        return colors | {'texture': texture}

    @property
    def triangle_count(self) -> int:
        """Number of triangles, 0 where a file holds their hierarchy."""
        return 0 if self.mesh is None else len(self.mesh.faces)


def checked_texture(source, has_texture) -> Source:
    """Return a source with texture coordinates if there is a texture, and without if not."""
    if not has_texture:
        return replace(source, mesh=replace(source.mesh, texture_coordinates=None))
    if source.mesh.texture_coordinates is None:
        raise ValueError(NO_COORDINATES)
    return source


def source_of(mesh) -> Source:
    """Return the triangles of a mesh, or of a file of one."""
    with naming_file(mesh):
        return _source_of(*given_mesh(mesh, {}))


def _source_of(mesh, look) -> Source:
    check_points(mesh)
    texture = look.get('texture')
    image = None if texture is None else np.asarray(texture.to_array())
    if is_triangles(mesh):
        faces = mesh.regular_faces
        source = _source(mesh, mesh, faces, np.arange(len(faces)), None)
        return replace(source, image=image)
    tagged = mesh.copy(deep=False)
    tagged.cell_data[_CELL] = np.arange(mesh.n_cells)
    tagged.point_data[_CELL] = np.arange(mesh.n_points)
    polygons = polygons_of(surface_of(tagged))
    polygons.cell_data[_POLYGON] = np.arange(polygons.n_cells)
    surface = polygons.triangulate()
    if not surface.n_cells:
        raise ValueError('mesh must have triangles, got none')
    points, mesh_cells = (np.asarray(d[_CELL]) for d in (surface.point_data, surface.cell_data))
    flags = edge_flags(surface.regular_faces, np.asarray(surface.cell_data[_POLYGON]))
    return _source(mesh, surface, surface.regular_faces, mesh_cells, points, flags)


def _source(mesh, surface, faces, mesh_cells, points, flags=None) -> Source:
    names = [name for name in surface.point_data if name != _CELL]
    info = mesh.active_scalars_info
    is_shown = info.name is not None and info.association.name in ('POINT', 'CELL')
    active = info.name if is_shown else None
    normals = surface.point_data.active_normals
    coordinates = surface.point_data.active_texture_coordinates
    triangles = TriangleMesh(
        np.asarray(surface.points),
        np.asarray(faces),
        mesh_cells,
        None if normals is None else np.asarray(normals),
        None if coordinates is None else np.asarray(coordinates)[:, :2],
        flags,
    )
    arrays = {name: np.asarray(surface.point_data[name]) for name in names}
    cell_arrays = {name: np.asarray(mesh.cell_data[name]) for name in mesh.cell_data}
    counts = mesh.n_cells, mesh.n_points
    return Source(triangles, arrays, active, cell_arrays, *counts, points)
