"""Samples on the surface of a mesh that stand for its points or cells."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pyvista as pv

from pvibr.core.params import checked_flag
from pvibr.maths.arguments import check_one_of, checked_each
from pvibr.maths.vectors import unit_vectors
from pvibr.scene.item_set import ItemSet
from pvibr.scene.thing import Thing

#: How far points are moved into the faces that they belong to, as a share of the way.
_INWARD = 1e-3


@dataclass(frozen=True, eq=False)
class Samples:
    """Samples on the faces of a mesh that stand for its points or cells."""

    points: np.ndarray
    normals: np.ndarray
    owner: np.ndarray
    count: int
    corner: np.ndarray
    area: np.ndarray

    @classmethod
    def of(cls, mesh, to) -> Samples:
        """Return samples of a mesh: triangle centroids, or points near the corners."""
        check_one_of('to', to, ('points', 'cells'))
        if not isinstance(mesh, pv.DataSet):
            raise TypeError(f'mesh = {mesh!r:.80}: must be a mesh')
        corner, cell = _triangles(mesh)
        places = np.moveaxis(np.asarray(mesh.points, float)[corner.T], 0, 1)
        normals, area = normals_and_areas(places)
        middle = (places[:, 0] + places[:, 1] + places[:, 2]) / 3
        if to == 'cells':
            return cls(middle, normals, cell, mesh.n_cells, corner, area)
        inward = places + _INWARD * (middle[:, None] - places)
        alone = np.setdiff1d(np.arange(mesh.n_points), corner)
        return cls(
            np.concatenate([inward.reshape(-1, 3), np.asarray(mesh.points, float)[alone]]),
            np.concatenate([np.repeat(normals, 3, 0), np.zeros((len(alone), 3))]),
            np.concatenate([corner.ravel(), alone]),
            mesh.n_points,
            np.concatenate([np.repeat(corner, 3, 0), np.stack([alone] * 3, 1)]),
            np.concatenate([np.repeat(area, 3), np.zeros(len(alone))]),
        )

    @classmethod
    def at(cls, points, normals, corner=None, area=None) -> Samples:
        """Return samples that stand for themselves."""
        n = len(points)
        corner = np.zeros((n, 3), int) if corner is None else corner
        return cls(points, normals, np.arange(n), n, corner, np.zeros(n) if area is None else area)

    def facing(self, toward, two_sided) -> np.ndarray:
        """Return the cosines between normals and directions, (m,); 1 without normals."""
        cosine = np.einsum('ij,ij->i', self.normals, toward)
        cosine = np.abs(cosine) if not two_sided else two_sided * cosine
        return np.where(_squares(self.normals) > 0, cosine, 1.0)

    def turned(self, toward) -> np.ndarray:
        """Return normals flipped to the side of directions, (m, 3)."""
        side = np.where(np.einsum('ij,ij->i', self.normals, toward) < 0, -1.0, 1.0)
        none = _squares(self.normals) == 0
        normals = side[:, None] * self.normals
        normals[none] = toward[none]
        return normals

    def most(self, values) -> np.ndarray:
        """Return the largest value of each owner, (count,); 0 for one without samples."""
        found = np.zeros(self.count)
        np.maximum.at(found, self.owner, values)
        return found

    def mean(self, values, weights) -> np.ndarray:
        """Return the weighted mean of each owner, (count, c); NaN where all weights are 0."""
        total = np.bincount(self.owner, weights, self.count)
        values = np.where(weights[:, None] > 0, values, 0.0)
        sums = [np.bincount(self.owner, weights * c, self.count) for c in values.T]
        with np.errstate(invalid='ignore', divide='ignore'):
            return np.stack(sums, 1) / total[:, None]


def _triangles(mesh):
    """Return the triangles of a mesh's surface by its points, and their cells in the mesh."""
    if isinstance(mesh, pv.PolyData):
        if mesh.is_all_triangles:
            return mesh.regular_faces, np.arange(mesh.n_cells)
        surface = mesh.copy(deep=False)
        surface.clear_data()
        point, cell = np.arange(mesh.n_points), np.arange(mesh.n_cells)
    else:
        surface = mesh.extract_surface(pass_pointid=True, pass_cellid=True, algorithm=None)
        point = np.asarray(surface['vtkOriginalPointIds'])
        cell = np.asarray(surface['vtkOriginalCellIds'])
        surface.clear_data()
    surface.cell_data['cell'] = cell
    faces = surface if surface.is_all_triangles else surface.triangulate()
    return point[faces.regular_faces.reshape(-1, 3)], np.asarray(faces.cell_data['cell'])


