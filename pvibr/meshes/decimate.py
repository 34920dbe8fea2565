"""Simplification of parts."""

from __future__ import annotations

from contextlib import contextmanager
from dataclasses import dataclass

import numpy as np
import pyvista as pv
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from pvibr.core import _vtk
from pvibr.meshes.parts import Part
from pvibr.meshes.surface_distance import Surface, hausdorff

_SMALL_PIECE = 20  # mean triangles per component below which a mesh may be aggregate detail
_SMALL_SIZE = 0.1  # largest component of aggregate detail, relative to the mesh
_MISSED = 1.2  # times the triangles wanted: with more left, simplification has failed
_WRECKED = 0.02  # displacement, of the mesh's size, from which another way is tried
_SAME = 1e-3  # of a normal
_JUMP = 0.1  # of an array's range: corners of a point that differ by more stay apart
_TURN = 0.2  # the same of normals
_ROUGHLY = 1000  # places that tell whether a surface was wrecked
#: Of the mesh's size: what is looked up is the near side of a plate.
OUTWARD = 1e-5
#: PyVista's names of what arrays are to VTK.
ACTIVE = 'active_scalars_name', 'active_normals_name', 'active_texture_coordinates_name'
_INWARD = 0.02  # of the way to a triangle's centre, where its side of a seam is looked up


def lighter(part, share) -> Part | None:
    """Return a simplified part with a share of the triangles, or None if it cannot be simplified.

    Cook et al., "Stochastic Simplification of Aggregate Detail", SIGGRAPH 2007; Garland and
    Heckbert, "Surface Simplification Using Quadric Error Metrics", SIGGRAPH 1997, and
    "Simplifying Surfaces with Color and Texture Using Quadric Error Metrics", 1998, by VTK.
    """
    welded = Welded.of(part.mesh)
    pieces, labels = connected(welded.faces, len(welded.points))
    if is_scattered(welded, labels, pieces):
        mesh = _thinned(part.mesh, welded, labels, pieces, share)
    else:
        flat = part.actor.GetProperty().GetInterpolation() == 0
        mesh = _simplified(part.mesh, welded, share, flat=flat)
    return part.with_mesh(mesh) if mesh.n_cells else None


def displacement(part, light) -> float:
    """Return how far a simplified surface is from the part's."""
    if light.mesh is part.mesh:
        return 0.0
    one, other = Welded.of(part.mesh), Welded.of(light.mesh)
    places = [w.points * w.size + w.low - one.low for w in (one, other)]
    return hausdorff(*(Surface(p, w.faces) for p, w in zip(places, (one, other), strict=True)))


def connected(faces, n_points):
    """Return the number of connected components, and the component of each triangle."""
    rows, columns = faces[:, [0, 1]].T
    more, others = faces[:, [1, 2]].T
    i, j = np.concatenate([rows, more]), np.concatenate([columns, others])
    graph = coo_array((np.ones(len(i), np.int8), (i, j)), shape=(n_points, n_points))
    _, labels = connected_components(graph, directed=False)
    used, labels = np.unique(labels[faces[:, 0]], return_inverse=True)
    return len(used), labels


@dataclass
class Welded:
    """The triangles of a mesh, whose points of one place are one, in units of the mesh's size."""

    points: np.ndarray  # float64, 0 to 1
    faces: np.ndarray  # without those that have two corners in one place
    corners: np.ndarray  # the mesh's own points at their corners
    cells: np.ndarray  # the mesh's own triangles
    low: np.ndarray
    size: float

    @classmethod
    def of(cls, mesh) -> Welded:
        """Return those of a mesh."""
        points, corners = np.asarray(mesh.points, float), np.asarray(mesh.regular_faces)
        low, size = points.min(0), float(np.ptp(points, axis=0).max()) or 1.0
        # In float32: what two programs wrote of one place may differ in its last digits.
        local, same = np.unique(
            ((points - low) / size).astype(np.float32), axis=0, return_inverse=True
        )
        faces = same.reshape(-1)[corners]
        cells = np.flatnonzero((faces != np.roll(faces, 1, axis=1)).all(1))
        used, faces = np.unique(faces[cells], return_inverse=True)
        points = local[used].astype(float)
        return cls(points, faces.reshape(-1, 3), corners[cells], cells, low, size)

    @property
    def facets(self) -> np.ndarray:
        """The unit normals of the triangles."""
        return _facets(self.points, self.faces)

    @property
    def surface(self) -> Surface:
        """What finds the nearest triangle."""
        return Surface(self.points, self.faces)


