"""Normals of lighter meshes: those of the surface that each triangle stands for."""

from __future__ import annotations

import numpy as np
import pyvista as pv
from scipy.sparse import csr_array

from pvibr.maths.vectors import unit_vectors
from pvibr.meshes.decimate import OUTWARD, Welded, is_foliage, take_arrays
from pvibr.meshes.parts import Part

_FLAT, _GOURAUD = 0, 1  # VTK's
_APART, _SHARE = np.radians(2.0), 0.5  # between normals that are one, and of how they turn
_CLOSER, _SEEN = 0.95, 0.01  # times as far off, and how far, that others pay for more points
_LOOKED_UP = 60_000  # places, about
_ROWS = 3, 7  # of the places in a triangle
_NORMALS = 'pvibr_normals'


def smoothed(part, light) -> Part:
    """Return a lighter part with the normals of the surface, or itself if its own are as near."""
    # A linear function is fitted to them in each triangle; what is alike at a place is averaged.
    if part.alpha_cutoff is not None or light.mesh is part.mesh:
        return light
    full, few = Welded.of(part.mesh), Welded.of(light.mesh)
    if is_foliage(full):
        return light
    weights, seen = _seen(full, _normals(part, full), few)
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


def _seen(full, normals, few):
    """Return the corners' weights at places in each triangle, and the full surface's normals."""
    count = len(few.faces)
    rows = int(np.clip((2 * _LOOKED_UP / max(count, 1)) ** 0.5, *_ROWS))
    row, column = np.tril_indices(rows)
    weights = (np.stack([rows - 1 - row, row - column, column], 1) + 1 / 3) / rows
    places = weights @ few.points[few.faces] * few.size + few.low
    places = (places - full.low) / full.size + OUTWARD * few.facets[:, None]
    found, at, _ = full.surface.nearest(places.reshape(-1, 3))
    seen = np.einsum('ij,ijk->ik', at, normals[found]).reshape(count, -1, 3)
    # What faces the other way is another side of the surface.
    seen *= ((seen * few.facets[:, None]).sum(2) > 0)[..., None]
    seen += (seen == 0).all(2)[..., None] * few.facets[:, None]
    return weights, unit_vectors(seen)


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
