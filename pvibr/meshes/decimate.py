"""Simplification of parts."""

from __future__ import annotations

from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import pyvista as pv
import scipy  # whose modules load when they are first used

from pvibr.core import _vtk
from pvibr.meshes.parts import Part
from pvibr.meshes.surface_distance import Surface, hausdorff

_SMALL_PIECE = 20  # mean triangles per component up to which a mesh may be aggregate detail
_SMALL_SIZE = 0.1  # largest component of aggregate detail, relative to the mesh
_MISSED = 1.2  # triangles left, relative to the target, from which simplification has failed
_WRECKED = 0.02  # displacement, relative to the mesh, from which another algorithm is tried
_SAME_NORMAL = 1e-3
_JUMP = 0.1  # relative to an array's range: corners that differ by more stay apart
_TURN = 0.2  # the same for normals
_ROUGH_SAMPLES = 1000  # enough to tell whether a surface is wrecked
#: Relative to the mesh: offset of look-ups, so that they find the near side of a plate.
OUTWARD = 1e-5
#: PyVista's attributes that name the active arrays.
ACTIVE = 'active_scalars_name', 'active_normals_name', 'active_texture_coordinates_name'
_INWARD = 0.02  # fraction of the way to a triangle's centre at which its side of a seam is read


def lighter(part, share, weld=None) -> Part | None:
    """Return a simplified part with a share of the triangles, or None if it cannot be simplified.

    Cook et al., "Stochastic Simplification of Aggregate Detail", SIGGRAPH 2007; Garland and
    Heckbert, "Surface Simplification Using Quadric Error Metrics", SIGGRAPH 1997, and
    "Simplifying Surfaces with Color and Texture Using Quadric Error Metrics", 1998, by VTK.
    """
    welded = (weld or Weldings())(part)
    n_pieces, piece_labels = connected(welded.faces, len(welded.points))
    if is_scattered(welded, piece_labels, n_pieces):
        mesh = _thinned(part.mesh, welded, piece_labels, n_pieces, share)
    else:
        is_flat = part.actor.GetProperty().GetInterpolation() == 0
        mesh = _simplified(part.mesh, welded, share, flat=is_flat)
    return part.with_mesh(mesh) if mesh.n_cells else None


def displacement(part, light, weld=None) -> float:
    """Return the distance of a simplified surface from the part's."""
    if light.mesh is part.mesh:
        return 0.0
    full, coarse = map(weld or Weldings(), (part, light))
    points = (coarse.points * coarse.size + coarse.low - full.low) / full.size
    return full.size * hausdorff(full.surface, Surface(points, coarse.faces))


def connected(faces, n_points):
    """Return the number of connected components, and the component of each triangle."""
    starts, ends = faces[:, [0, 1]].T
    second_starts, second_ends = faces[:, [1, 2]].T
    i, j = np.concatenate([starts, second_starts]), np.concatenate([ends, second_ends])
    graph = scipy.sparse.coo_array((np.ones(len(i), np.int8), (i, j)), shape=(n_points, n_points))
    _, labels = scipy.sparse.csgraph.connected_components(graph, directed=False)
    components, labels = np.unique(labels[faces[:, 0]], return_inverse=True)
    return len(components), labels


@dataclass
class Welded:
    """The triangles of a mesh with coincident points merged, in units of the mesh's size."""

    points: np.ndarray  # float64, 0 to 1
    faces: np.ndarray  # without degenerate ones
    corners: np.ndarray  # the mesh's points at their corners
    cells: np.ndarray  # the mesh's triangles
    low: np.ndarray
    size: float

    @classmethod
    def of(cls, mesh) -> Welded:
        """Weld a mesh."""
        points, corners = np.asarray(mesh.points, float), np.asarray(mesh.regular_faces)
        low, size = points.min(0), float(np.ptp(points, axis=0).max()) or 1.0
        # In float32: copies of a point may differ in their last digits.
        local, local_ids = np.unique(
            ((points - low) / size).astype(np.float32), axis=0, return_inverse=True
        )
        faces = local_ids.reshape(-1)[corners]
        cells = np.flatnonzero((faces != np.roll(faces, 1, axis=1)).all(1))
        used_points, faces = np.unique(faces[cells], return_inverse=True)
        points = local[used_points].astype(float)
        return cls(points, faces.reshape(-1, 3), corners[cells], cells, low, size)

    @property
    def facets(self) -> np.ndarray:
        """The unit normals of the triangles."""
        return _facets(self.points, self.faces)

    @cached_property
    def surface(self) -> Surface:
        """The surface, for distances."""
        return Surface(self.points, self.faces)


