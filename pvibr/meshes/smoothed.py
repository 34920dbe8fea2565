"""Normals and scalars of lighter meshes: those of the surface that each triangle stands for."""

from __future__ import annotations

import numpy as np
import pyvista as pv
from scipy.sparse import csr_array

from pvibr.maths.vectors import unit_vectors
from pvibr.meshes.decimate import OUTWARD, Welded, is_foliage, take_arrays
from pvibr.meshes.materials import cell_scalars
from pvibr.meshes.parts import Part

_FLAT, _GOURAUD = 0, 1  # VTK's
_APART, _SHARE = np.radians(2.0), 0.5  # between normals that are one, and of how they turn
_CLOSER, _SEEN = 0.95, 0.01  # times as far off, and how far, that others pay for more points
_SMOOTHER = 0.7  # times as far off, that cell scalars pay for what keeps no steps between cells
_LOOKED_UP = 40_000  # places, about
_ROWS = 2, 7  # of the places in a triangle
_NORMALS = 'pvibr_normals'


def smoothed(part, light) -> Part:
    """Return a lighter part with the normals of the surface, or itself if its own are as near."""
    # A linear function is fitted to them in each triangle; what is alike at a place is averaged.
    if part.alpha_cutoff is not None or light.mesh is part.mesh:
        return light
    full, few = Welded.of(part.mesh), Welded.of(light.mesh)
    if is_foliage(full):
        return light
    weights, found, at = _places(full, few)
    seen = _seen(few, np.einsum('ij,ijk->ik', at, _normals(part, full)[found]))
    normals = _averaged(few, unit_vectors(np.linalg.pinv(weights) @ seen))

    def off(corners):
        away = np.linalg.norm(unit_vectors(weights @ corners) - seen, axis=2).mean(1)
        return np.average(away, weights=_areas(few))

    own = off(_normals(light, few))
    if own < _SEEN or off(normals) > _CLOSER * own:
        return light
    shading = max(part.actor.GetProperty().GetInterpolation(), _GOURAUD)
    return light.with_mesh(_with_normals(light.mesh, few, normals), shading)


def _normals(part, welded):
    """Return the normals at the corners of a part's triangles, shape (m, 3, 3)."""
    given = part.mesh.point_data.active_normals
    if given is None or part.actor.GetProperty().GetInterpolation() == _FLAT:
        return np.repeat(welded.facets[:, None], 3, axis=1)
    return np.asarray(given, float)[welded.corners]


def interpolated(part, light) -> Part:
    """Return a lighter part with interpolated cell scalars, or itself if its own are as near."""
    # Each of its cells stands for several: steps between them show before those of the full mesh.
    name = cell_scalars(light.actor.mapper, light.mesh)
    if not name or light.mesh is part.mesh:
        return light
    full, few = Welded.of(part.mesh), Welded.of(light.mesh)
    values = np.asarray(part.mesh.cell_data[name], float)
    if values.ndim > 1 or not np.isfinite(values).all() or is_foliage(full):
        return light
    weights, found, _ = _places(full, few)
    seen = values[full.cells[found]].reshape(len(few.faces), -1)
    fitted = seen @ np.linalg.pinv(weights).T
    area, corner = np.repeat(_areas(few), 3), few.faces.ravel()
    sums = (np.bincount(corner, w, len(few.points)) for w in (area * fitted.ravel(), area))
    at_points = np.divide(*sums)
    own = np.asarray(light.mesh.cell_data[name], float)[few.cells, None]
    off = [
        np.average(np.abs(shown - seen).mean(1), weights=_areas(few))
        for shown in (at_points[few.faces] @ weights.T, own)
    ]
    if off[0] > _SMOOTHER * off[1]:
        return light
    mesh = light.mesh.copy(deep=False)
    del mesh.cell_data[name]
    at_mesh = np.zeros(mesh.n_points, np.float32)
    at_mesh[few.corners.ravel()] = at_points[corner]
    mesh.point_data.set_array(at_mesh, name)
    return light.with_mesh(mesh)


def _places(full, few):
    """Return weights of corners at places in each triangle, and the full surface's there.

    Its triangles, and the weights of their corners, one place after the other.
    """
    rows = int(np.clip((2 * _LOOKED_UP / max(len(few.faces), 1)) ** 0.5, *_ROWS))
    row, column = np.tril_indices(rows)
    weights = (np.stack([rows - 1 - row, row - column, column], 1) + 1 / 3) / rows
    places = weights @ few.points[few.faces] * few.size + few.low
    places = (places - full.low) / full.size + OUTWARD * few.facets[:, None]
    found, at, _ = full.surface.nearest(places.reshape(-1, 3))
    return weights, found, at


def _seen(few, normals):
    """Return the full surface's normals at places in each triangle, (m, places, 3)."""
    seen = normals.reshape(len(few.faces), -1, 3)
    # What faces the other way is another side of the surface.
    seen *= ((seen * few.facets[:, None]).sum(2) > 0)[..., None]
    seen += (seen == 0).all(2)[..., None] * few.facets[:, None]
    return unit_vectors(seen)


def _averaged(few, normals):
    """Return normals of which those of one place that are alike are one."""
    corner, places = few.faces.ravel(), len(few.points)
    flat, area = normals.reshape(-1, 3), np.repeat(_areas(few), 3)
    ids = np.arange(len(corner))
    at = csr_array((np.ones(len(ids), np.int8), (ids, corner)), shape=(len(ids), places))
    one, other = (at @ at.T).nonzero()
    angle = np.arccos(np.clip((flat[one] * flat[other]).sum(1), -1, 1))
    # Triangles in a plane keep their normal also beside one that bends.
    turn = np.linalg.norm(normals - np.roll(normals, 1, axis=1), axis=2).max(1).repeat(3)
    alike = angle < _APART + _SHARE * np.minimum(turn[one], turn[other])
    one, other = one[alike], other[alike]
    sums = csr_array((area[other], (one, other)), shape=(len(ids), len(ids))) @ flat
    return unit_vectors(sums).reshape(normals.shape)


def _areas(few):
    a, b, c = few.points[few.faces].swapaxes(0, 1)
    return np.linalg.norm(np.cross(b - a, c - a), axis=1)


def _with_normals(mesh, few, normals):
    """Return the triangles with normals, and as few points as these allow."""
    ids = few.corners.ravel()
    key = np.column_stack([ids, np.rint(normals.reshape(-1, 3) / _APART)])
    _, first, which = np.unique(key, axis=0, return_index=True, return_inverse=True)
    new = pv.PolyData()
    new.points = np.asarray(mesh.points)[ids[first]]
    faces: np.ndarray = which.reshape(-1, 3)
    new.regular_faces = faces
    new.point_data[_NORMALS] = normals.reshape(-1, 3)[first].astype(np.float32)
    take_arrays(mesh, new, ids[first], few.cells)
    new.point_data.active_normals_name = _NORMALS
    return new
