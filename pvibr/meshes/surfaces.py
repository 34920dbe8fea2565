"""The surfaces of datasets, as ``add_mesh`` draws them."""

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
        raise ValueError('mesh is empty: it has no points.')
    bad = np.flatnonzero(~np.isfinite(dataset.points).all(axis=1))
    if bad.size:
        first = f'mesh.points[{bad[0]}] is {dataset.points[bad[0]].tolist()}'
        raise ValueError(
            f'{first}; it must be finite ({bad.size} such points). Remove them or set them.'
        )


def surface_of(dataset):
    """Return the polygons, lines and vertices that VTK draws of a dataset."""
    active = dataset.active_scalars_info
    if isinstance(dataset, pv.PointSet):
        dataset = dataset.cast_to_polydata(deep=False)
    if not isinstance(dataset, pv.PolyData):
        # The filter within add_mesh's mapper.
        dataset = dataset.extract_surface(
            algorithm='dataset_surface', pass_pointid=False, pass_cellid=False
        )
    _set_active(dataset, active)
    return dataset


def triangles_of(surface):
    """Return the polygons of a surface as triangles, with its active arrays."""
    polygons = _polygons(surface)
    triangles = polygons if _is_triangulated(polygons) else polygons.triangulate()
    _set_active(triangles, surface.active_scalars_info)
    return triangles


def _polygons(surface):
    """Return a surface without vertices and lines, which VTK's triangle filter mixes up."""
    first = surface.n_verts + surface.n_lines
    if not first:
        return surface
    mesh = surface.copy(deep=False)
    with _keeping_cells(mesh, np.arange(first, mesh.n_cells)):
        mesh.SetVerts(None)
        mesh.SetLines(None)
    return mesh


def some_triangles(mesh, ids):
    """Return some triangles of a mesh of triangles, with all of its points."""
    ids, mesh = np.asarray(ids), mesh.copy(deep=False)
    with _keeping_cells(mesh, ids):
        mesh.regular_faces = np.asarray(mesh.regular_faces)[ids]
    return mesh


@contextmanager
def _keeping_cells(mesh, ids):
    """Take the arrays of some cells along while the cells change."""
    data, active = mesh.cell_data, mesh.active_scalars_info
    normals = data.active_normals_name
    kept = {name: np.asarray(data[name])[ids] for name in data}
    mesh.clear_cell_data()
    yield
    for name, values in kept.items():
        data.set_array(values, name)
    data.active_normals_name = normals
    _set_active(mesh, active)


def _set_active(surface, active):
    if active.name is not None and active.association.name in ('POINT', 'CELL'):
        surface.set_active_scalars(active.name, preference=active.association.name.lower())


def _is_triangulated(surface):
    return not (surface.n_verts or surface.n_lines or surface.n_strips) and (
        surface.is_all_triangles
    )


def moved(mesh, matrix):
    """Return a surface transformed by a matrix, a mirroring one included."""
    if np.array_equal(matrix, np.eye(4)):
        return mesh
    new = mesh.copy(deep=False)
    # A shallow copy shares its vtkPoints: the points setter would change the original.
    new.SetPoints(pv.vtk_points(transform_points(matrix, mesh.points)))
    for old, data in ((mesh.point_data, new.point_data), (mesh.cell_data, new.cell_data)):
        if old.active_normals is not None:
            data.active_normals = transform_normals(matrix, old.active_normals)
    # A mirroring matrix reverses the winding.
    return with_flipped_winding(new) if np.linalg.det(matrix[:3, :3]) < 0 else new


def clipped(mesh, planes):
    """Return what clipping planes leave of a surface; VTK keeps what lies along their normals."""
    for plane in () if planes is None else planes:
        cut = _vtk.vtkClipPolyData()
        cut.SetInputData(mesh)
        cut.SetClipFunction(plane)
        cut.Update()
        left = pv.wrap(cut.GetOutput())
        if not left.GetNumberOfPolys() + left.n_strips:
            raise ValueError('mesh is clipped away by the planes of its mapper.')
        _set_active(left, mesh.active_scalars_info)
        mesh = left
    return mesh


def drop_unseen(mesh, mapper):
    """Remove the arrays that a mapper does not draw."""
    if mapper.GetArrayAccessMode() == 0 and mapper.GetScalarMode() in (3, 4):
        return  # the array is selected by index, which dropping others would change
    shown = {mapper.GetArrayName()} if mapper.GetScalarVisibility() else set()
    for mode, data in ((1, mesh.point_data), (2, mesh.cell_data)):
        keep = shown | {data.active_normals_name, data.active_texture_coordinates_name}
        if mapper.GetScalarVisibility() and mapper.GetScalarMode() in (0, mode):
            keep.add(data.active_scalars_name)
        tangents = data.VTKObject.GetTangents()
        keep.add(tangents.GetName() if tangents is not None else None)
        for name in set(data.keys()) - keep:
            del data[name]
    mesh.clear_field_data()
