"""Surfaces of datasets, as ``add_mesh`` draws them."""

from __future__ import annotations

from contextlib import contextmanager

import numpy as np
import pyvista as pv

from pvibr.animation.normals import with_flipped_winding
from pvibr.core import _vtk
from pvibr.maths.transforms import transform_normals, transform_points


def check_points(dataset):
    """Raise if a mesh has no points, or points that are not finite."""
    if not dataset.n_points:
        raise ValueError('mesh must have points, got an empty one')
    invalid = np.flatnonzero(~np.isfinite(dataset.points).all(axis=1))
    if invalid.size:
        raise ValueError(
            f'mesh.points[{invalid[0]}] must be finite, got {dataset.points[invalid[0]].tolist()} '
            f'({invalid.size} such points); remove them or set them'
        )


def surface_of(dataset):
    """Return the polygons, lines and vertices that VTK draws of a dataset."""
    active_scalars = dataset.active_scalars_info
    if isinstance(dataset, pv.PointSet):
        dataset = dataset.cast_to_polydata(deep=False)
    if not isinstance(dataset, pv.PolyData):
        # The filter within add_mesh's mapper.
        dataset = dataset.extract_surface(
            algorithm='dataset_surface', pass_pointid=False, pass_cellid=False
        )
    set_active(dataset, active_scalars)
    return dataset


def triangles_of(surface):
    """Return the polygons of a surface as triangles, with its active arrays."""
    # VTK's triangle filter mixes up the arrays of vertices and lines.
    polygons = polygons_of(surface)
    is_triangulated = polygons.is_all_triangles and not polygons.n_strips
    triangles = polygons if is_triangulated else polygons.triangulate()
    set_active(triangles, surface.active_scalars_info)
    return triangles


def polygons_of(surface):
    """Return a surface without vertices and lines, itself if it has none."""
    first = surface.n_verts + surface.n_lines
    if not first:
        return surface
    mesh = surface.copy(deep=False)
    with _keeping_cells(mesh, np.arange(first, mesh.n_cells)):
        mesh.SetVerts(None)
        mesh.SetLines(None)
    return mesh


def some_triangles(mesh, ids):
    """Return a subset of a mesh's triangles, with all points."""
    ids, mesh = np.asarray(ids), mesh.copy(deep=False)
    with _keeping_cells(mesh, ids):
        mesh.regular_faces = np.asarray(mesh.regular_faces)[ids]
    return mesh


@contextmanager
def _keeping_cells(mesh, ids):
    """Keep the arrays of cells `ids` while the cells change."""
    cell_data, active_scalars = mesh.cell_data, mesh.active_scalars_info
    normals = cell_data.active_normals_name
    kept_arrays = {name: np.asarray(cell_data[name])[ids] for name in cell_data}
    mesh.clear_cell_data()
    yield
    for name, values in kept_arrays.items():
        cell_data.set_array(values, name)
    cell_data.active_normals_name = normals
    set_active(mesh, active_scalars)


def set_active(surface, active):
    """Activate the scalars of another dataset's `active_scalars_info`, if it has any."""
    if active.name is not None and active.association.name in ('POINT', 'CELL'):
        surface.set_active_scalars(active.name, preference=active.association.name.lower())


def moved(mesh, matrix):
    """Return a surface transformed by a matrix, which may mirror."""
    if np.array_equal(matrix, np.eye(4)):
        return mesh
    transformed = mesh.copy(deep=False)
    # A shallow copy shares its vtkPoints: the points setter would change the original.
    transformed.SetPoints(pv.vtk_points(transform_points(matrix, mesh.points)))
    for name in ('point_data', 'cell_data'):
        normals = getattr(mesh, name).active_normals
        if normals is not None:
            getattr(transformed, name).active_normals = transform_normals(matrix, normals)
    # A mirroring matrix reverses the winding.
    return with_flipped_winding(transformed) if np.linalg.det(matrix[:3, :3]) < 0 else transformed


def clipped(mesh, planes):
    """Return a surface clipped by planes, whose normals point to what remains."""
    for plane in () if planes is None else planes:
        clipper = _vtk.vtkClipPolyData()
        clipper.SetInputData(mesh)
        clipper.SetClipFunction(plane)
        clipper.Update()
        remaining = pv.wrap(clipper.GetOutput())
        if not remaining.GetNumberOfPolys() + remaining.n_strips:
            raise ValueError('mesh must not be clipped away by the planes of its mapper')
        set_active(remaining, mesh.active_scalars_info)
        mesh = remaining
    return mesh


def drop_unseen(mesh, mapper):
    """Remove the arrays that a mapper does not draw."""
    if mapper.GetArrayAccessMode() == 0 and mapper.GetScalarMode() in (3, 4):
        return  # the array is selected by index, which would change
    scalar_names = {mapper.GetArrayName()} if mapper.GetScalarVisibility() else set()
    for mode, data in ((1, mesh.point_data), (2, mesh.cell_data)):
        used_names = scalar_names | {
            data.active_normals_name,
            data.active_texture_coordinates_name,
        }
        if mapper.GetScalarVisibility() and mapper.GetScalarMode() in (0, mode):
            used_names.add(data.active_scalars_name)
        tangents = data.VTKObject.GetTangents()
        used_names.add(tangents.GetName() if tangents is not None else None)
        for name in set(data.keys()) - used_names:
            del data[name]
    mesh.clear_field_data()