def is_surface(part) -> bool:
    """Return True for a part that is neither cut out nor aggregate detail."""
    return part.alpha_cutoff is None and not is_foliage(Welded.of(part.mesh))


def is_foliage(welded) -> bool:
    """Return True for welded triangles that are aggregate detail, such as leaves."""
    pieces, labels = connected(welded.faces, len(welded.points))
    return is_scattered(welded, labels, pieces)


def is_scattered(welded, labels, pieces) -> bool:
    """Return True for aggregate detail, such as leaves."""
    if not pieces > _SMALL_PIECE or len(welded.faces) > _SMALL_PIECE * pieces:
        return False
    order = np.argsort(labels, kind='stable')
    starts = np.searchsorted(labels[order], np.arange(pieces))
    corners = welded.points[welded.faces[order]]
    low = np.minimum.reduceat(corners.min(1), starts)
    high = np.maximum.reduceat(corners.max(1), starts)
    return bool((high - low).max() < _SMALL_SIZE)


def _thinned(mesh, welded, labels, pieces, share):
    keep = np.random.default_rng(0).permutation(pieces) < max(1, round(share * pieces))
    kept = keep[labels]
    faces, cells = welded.corners[kept], welded.cells[kept]
    of_point = np.zeros(mesh.n_points, np.intp)
    of_point[faces.ravel()] = np.repeat(labels[kept], 3)
    ids = np.unique(faces)
    points = np.asarray(mesh.points, float)[ids]
    piece = of_point[ids]
    count = np.maximum(np.bincount(piece, minlength=pieces), 1)[:, None]
    sums = np.stack([np.bincount(piece, points[:, k], pieces) for k in range(3)], 1)
    middle = (sums / count)[piece]
    points = middle + (points - middle) / np.sqrt(keep.mean())
    new = pv.PolyData()
    new.points = points.astype(mesh.points.dtype)
    new.regular_faces = np.searchsorted(ids, faces).astype(np.int64)
    return take_arrays(mesh, new, ids, cells)


def _simplified(mesh, welded, share, *, flat):
    columns = _Columns.of(mesh, welded, flat=flat)
    points, faces = _collapsed(welded, columns, share)
    if not 0 < len(faces) < max(_MISSED * share * mesh.n_cells, 1):
        return pv.PolyData()  # simplification got stuck, with a bad result
    return _dressed(mesh, welded, columns, points, faces)


def _collapsed(welded, columns, share):
    """Return points and faces, by the way that moves the surface least."""
    points, faces = _by_vtk(welded, columns.metric(), share)
    if len(faces) and np.isfinite(points).all():
        truth = welded.surface
        moved = hausdorff(truth, Surface(points, faces), _ROUGHLY)
        enough = len(faces) < _MISSED * share * len(welded.faces)
        if enough and moved < _WRECKED:
            return points, faces
        other = _by_fast_simplification(welded, share)
        if len(other[1]) and hausdorff(truth, Surface(*other), _ROUGHLY) < moved:
            return other
        return points, faces
    return _by_fast_simplification(welded, share)


def _by_vtk(welded, metric, share):
    mesh = pv.PolyData.from_regular_faces(welded.points, welded.faces)
    for name, values in metric.items():
        mesh.point_data[name] = values
        getattr(mesh.GetPointData(), f'SetActive{name}')(name)
    decimate = _vtk.vtkQuadricDecimation()
    decimate.SetInputData(mesh)
    decimate.SetTargetReduction(1 - share)
    decimate.SetAttributeErrorMetric(bool(metric))
    with _silent():  # flat parts have matrices that cannot be factored; the result is checked
        decimate.Update()
    out = pv.wrap(decimate.GetOutput())
    return np.asarray(out.points, float), _proper(np.asarray(out.regular_faces))