class Weldings:
    """Welded meshes of parts, each welded once while this is in use."""

    def __init__(self):
        self._by_mesh: dict[int, tuple] = {}

    def __call__(self, part) -> Welded:
        """Return the welded mesh of a part."""
        mesh = part.mesh
        if id(mesh) not in self._by_mesh:
            self._by_mesh[id(mesh)] = mesh, Welded.of(mesh)  # the mesh, lest its id be reused
        return self._by_mesh[id(mesh)][1]


def is_surface(part, weld=None) -> bool:
    """Return True for a part that is neither cut out nor foliage."""
    return part.alpha_cutoff is None and not is_foliage((weld or Weldings())(part))


def is_foliage(welded) -> bool:
    """Return True for aggregate detail, such as leaves."""
    n_pieces, piece_labels = connected(welded.faces, len(welded.points))
    return is_scattered(welded, piece_labels, n_pieces)


def is_scattered(welded, labels, n_pieces) -> bool:
    """Return True for many small components, as leaves are."""
    if not n_pieces > _SMALL_PIECE or len(welded.faces) > _SMALL_PIECE * n_pieces:
        return False
    piece_order = np.argsort(labels, kind='stable')
    starts = np.searchsorted(labels[piece_order], np.arange(n_pieces))
    sorted_corners = welded.points[welded.faces[piece_order]]
    low = np.minimum.reduceat(sorted_corners.min(1), starts)
    high = np.maximum.reduceat(sorted_corners.max(1), starts)
    return bool((high - low).max() < _SMALL_SIZE)


def _thinned(mesh, welded, piece_labels, count, share):
    """Keep a random share of the pieces, enlarged so that their total area stays."""
    # Cook et al., "Stochastic simplification of aggregate detail", SIGGRAPH 2007.
    keep_piece = np.random.default_rng(0).permutation(count) < max(1, round(share * count))
    kept_faces = keep_piece[piece_labels]
    faces, cells = welded.corners[kept_faces], welded.cells[kept_faces]
    of_point = np.zeros(mesh.n_points, np.intp)
    of_point[faces.ravel()] = np.repeat(piece_labels[kept_faces], 3)
    point_ids = np.unique(faces)
    points = np.asarray(mesh.points, float)[point_ids]
    piece_of_point = of_point[point_ids]
    piece_sizes = np.maximum(np.bincount(piece_of_point, minlength=count), 1)[:, None]
    sums = np.stack([np.bincount(piece_of_point, points[:, k], count) for k in range(3)], 1)
    centers = (sums / piece_sizes)[piece_of_point]
    points = centers + (points - centers) / np.sqrt(keep_piece.mean())
    thinned = pv.PolyData()
    thinned.points = points.astype(mesh.points.dtype)
    thinned.regular_faces = np.searchsorted(point_ids, faces).astype(np.int64)
    return take_arrays(mesh, thinned, point_ids, cells)


def _simplified(mesh, welded, share, *, flat):
    columns = _Columns.of(mesh, welded, flat=flat)
    points, faces = _collapsed(welded, columns, share)
    if not 0 < len(faces) < max(_MISSED * share * mesh.n_cells, 1):
        return pv.PolyData()  # simplification got stuck
    return _with_arrays(mesh, welded, columns, points, faces)


def _collapsed(welded, columns, share):
    """Return simplified points and faces, by the algorithm that displaces the surface less."""
    points, faces = _by_vtk(welded, columns.metric(), share)
    if len(faces) and np.isfinite(points).all():
        surface = welded.surface
        distance = hausdorff(surface, Surface(points, faces), _ROUGH_SAMPLES)
        is_reduced = len(faces) < _MISSED * share * len(welded.faces)
        if is_reduced and distance < _WRECKED:
            return points, faces
        other = _by_fast_simplification(welded, share)
        if len(other[1]) and hausdorff(surface, Surface(*other), _ROUGH_SAMPLES) < distance:
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
    with _silent():  # VTK complains about singular matrices of flat parts; the result is checked
        decimate.Update()
    decimated = pv.wrap(decimate.GetOutput())
    return np.asarray(decimated.points, float), _proper(np.asarray(decimated.regular_faces))


