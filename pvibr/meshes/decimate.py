"""Simplification of parts."""

from __future__ import annotations

import numpy as np
import pyvista as pv
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from pvibr.meshes.parts import Part, copy_property

_SMALL_PIECE = 20  # mean triangles per component below which a mesh may be aggregate detail
_SMALL_SIZE = 0.1  # largest component of aggregate detail, relative to the mesh
_MISSED = 1.1  # times the triangles wanted: with more left, simplification has failed


def lighter(part, share) -> Part | None:
    """Return a simplified part with a share of the triangles, or None if it cannot be simplified.

    Cook et al., "Stochastic Simplification of Aggregate Detail", SIGGRAPH 2007; Garland and
    Heckbert, "Surface Simplification Using Quadric Error Metrics", SIGGRAPH 1997, by fast-
    simplification.
    """
    faces = np.asarray(part.mesh.regular_faces)
    pieces, labels = _pieces(faces, part.mesh.n_points)
    if _is_scattered(part.mesh, faces, labels, pieces):
        mesh = _thinned(part.mesh, faces, labels, pieces, share)
    elif part.mesh.active_texture_coordinates is not None:
        return None
    else:
        flat = part.actor.GetProperty().GetInterpolation() == 0
        mesh = _simplified(part.mesh, faces, share, flat=flat)
    return _with_mesh(part, mesh) if mesh.n_cells else None


def _pieces(faces, n_points):
    """Return the number of connected components, and the component of each triangle."""
    rows, columns = faces[:, [0, 1]].T
    more, others = faces[:, [1, 2]].T
    i, j = np.concatenate([rows, more]), np.concatenate([columns, others])
    graph = coo_array((np.ones(len(i), np.int8), (i, j)), shape=(n_points, n_points))
    _, labels = connected_components(graph, directed=False)
    used, labels = np.unique(labels[faces[:, 0]], return_inverse=True)
    return len(used), labels


def _is_scattered(mesh, faces, labels, pieces):
    if not pieces > _SMALL_PIECE or len(faces) > _SMALL_PIECE * pieces:
        return False
    points = np.asarray(mesh.points, float)
    order = np.argsort(labels, kind='stable')
    starts = np.searchsorted(labels[order], np.arange(pieces))
    low = np.minimum.reduceat(points[faces[order]].min(1), starts)
    high = np.maximum.reduceat(points[faces[order]].max(1), starts)
    return bool((high - low).max() < _SMALL_SIZE * np.ptp(points, axis=0).max())


def _thinned(mesh, faces, labels, pieces, share):
    keep = np.random.default_rng(0).permutation(pieces) < max(1, round(share * pieces))
    kept = faces[keep[labels]]
    of_point = np.zeros(mesh.n_points, np.intp)
    of_point[kept.ravel()] = np.repeat(labels[keep[labels]], 3)
    ids = np.unique(kept)
    points = np.asarray(mesh.points, float)[ids]
    piece = of_point[ids]
    count = np.maximum(np.bincount(piece, minlength=pieces), 1)[:, None]
    sums = np.stack([np.bincount(piece, points[:, k], pieces) for k in range(3)], 1)
    middle = (sums / count)[piece]
    points = middle + (points - middle) / np.sqrt(keep.mean())
    new = pv.PolyData()
    new.points = points.astype(mesh.points.dtype)
    new.regular_faces = np.searchsorted(ids, kept).astype(np.int64)
    return take_arrays(mesh, new, ids, np.flatnonzero(keep[labels]))


def _simplified(mesh, faces, share, *, flat):
    import fast_simplification

    # Relative to the mesh's size: the library works in float32.
    points = np.asarray(mesh.points, float)
    low, size = points.min(0), float(np.ptp(points, axis=0).max()) or 1.0
    local = np.ascontiguousarray((points - low) / size, np.float32)
    # Merge coincident points: edges along a seam would collapse apart.
    local, same = np.unique(local, axis=0, return_inverse=True)
    faces = same.reshape(-1)[faces]
    whole = (faces != np.roll(faces, 1, axis=1)).all(1)
    local, collapsed = fast_simplification.simplify(
        local, np.ascontiguousarray(faces[whole], np.int32), target_reduction=1 - share
    )
    new = pv.PolyData()
    new.points = (local.astype(float) * size + low).astype(mesh.points.dtype)
    new.regular_faces = np.asarray(collapsed, int).reshape(-1, 3)
    if not 0 < new.n_cells < _MISSED * share * mesh.n_cells:
        return pv.PolyData()  # simplification got stuck, with a bad result
    _, nearest = cKDTree(points).query(np.asarray(new.points, float))
    cells = None
    if mesh.cell_data.keys():
        _, cells = cKDTree(mesh.cell_centers().points).query(new.cell_centers().points)
    take_arrays(mesh, new, nearest, cells)
    if flat or new.point_data.active_normals is None:
        # Facets that are too small to be seen become larger: normals that vary hide them. They
        # follow the winding, as facets do, which normals that nobody sees may not.
        new.point_data.active_normals = _normals(points, faces, same.reshape(-1))[nearest]
    return _upright(new)


def _upright(mesh):
    """Turn triangles that collapsing turned over: VTK would light their backs."""
    faces = np.array(mesh.regular_faces)
    a, b, c = np.asarray(mesh.points, float)[faces.T]
    normals = np.asarray(mesh.point_data.active_normals)[faces].sum(1)
    over = (np.cross(b - a, c - a) * normals).sum(1) < 0
    faces[over] = faces[over, ::-1]
    mesh.regular_faces = faces
    return mesh


def _normals(points, faces, same):
    """Return area-weighted normals of points; coincident points share one."""
    a, b, c = (points[same_first] for same_first in _corners(faces, same))
    area = np.cross(b - a, c - a)
    sums = np.stack(
        [np.bincount(faces.ravel(), area[:, k].repeat(3), same.max() + 1) for k in range(3)], 1
    )
    lengths = np.maximum(np.linalg.norm(sums, axis=1, keepdims=True), 1e-300)
    return (sums / lengths)[same].astype(np.float32)


def _corners(faces, same):
    first = np.zeros(same.max() + 1, np.intp)
    first[same] = np.arange(len(same))
    return first[faces].T


def take_arrays(old, new, points, cells):
    """Copy the arrays of a mesh at some points and cells."""
    for source, target, ids in (
        (old.point_data, new.point_data, points),
        (old.cell_data, new.cell_data, cells),
    ):
        for name in source if ids is not None else ():
            target[name] = np.asarray(source[name])[ids]
        for kind in ('active_scalars_name', 'active_normals_name'):
            if getattr(source, kind) in target:
                setattr(target, kind, getattr(source, kind))
        coordinates = source.active_texture_coordinates_name
        if coordinates in target:
            target.active_texture_coordinates_name = coordinates
    return new


def _with_mesh(part, mesh):
    new = part.with_mesh(mesh)
    prop = part.actor.GetProperty()
    if prop.GetInterpolation() == 0 and mesh.point_data.active_normals is not None:
        smooth = pv.Property()
        copy_property(smooth, prop)
        smooth.SetInterpolationToGouraud()
        new.actor.SetProperty(smooth)
    return new