def normals_and_areas(corners) -> tuple[np.ndarray, np.ndarray]:
    """Return unit normals (n, 3), zero for degenerate triangles, and areas (n,)."""
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    return unit_vectors(across), np.sqrt(_squares(across)) / 2


def _squares(vectors):
    return np.einsum('ij,ij->i', vectors, vectors)


def surface_of(thing) -> pv.PolyData:
    """Return the surface of a mesh or an actor in world units, without data."""
    matrix = None
    if hasattr(thing, 'GetMapper'):
        matrix = pv.array_from_vtkmatrix(thing.GetMatrix())
        mapper = thing.GetMapper()
        mapper.Update()
        thing = pv.wrap(mapper.GetInput())
    if isinstance(thing, pv.MultiBlock):
        thing = thing.combine()
    if not isinstance(thing, pv.DataSet):
        raise TypeError(f'{thing!r:.100} is no mesh and no actor.')
    surface = thing if isinstance(thing, pv.PolyData) else thing.extract_surface(algorithm=None)
    points = np.asarray(surface.points, np.float64)
    if matrix is not None:
        points = points @ matrix[:3, :3].T + matrix[:3, 3]
    return with_points(surface, points)


def surfaces_of(casters) -> list[pv.PolyData]:
    """Return the surfaces of meshes, actors and things, of these those that are visible."""
    found: list = []
    for caster in checked_each('casters', casters, _is_surface, 'meshes, actors or things'):
        found += _surfaces_of_thing(caster) if isinstance(caster, Thing) else [surface_of(caster)]
    return found


def _is_surface(one) -> bool:
    return isinstance(one, pv.DataSet | pv.MultiBlock | Thing) or hasattr(one, 'GetMapper')


def _surfaces_of_thing(thing) -> list:
    if isinstance(thing, ItemSet):
        thing.follow()
        shown = np.flatnonzero(thing.visible) if thing.visibility else ()
        return [surface_of(thing.item_mesh(int(i))) for i in shown]
    solids = thing.solids()
    if None in solids:
        raise TypeError(
            f'{thing.name} has no mesh that hides light; casters are meshes, actors, instances, '
            f'figures or impostors.'
        )
    return [surface_of(actor) for actor in solids]


def with_points(surface, points):
    """Return a copy of a surface with other points and no data."""
    found = surface.copy(deep=False)
    found.clear_data()
    found.SetPoints(pv.vtk_points(points))  # setting `points` would write into the given one's
    return found


def bounds_of(surfaces) -> np.ndarray:
    """Return the bounds of non-empty surfaces, (n, 6)."""
    return np.array([s.bounds for s in surfaces if s.n_points], float).reshape(-1, 6)


def sides_of(mesh, two_sided) -> int:
    """Return which side of a mesh's faces is outside, 1 or -1; 0 where both count."""
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
    # Around a vertex within a surface what its triangles add cancels: only others are looked at.
    mark = np.random.default_rng(0).integers(1 << 40, size=len(points)).astype(float)
    sums = np.zeros(len(points))
    for k in range(3):
        ahead, behind = mark[faces[:, k - 2]], mark[faces[:, k - 1]]
        sums += np.bincount(faces[:, k], ahead - behind, len(points))
    doubtful = sums != 0
    faces = faces[doubtful[faces[:, 0]] | doubtful[faces[:, 1]] | doubtful[faces[:, 2]]]
    numbers, used = np.unique(faces, return_inverse=True)
    _, merged = np.unique(points[numbers], axis=0, return_inverse=True)
    corners, doubtful = merged.ravel()[used].reshape(-1, 3), doubtful[faces]
    whole = (corners != np.roll(corners, 1, 1)).all(1)
    ends, sure = corners[whole][:, [0, 1, 1, 2, 2, 0]], doubtful[whole][:, [0, 1, 1, 2, 2, 0]]
    edges = np.sort(ends.reshape(-1, 2)[sure.reshape(-1, 2).all(1)], 1)
    return bool((np.unique(edges, axis=0, return_counts=True)[1] % 2).any())