def _by_fast_simplification(welded, share):
    import fast_simplification

    points, faces = fast_simplification.simplify(
        np.ascontiguousarray(welded.points, np.float32),
        np.ascontiguousarray(welded.faces, np.int32),
        target_reduction=1 - share,
    )
    return np.asarray(points, float), _proper(np.asarray(faces, int))


def _proper(faces):
    faces = faces.reshape(-1, 3)  # PyVista returns an empty array with one axis
    return faces[(faces != np.roll(faces, 1, axis=1)).all(1)]


@contextmanager
def _silent():
    warnings_on = _vtk.vtkObject.GetGlobalWarningDisplay()
    _vtk.vtkObject.SetGlobalWarningDisplay(False)
    try:
        yield
    finally:
        _vtk.vtkObject.SetGlobalWarningDisplay(warnings_on)


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
        """Gather the arrays of a mesh."""
        data = mesh.point_data
        arrays = {
            name: np.asarray(data[name], float).reshape(mesh.n_points, -1)[welded.corners]
            for name in data
        }
        normals = data.active_normals_name
        if flat or _is_faceted(arrays.get(normals)):  # facets get their own
            arrays.pop(normals, None)
            normals = None
        coordinates = data.active_texture_coordinates_name
        scalars = data.active_scalars_name
        if scalars not in arrays or scalars in (normals, coordinates):
            other_names = [n for n in arrays if n not in (normals, coordinates)]
            scalars = other_names[0] if other_names else None
        return cls(arrays, normals, coordinates, scalars, welded.faces)

    def metric(self) -> dict:
        """Return the values that simplification preserves, by the name of VTK's attributes."""
        names = {'Normals': self.normals, 'TCoords': self.coordinates, 'Scalars': self.scalars}
        metric = {}
        for kind, name in names.items():
            # Normals with seams are those of creases, which the geometry preserves.
            if name is None or (kind == 'Normals' and self.has_seams([name])):
                continue
            values = self.arrays[name]
            points = np.zeros((self.faces.max() + 1, values.shape[2]), np.float32)
            if kind == 'Normals':
                np.add.at(points, self.faces, values)
                points /= np.maximum(np.linalg.norm(points, axis=1, keepdims=True), 1e-30)
            else:
                points[self.faces] = values
            metric[kind] = np.nan_to_num(points)
        return metric

    def has_seams(self, names=None) -> bool:
        """Return True if triangles that share a point have different values there."""
        for name in names or self.arrays:
            values = self.arrays[name]
            at_points = np.zeros((self.faces.max() + 1, values.shape[2]))
            at_points[self.faces] = values
            if not np.array_equal(at_points[self.faces], values, equal_nan=True):
                return True
        return False

    def jumps(self, values, means):
        """Return the corners whose values are far from the mean of their point."""
        is_far = np.zeros(len(values[next(iter(values))]), bool)
        for name, corner_values in values.items():
            is_far |= (np.abs(corner_values - means[name]) > self.step(name)).any(1)
        return is_far

    def step(self, name) -> float:
        """Return how far values of an array may be apart at one point."""
        if name == self.normals:
            return _TURN
        values = self.arrays[name]
        return _JUMP * (float(np.nanmax(values) - np.nanmin(values)) or 1.0)


def _is_faceted(normals):
    return normals is not None and bool(np.ptp(normals, axis=1).max() < _SAME_NORMAL)


def _with_arrays(mesh, welded, columns, points, faces):
    """Return a mesh of simplified triangles, with arrays looked up on the surface."""
    surface = welded.surface
    facets = _facets(points, faces)
    used_ids, faces = np.unique(faces, return_inverse=True)
    points, faces = points[used_ids], faces.reshape(-1, 3)
    point_normals = np.zeros_like(points)
    np.add.at(point_normals, faces, facets[:, None])
    point_normals /= np.maximum(np.linalg.norm(point_normals, axis=1, keepdims=True), 1e-300)
    values = _looked_up(columns.arrays, surface, points, point_normals)
    place, faces, values = _split(columns, surface, points, faces, facets, values)
    simplified = pv.PolyData()
    simplified.points = (points[place] * welded.size + welded.low).astype(mesh.points.dtype)
    simplified.regular_faces = faces
    for name, point_values in values.items():
        dtype = mesh.point_data[name].dtype if name in mesh.point_data else np.dtype('f4')
        simplified.point_data[name] = _as_kind(point_values, dtype)
    source_cells = None
    if mesh.cell_data.keys():
        outside = points[place[faces]].mean(1) + OUTWARD * facets
        source_cells = welded.cells[surface.nearest(outside)[0]]
    take_arrays(mesh, simplified, None, source_cells)
    return simplified if columns.normals is None else _unflipped(simplified, mesh)


