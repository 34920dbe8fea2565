"""Samples on mesh surfaces that represent points or cells, and helpers for surfaces."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pyvista as pv

from pvibr.core.arguments import check_one_of, checked_each
from pvibr.core.params import checked_flag
from pvibr.maths.vectors import unit_vectors
from pvibr.things.item_set import ItemSet
from pvibr.things.thing import Thing

#: Inset of corner samples towards the centroid of their face, as a fraction.
_INWARD = 1e-3


@dataclass(frozen=True, eq=False)
class Samples:
    """Samples on the faces of a mesh that represent its points or cells, their owners."""

    points: np.ndarray
    normals: np.ndarray
    owner: np.ndarray
    count: int
    corner: np.ndarray
    area: np.ndarray

    @classmethod
    def of(cls, mesh, to) -> Samples:
        """Return samples of a mesh: triangle centroids, or points just inside the corners."""
        check_one_of('to', to, ('points', 'cells'))
        if not isinstance(mesh, pv.DataSet):
            raise TypeError(f'mesh must be a pyvista.DataSet, got {mesh!r:.80}')
        corner, face_cells = _triangles(mesh)
        corner_points = np.moveaxis(np.asarray(mesh.points, float)[corner.T], 0, 1)
        normals, area = normals_and_areas(corner_points)
        centroids = (corner_points[:, 0] + corner_points[:, 1] + corner_points[:, 2]) / 3
        if to == 'cells':
            return cls(centroids, normals, face_cells, mesh.n_cells, corner, area)
        inset_corners = corner_points + _INWARD * (centroids[:, None] - corner_points)
        loose = np.setdiff1d(np.arange(mesh.n_points), corner)
        return cls(
            np.concatenate([inset_corners.reshape(-1, 3), np.asarray(mesh.points, float)[loose]]),
            np.concatenate([np.repeat(normals, 3, 0), np.zeros((len(loose), 3))]),
            np.concatenate([corner.ravel(), loose]),
            mesh.n_points,
            np.concatenate([np.repeat(corner, 3, 0), np.stack([loose] * 3, 1)]),
            np.concatenate([np.repeat(area, 3), np.zeros(len(loose))]),
        )

    @classmethod
    def at(cls, points, normals, corner=None, area=None) -> Samples:
        """Return samples that own themselves."""
        n = len(points)
        corner = np.zeros((n, 3), int) if corner is None else corner
        return cls(points, normals, np.arange(n), n, corner, np.zeros(n) if area is None else area)

    def facing(self, directions, two_sided) -> np.ndarray:
        """Return the cosines between normals and directions, (m,); 1 without normals."""
        cosines = np.einsum('ij,ij->i', self.normals, directions)
        cosines = np.abs(cosines) if not two_sided else two_sided * cosines
        return np.where(_squares(self.normals) > 0, cosines, 1.0)

    def turned(self, directions) -> np.ndarray:
        """Return normals flipped to face directions, (m, 3)."""
        side = np.where(np.einsum('ij,ij->i', self.normals, directions) < 0, -1.0, 1.0)
        no_normal = _squares(self.normals) == 0
        normals = side[:, None] * self.normals
        normals[no_normal] = directions[no_normal]
        return normals

    def most(self, values) -> np.ndarray:
        """Return the largest value of each owner, (count,); 0 without samples."""
        maxima = np.zeros(self.count)
        np.maximum.at(maxima, self.owner, values)
        return maxima

    def mean(self, values, weights) -> np.ndarray:
        """Return the weighted mean of each owner, (count, c); NaN where all weights are 0."""
        weight_sums = np.bincount(self.owner, weights, self.count)
        values = np.where(weights[:, None] > 0, values, 0.0)
        sums = [np.bincount(self.owner, weights * c, self.count) for c in values.T]
        with np.errstate(invalid='ignore', divide='ignore'):
            return np.stack(sums, 1) / weight_sums[:, None]

    def filled(self, colors, is_covered) -> np.ndarray:
        """Return the colours of points, mean ones of covered neighbours where a point is not."""
        near = is_covered[self.corner].astype(float)
        sums, counts = np.einsum('mk,mkc->mc', near, colors[self.corner]), near.sum(1)
        means = self.mean(sums / np.maximum(counts, 1)[:, None], counts)
        to_fill = ~is_covered & np.isfinite(means).all(1)
        filled_colors = colors.copy()
        filled_colors[to_fill] = np.rint(means[to_fill])
        return filled_colors


def _triangles(mesh):
    """Return the triangles of a mesh's surface, as point and cell indices of the mesh."""
    if isinstance(mesh, pv.PolyData):
        if mesh.is_all_triangles:
            return mesh.regular_faces, np.arange(mesh.n_cells)
        surface = mesh.copy(deep=False)
        surface.clear_data()
        point_ids, cell_ids = np.arange(mesh.n_points), np.arange(mesh.n_cells)
    else:
        surface = mesh.extract_surface(pass_pointid=True, pass_cellid=True, algorithm=None)
        point_ids = np.asarray(surface['vtkOriginalPointIds'])
        cell_ids = np.asarray(surface['vtkOriginalCellIds'])
        surface.clear_data()
    surface.cell_data['cell'] = cell_ids
    faces = surface if surface.is_all_triangles else surface.triangulate()
    return point_ids[faces.regular_faces.reshape(-1, 3)], np.asarray(faces.cell_data['cell'])