def _by_fast_simplification(welded, share):
    import fast_simplification

    points, faces = fast_simplification.simplify(
        np.ascontiguousarray(welded.points, np.float32),
        np.ascontiguousarray(welded.faces, np.int32),
        target_reduction=1 - share,
    )
    return np.asarray(points, float), _proper(np.asarray(faces, int))


def _proper(faces):
    faces = faces.reshape(-1, 3)  # of none PyVista gives one axis
    return faces[(faces != np.roll(faces, 1, axis=1)).all(1)]


@contextmanager
def _silent():
    shown = _vtk.vtkObject.GetGlobalWarningDisplay()
    _vtk.vtkObject.SetGlobalWarningDisplay(False)
    try:
        yield
    finally:
        _vtk.vtkObject.SetGlobalWarningDisplay(shown)


@dataclass
class _Columns:
    """The point arrays of a mesh at the corners of its triangles."""

    arrays: dict  # (m, 3, components) each
    normals: str | None
    coordinates: str | None
    scalars: str | None
    faces: np.ndarray  # welded

    @classmethod
    def of(cls, mesh, welded, *, flat) -> _Columns:
        """Return those of a mesh."""
        data = mesh.point_data
        arrays = {
            name: np.asarray(data[name], float).reshape(mesh.n_points, -1)[welded.corners]
            for name in data
        }
        normals = data.active_normals_name
        if flat or _is_faceted(arrays.get(normals)):  # facets have their own, however large
            arrays.pop(normals, None)
            normals = None
        coordinates = data.active_texture_coordinates_name
        scalars = data.active_scalars_name
        if scalars not in arrays or scalars in (normals, coordinates):
            rest = [n for n in arrays if n not in (normals, coordinates)]
            scalars = rest[0] if rest else None
        return cls(arrays, normals, coordinates, scalars, welded.faces)

    def metric(self) -> dict:
        """Return what the simplification keeps, by the name of VTK's attributes."""
        names = {'Normals': self.normals, 'TCoords': self.coordinates, 'Scalars': self.scalars}
        out = {}
        for kind, name in names.items():
            # Normals that differ in one place are of creases, which place alone keeps.
            if name is None or (kind == 'Normals' and self.has_seams([name])):
                continue
            values = self.arrays[name]
            points = np.zeros((self.faces.max() + 1, values.shape[2]), np.float32)
            if kind == 'Normals':
                np.add.at(points, self.faces, values)
                points /= np.maximum(np.linalg.norm(points, axis=1, keepdims=True), 1e-30)
            else:
                points[self.faces] = values
            out[kind] = np.nan_to_num(points)
        return out

    def has_seams(self, names=None) -> bool:
        """Return True if triangles that meet in a place have different values there."""
        for name in names or self.arrays:
            values = self.arrays[name]
            one = np.zeros((self.faces.max() + 1, values.shape[2]))
            one[self.faces] = values
            if not np.array_equal(one[self.faces], values, equal_nan=True):
                return True
        return False

    def jumps(self, values, means):
        """Return the corners whose values are far from the mean of their point."""
        over = np.zeros(len(values[next(iter(values))]), bool)
        for name, at in values.items():
            over |= (np.abs(at - means[name]) > self.step(name)).any(1)
        return over

    def step(self, name) -> float:
        """Return how far values of one array may be apart at one point."""
        if name == self.normals:
            return _TURN
        values = self.arrays[name]
        return _JUMP * (float(np.nanmax(values) - np.nanmin(values)) or 1.0)


def _is_faceted(normals):
    return normals is not None and bool(np.ptp(normals, axis=1).max() < _SAME)


def _dressed(mesh, welded, columns, points, faces):
    """Return a mesh of simplified triangles, with the arrays that the surface has there."""
    surface = welded.surface
    facets = _facets(points, faces)
    used, faces = np.unique(faces, return_inverse=True)
    points, faces = points[used], faces.reshape(-1, 3)
    sums = np.zeros_like(points)
    np.add.at(sums, faces, facets[:, None])
    sums /= np.maximum(np.linalg.norm(sums, axis=1, keepdims=True), 1e-300)
    values = _looked_up(columns.arrays, surface, points, sums)
    place, faces, values = _split(columns, surface, points, faces, facets, values)
    new = pv.PolyData()
    new.points = (points[place] * welded.size + welded.low).astype(mesh.points.dtype)
    new.regular_faces = faces
    for name, at in values.items():
        kind = mesh.point_data[name].dtype if name in mesh.point_data else np.dtype('f4')
        new.point_data[name] = _as_kind(at, kind)
    cells = None
    if mesh.cell_data.keys():
        cells = welded.cells[surface.nearest(points[place[faces]].mean(1) + OUTWARD * facets)[0]]
    take_arrays(mesh, new, None, cells)
    return new if columns.normals is None else _upright(new, mesh)