def _facets(points, faces):
    normals = np.cross(*(points[faces[:, k]] - points[faces[:, 0]] for k in (1, 2)))
    return normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-300)


def _looked_up(arrays, surface, positions, normals):
    """Return the values of arrays at the nearest points of a surface's outer side."""
    triangles, weights, _ = surface.nearest(positions + OUTWARD * normals)
    return {n: np.einsum('ij,ijk->ik', weights, a[triangles]) for n, a in arrays.items()}


def _split(columns, surface, points, faces, facets, values):
    """Return the place of each point, faces and values, with points duplicated along seams."""
    place = np.arange(len(points))
    if not columns.has_seams():
        return place, faces, values
    inward = points[faces] + _INWARD * (points[faces].mean(1, keepdims=True) - points[faces])
    normals = np.repeat(facets, 3, axis=0)
    at_corners = _looked_up(columns.arrays, surface, inward.reshape(-1, 3), normals)
    flat = faces.ravel()
    counts = np.bincount(flat, minlength=len(points))[:, None]
    means = {
        n: np.stack([np.bincount(flat, v, len(points)) for v in array.T], 1) / counts
        for n, array in at_corners.items()
    }
    is_torn = np.zeros(len(points), bool)
    is_torn[flat[columns.jumps(at_corners, {n: m[flat] for n, m in means.items()})]] = True
    torn = np.flatnonzero(is_torn[flat])
    quantized = [np.rint(array[torn] / columns.step(n)) for n, array in at_corners.items()]
    keys = np.column_stack([flat[torn], *quantized])
    keys, first_ids, copy_ids = np.unique(keys, axis=0, return_index=True, return_inverse=True)
    corner_ids = flat.copy()
    corner_ids[torn] = len(points) + copy_ids.reshape(-1)
    place = np.concatenate([place, keys[:, 0].astype(int)])
    values = {n: np.concatenate([v, at_corners[n][torn[first_ids]]]) for n, v in values.items()}
    used_points, corner_ids = np.unique(corner_ids, return_inverse=True)
    values = {n: v[used_points] for n, v in values.items()}
    return place[used_points], corner_ids.reshape(-1, 3), values


def _as_kind(values, dtype):
    values = values[:, 0] if values.shape[1] == 1 else values
    if dtype.kind in 'iu':
        info = np.iinfo(dtype)
        return np.clip(np.rint(values), info.min, info.max).astype(dtype)
    return values.astype(dtype) if dtype.kind == 'f' else values > 0.5


def _unflipped(mesh, source):
    """Reverse triangles that collapsing flipped: VTK would light their backs."""
    faces = np.array(mesh.regular_faces)
    is_flipped = _signed_areas(mesh) * np.sign(_signed_areas(source).sum()) < 0
    faces[is_flipped] = faces[is_flipped, ::-1]
    mesh.regular_faces = faces
    return mesh


def _signed_areas(mesh):
    """Return the signed areas of triangles, negative if they face away from their normals."""
    faces = np.asarray(mesh.regular_faces)
    a, b, c = np.asarray(mesh.points, float)[faces.T]
    normal_sums = np.asarray(mesh.point_data.active_normals, float)[faces].sum(1)
    return (np.cross(b - a, c - a) * normal_sums).sum(1)


def take_arrays(source, target, points, cells):
    """Copy the arrays of a mesh at points and cells, None for none of these; return the target."""
    for from_data, to_data, ids in (
        (source.point_data, target.point_data, points),
        (source.cell_data, target.cell_data, cells),
    ):
        for name in from_data if ids is not None else ():
            to_data[name] = np.asarray(from_data[name])[ids]
        for kind in ACTIVE:
            if getattr(from_data, kind) in to_data:
                setattr(to_data, kind, getattr(from_data, kind))
        # PyVista activates any array that is added, and VTK no longer uses it as normals.
        if from_data.active_scalars_name not in to_data:
            to_data.active_scalars_name = None
    return target