def normals_and_areas(corners) -> tuple[np.ndarray, np.ndarray]:
    """Return unit normals (n, 3), zero for degenerate triangles, and areas (n,)."""
    double_areas = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    return unit_vectors(double_areas), np.sqrt(_squares(double_areas)) / 2


def _squares(vectors):
    return np.einsum('ij,ij->i', vectors, vectors)


def edges_of(faces) -> np.ndarray:
    """Return the directed edges of triangles, (3 n, 2): all first edges, then second, third."""
    return np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])


def polydata_of(mesh) -> pv.PolyData:
    """Return the surface of a mesh, itself if it is PolyData."""
    return mesh if isinstance(mesh, pv.PolyData) else mesh.extract_surface(algorithm=None)


def surface_of(mesh_or_actor) -> pv.PolyData:
    """Return the surface of a mesh or an actor in world units, without data."""
    matrix = None
    if hasattr(mesh_or_actor, 'GetMapper'):
        matrix = pv.array_from_vtkmatrix(mesh_or_actor.GetMatrix())
        mapper = mesh_or_actor.GetMapper()
        mapper.Update()
        mesh_or_actor = pv.wrap(mapper.GetInput())
    if isinstance(mesh_or_actor, pv.MultiBlock):
        mesh_or_actor = mesh_or_actor.combine()
    if not isinstance(mesh_or_actor, pv.DataSet):
        raise TypeError(f'mesh must be a pyvista.DataSet or an actor, got {mesh_or_actor!r:.100}')
    surface = polydata_of(mesh_or_actor)
    points = np.asarray(surface.points, np.float64)
    if matrix is not None:
        points = points @ matrix[:3, :3].T + matrix[:3, 3]
    return with_points(surface, points)


def surfaces_of(casters) -> list[pv.PolyData]:
    """Return the surfaces of meshes, actors and visible things."""
    surfaces: list = []
    for caster in checked_each('casters', casters, _is_surface, 'meshes, actors or things'):
        is_thing = isinstance(caster, Thing)
        surfaces += _surfaces_of_thing(caster) if is_thing else [surface_of(caster)]
    return surfaces


def _is_surface(value) -> bool:
    return isinstance(value, pv.DataSet | pv.MultiBlock | Thing) or hasattr(value, 'GetMapper')


def _surfaces_of_thing(item) -> list:
    if isinstance(item, ItemSet):
        item.follow()
        visible_items = np.flatnonzero(item.drawn_items()) if item.visibility else ()
        return [surface_of(item.item_mesh(int(i))) for i in visible_items]
    solids = item.solids()
    if None in solids:
        raise TypeError(
            f'casters must be meshes, actors, instances, figures or impostors, got {item.name}, '
            f'which has no mesh'
        )
    return [surface_of(actor) for actor in solids]


def with_points(surface, points):
    """Return a copy of a surface with other points and no data."""
    moved_surface = surface.copy(deep=False)
    moved_surface.clear_data()
    moved_surface.SetPoints(pv.vtk_points(points))  # `points =` would write into the original's
    return moved_surface


def bounds_of(surfaces) -> np.ndarray:
    """Return the bounds of non-empty surfaces, (n, 6)."""
    return np.array([s.bounds for s in surfaces if s.n_points], float).reshape(-1, 6)


def sides_of(mesh, two_sided) -> int:
    """Return which side of a mesh's faces is outside, 1 or -1; 0 if two-sided."""
    if two_sided is not None:
        return 0 if checked_flag('two_sided', two_sided) else 1
    surface = surface_of(mesh)
    faces = triangles_of(surface)
    points = surface.points - surface.center
    if not len(faces) or _is_open(points, faces):
        return 0
    a, b, c = (points[faces[:, k]] for k in range(3))
    return 1 if np.einsum('ij,ij->', a, np.cross(b, c)) > 0 else -1


def triangles_of(surface) -> np.ndarray:
    """Return a surface's triangles, (n, 3) int."""
    flat = surface if surface.is_all_triangles else surface.triangulate()
    return flat.regular_faces.reshape(-1, 3)


def _is_open(points, faces) -> bool:
    """Return whether an edge has an odd number of triangles; equal points count as one."""
    # Random marks cancel around inner vertices of a closed surface: test only the other faces.
    point_marks = np.random.default_rng(0).integers(1 << 40, size=len(points)).astype(float)
    sums = np.zeros(len(points))
    for k in range(3):
        ahead, behind = point_marks[faces[:, k - 2]], point_marks[faces[:, k - 1]]
        sums += np.bincount(faces[:, k], ahead - behind, len(points))
    is_doubtful_point = sums != 0
    faces = faces[
        is_doubtful_point[faces[:, 0]]
        | is_doubtful_point[faces[:, 1]]
        | is_doubtful_point[faces[:, 2]]
    ]
    point_ids, point_rows = np.unique(faces, return_inverse=True)
    _, merged = np.unique(points[point_ids], axis=0, return_inverse=True)
    corners = merged.ravel()[point_rows].reshape(-1, 3)
    is_doubtful_point = is_doubtful_point[faces]
    is_triangle = (corners != np.roll(corners, 1, 1)).all(1)
    edges, is_doubtful = edges_of(corners[is_triangle]), edges_of(is_doubtful_point[is_triangle])
    edges = np.sort(edges[is_doubtful.all(1)], 1)
    return bool((np.unique(edges, axis=0, return_counts=True)[1] % 2).any())