def _facets(points, faces):
    normals = np.cross(*(points[faces[:, k]] - points[faces[:, 0]] for k in (1, 2)))
    return normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-300)


def _looked_up(arrays, surface, places, normals):
    """Return the values of arrays at the nearest places of the outer side of a surface."""
    triangles, weights, _ = surface.nearest(places + OUTWARD * normals)
    return {n: np.einsum('ij,ijk->ik', weights, a[triangles]) for n, a in arrays.items()}


def _split(columns, surface, points, faces, facets, values):
    """Return the place of each point, faces and values: along a seam a place has several."""
    place = np.arange(len(points))
    if not columns.has_seams():
        return place, faces, values
    inward = points[faces] + _INWARD * (points[faces].mean(1, keepdims=True) - points[faces])
    corners = _looked_up(
        columns.arrays, surface, inward.reshape(-1, 3), np.repeat(facets, 3, axis=0)
    )
    flat = faces.ravel()
    count = np.bincount(flat, minlength=len(points))[:, None]
    means = {
        n: np.stack([np.bincount(flat, v, len(points)) for v in at.T], 1) / count
        for n, at in corners.items()
    }
    torn = np.zeros(len(points), bool)
    torn[flat[columns.jumps(corners, {n: m[flat] for n, m in means.items()})]] = True
    own = np.flatnonzero(torn[flat])
    steps = [np.rint(at[own] / columns.step(n)) for n, at in corners.items()]
    key, first, which = np.unique(
        np.column_stack([flat[own], *steps]), axis=0, return_index=True, return_inverse=True
    )
    new = flat.copy()
    new[own] = len(points) + which.reshape(-1)
    place = np.concatenate([place, key[:, 0].astype(int)])
    values = {n: np.concatenate([v, corners[n][own[first]]]) for n, v in values.items()}
    used, new = np.unique(new, return_inverse=True)
    return place[used], new.reshape(-1, 3), {n: v[used] for n, v in values.items()}


def _as_kind(values, kind):
    values = values[:, 0] if values.shape[1] == 1 else values
    if kind.kind in 'iu':
        info = np.iinfo(kind)
        return np.clip(np.rint(values), info.min, info.max).astype(kind)
    return values.astype(kind) if kind.kind == 'f' else values > 0.5


def _upright(mesh, old):
    """Turn triangles that collapsing turned over: VTK would light their backs."""
    faces = np.array(mesh.regular_faces)
    over = _facing(mesh) * np.sign(_facing(old).sum()) < 0
    faces[over] = faces[over, ::-1]
    mesh.regular_faces = faces
    return mesh


def _facing(mesh):
    """Return the areas of triangles, negative where they face away from their normals."""
    faces = np.asarray(mesh.regular_faces)
    a, b, c = np.asarray(mesh.points, float)[faces.T]
    normals = np.asarray(mesh.point_data.active_normals, float)[faces].sum(1)
    return (np.cross(b - a, c - a) * normals).sum(1)


def take_arrays(old, new, points, cells):
    """Copy the arrays of a mesh at some points and cells."""
    for source, target, ids in (
        (old.point_data, new.point_data, points),
        (old.cell_data, new.cell_data, cells),
    ):
        for name in source if ids is not None else ():
            target[name] = np.asarray(source[name])[ids]
        for kind in ACTIVE:
            if getattr(source, kind) in target:
                setattr(target, kind, getattr(source, kind))
        # PyVista makes scalars of what is added, which VTK then no longer takes for normals.
        if source.active_scalars_name not in target:
            target.active_scalars_name = None
    return new
