"""Normals and scalars of lighter meshes, fitted to those of the full surface."""

from __future__ import annotations

import numpy as np
import pyvista as pv
import scipy  # whose modules load when they are first used

from pvibr.maths.vectors import unit_vectors
from pvibr.meshes.decimate import OUTWARD, Weldings, is_foliage, take_arrays
from pvibr.meshes.materials import cell_scalars
from pvibr.meshes.parts import Part

_FLAT, _GOURAUD = 0, 1  # VTK's
#: Normals at a point are merged within an angle, plus a share of how much they bend in a triangle.
_MERGE_ANGLE, _BEND_SHARE = np.radians(2.0), 0.5
#: Deviation, relative to the present one, from which other normals pay; the invisible one.
_WORTH, _INVISIBLE = 0.95, 0.01
_WORTH_SCALARS = 0.7  # the same for point scalars, which lose the steps between cells
_SAMPLES = 40_000  # points looked up, about
_ROWS = 2, 7  # rows of samples in a triangle
_NORMALS = 'pvibr_normals'


def smoothed(part, light, weld=None) -> Part:
    """Return a lighter part with the normals of the surface, or itself if its own are as good."""
    # Normals are fitted linearly in each triangle; similar ones at a point are averaged.
    if part.alpha_cutoff is not None or light.mesh is part.mesh:
        return light
    full, coarse = map(weld or Weldings(), (part, light))
    if is_foliage(full):
        return light
    weights, triangles, at = _samples(full, coarse)
    targets = _target_normals(coarse, np.einsum('ij,ijk->ik', at, _normals(part, full)[triangles]))
    normals = _averaged(coarse, unit_vectors(np.linalg.pinv(weights) @ targets))

    def off(corners):
        deviation = np.linalg.norm(unit_vectors(weights @ corners) - targets, axis=2).mean(1)
        return np.average(deviation, weights=_areas(coarse))

    deviation = off(_normals(light, coarse))
    if deviation < _INVISIBLE or off(normals) > _WORTH * deviation:
        return light
    shading = max(part.actor.GetProperty().GetInterpolation(), _GOURAUD)
    return light.with_mesh(_with_normals(light.mesh, coarse, normals), shading)


def _normals(part, welded):
    """Return the normals at the corners of a part's triangles, shape (m, 3, 3)."""
    normals = part.mesh.point_data.active_normals
    if normals is None or part.actor.GetProperty().GetInterpolation() == _FLAT:
        return np.repeat(welded.facets[:, None], 3, axis=1)
    return np.asarray(normals, float)[welded.corners]


def interpolated(part, light, weld=None) -> Part:
    """Return a lighter part with point for cell scalars, or itself if its own are as good."""
    # Its cells are larger: steps between them are visible before those of the full mesh.
    name = cell_scalars(light.actor.mapper, light.mesh)
    if not name or light.mesh is part.mesh:
        return light
    full, coarse = map(weld or Weldings(), (part, light))
    values = np.asarray(part.mesh.cell_data[name], float)
    if values.ndim > 1 or not np.isfinite(values).all() or is_foliage(full):
        return light
    weights, triangles, _ = _samples(full, coarse)
    targets = values[full.cells[triangles]].reshape(len(coarse.faces), -1)
    corner_values = targets @ np.linalg.pinv(weights).T
    areas, corner_ids = np.repeat(_areas(coarse), 3), coarse.faces.ravel()
    weighted = areas * corner_values.ravel()
    sums = (np.bincount(corner_ids, w, len(coarse.points)) for w in (weighted, areas))
    at_points = np.divide(*sums)
    cell_values = np.asarray(light.mesh.cell_data[name], float)[coarse.cells, None]
    errors = [
        np.average(np.abs(sampled - targets).mean(1), weights=_areas(coarse))
        for sampled in (at_points[coarse.faces] @ weights.T, cell_values)
    ]
    if errors[0] > _WORTH_SCALARS * errors[1]:
        return light
    mesh = light.mesh.copy(deep=False)
    del mesh.cell_data[name]
    at_mesh = np.zeros(mesh.n_points, np.float32)
    at_mesh[coarse.corners.ravel()] = at_points[corner_ids]
    mesh.point_data.set_array(at_mesh, name)
    return light.with_mesh(mesh)


def _samples(full, coarse):
    """Return the barycentric weights of samples in a triangle, and the full surface's at each.

    The latter are triangles, and weights of their corners, for all samples in turn.
    """
    n_rows = int(np.clip((2 * _SAMPLES / max(len(coarse.faces), 1)) ** 0.5, *_ROWS))
    row, column = np.tril_indices(n_rows)
    weights = (np.stack([n_rows - 1 - row, row - column, column], 1) + 1 / 3) / n_rows
    places = weights @ coarse.points[coarse.faces] * coarse.size + coarse.low
    places = (places - full.low) / full.size + OUTWARD * coarse.facets[:, None]
    triangles, at, _ = full.surface.nearest(places.reshape(-1, 3))
    return weights, triangles, at


def _target_normals(coarse, normals):
    """Return the full surface's normals at the samples of each triangle, (m, samples, 3)."""
    target_normals = normals.reshape(len(coarse.faces), -1, 3)
    # Normals facing the other way are of another side of the surface.
    target_normals *= ((target_normals * coarse.facets[:, None]).sum(2) > 0)[..., None]
    target_normals += (target_normals == 0).all(2)[..., None] * coarse.facets[:, None]
    return unit_vectors(target_normals)


def _averaged(coarse, normals):
    """Return normals with similar ones at a point averaged."""
    corner_ids, places = coarse.faces.ravel(), len(coarse.points)
    flat_normals, areas = normals.reshape(-1, 3), np.repeat(_areas(coarse), 3)
    ids = np.arange(len(corner_ids))
    at_point = scipy.sparse.csr_array(
        (np.ones(len(ids), np.int8), (ids, corner_ids)), shape=(len(ids), places)
    )
    first, second = (at_point @ at_point.T).nonzero()
    angles = np.arccos(np.clip((flat_normals[first] * flat_normals[second]).sum(1), -1, 1))
    # Flat triangles keep their normal beside a bent one.
    bending = np.linalg.norm(normals - np.roll(normals, 1, axis=1), axis=2).max(1).repeat(3)
    is_alike = angles < _MERGE_ANGLE + _BEND_SHARE * np.minimum(bending[first], bending[second])
    first, second = first[is_alike], second[is_alike]
    sums = (
        scipy.sparse.csr_array((areas[second], (first, second)), shape=(len(ids), len(ids)))
        @ flat_normals
    )
    return unit_vectors(sums).reshape(normals.shape)


def _areas(coarse):
    a, b, c = coarse.points[coarse.faces].swapaxes(0, 1)
    return np.linalg.norm(np.cross(b - a, c - a), axis=1)


def _with_normals(mesh, coarse, normals):
    """Return the triangles with normals, on as few points as these allow."""
    point_ids = coarse.corners.ravel()
    copy_keys = np.column_stack([point_ids, np.rint(normals.reshape(-1, 3) / _MERGE_ANGLE)])
    _, first_ids, new_ids = np.unique(copy_keys, axis=0, return_index=True, return_inverse=True)
    split = pv.PolyData()
    split.points = np.asarray(mesh.points)[point_ids[first_ids]]
    faces: np.ndarray = new_ids.reshape(-1, 3)
    split.regular_faces = faces
    split.point_data[_NORMALS] = normals.reshape(-1, 3)[first_ids].astype(np.float32)
    take_arrays(mesh, split, point_ids[first_ids], coarse.cells)
    split.point_data.active_normals_name = _NORMALS
    return split
