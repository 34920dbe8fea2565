"""One level of one block: its cells simplified, alone, as a process of its own can do it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from pvibr.large.cells import blocks_of, kd_cells
from pvibr.large.hierarchy import NO_CELL
from pvibr.large.merged_vertices import merged_vertices
from pvibr.large.simplified_cell import Cell, edges_once, simplify_cell
from pvibr.large.textured_cell import closest_weights
from pvibr.large.wedges import Wedges

#: Random samples of the full mesh by which the error of a cell is measured, and how many of those
#: farthest off are measured again.
_SAMPLES, _FARTHEST = 960, 64
#: Of the random ones, those by which it is known what the shading of a cell loses.
_PROBES = 256
#: Area of a vertex relative to the square of the mesh's diagonal, at least: one without area
#: counts as little as can be, but has its own values.
_LEAST_AREA = 1e-20
#: Triangles whose normals are computed at once.
_PIECE = 1 << 18

#: Arrays of the triangles of a level, and of its samples of the full mesh.
TRIANGLE_ARRAYS = 'faces', 'is_border', 'made_by', 'mesh_cells', 'edge_flags', 'coordinates'
SAMPLE_ARRAYS = (
    *('samples', 'sample_vertices', 'sample_faces', 'sample_distances'),
    'sample_coordinates',
)
#: Arrays of vertices.
VERTEX_ARRAYS = 'points', 'areas', 'normals'
#: Arrays of the patches of a hierarchy.
PATCH_ARRAYS = 'patch_cells', 'patch_boxes', 'patch_sizes'


@dataclass
class Block:
    """Neighbouring triangles of a level, and what is needed to simplify them.

    Vertices are places among `points`; cells are those of the hierarchy.
    """

    #: What its random numbers follow.
    seed: tuple[int, int]
    #: Bounds of the full mesh.
    bounds: np.ndarray
    #: Length of a unit of texture coordinates, if there are any.
    texture_unit: float
    #: Arrays of its vertices, triangles and samples by name; those of the full mesh have no areas
    #: and borders yet, and samples are known by their vertices alone.
    vertices: dict[str, np.ndarray]
    triangles: dict[str, np.ndarray]
    samples: dict[str, np.ndarray]
    #: Whether vertices are of another block of the full mesh as well.
    is_shared: np.ndarray | None
    #: Cells that made triangles, in order, their errors and boxes.
    cells: np.ndarray
    cell_errors: np.ndarray
    cell_boxes: np.ndarray
    #: Planes that divide the next level into blocks.
    planes: np.ndarray
    #: Whether there is no next level.
    is_last: bool = False


@dataclass
class SimplifiedBlock:
    """What a block adds to a hierarchy, and leaves to the next level.

    New vertices follow those of the block; new cell k is ``-2 - k``.
    """

    has_changed: bool
    #: Arrays of the next level, in the order of its blocks.
    triangles: dict[str, np.ndarray]
    samples: dict[str, np.ndarray]
    #: Blocks of the next level with its numbers of triangles and samples, (n, 3).
    segments: np.ndarray
    #: Areas and normals of the vertices of a block of the full mesh, by its own triangles.
    own_vertices: dict[str, np.ndarray]
    new_vertices: dict[str, np.ndarray]
    #: Vertices that were merged, and into which, (n, 2).
    merges: np.ndarray
    cells: dict[str, np.ndarray]
    #: Places of vertices of the full mesh on cells, as in a hierarchy.
    probes: dict[str, np.ndarray]
    #: Patches of the full mesh, and others; with vertices, triangles and cells of the mesh.
    full_patches: dict[str, np.ndarray]
    other_patches: dict[str, np.ndarray]


def simplified_block(block: Block) -> SimplifiedBlock:
    """Return a block with its cells simplified."""
    return _Simplification(block).result()


@dataclass
class _Patches:
    """Patches in the making."""

    cells: list[tuple[int, int]] = field(default_factory=list)
    boxes: list[np.ndarray] = field(default_factory=list)
    vertices: list[np.ndarray] = field(default_factory=list)
    triangles: list[np.ndarray] = field(default_factory=list)
    mesh_cells: list[np.ndarray] = field(default_factory=list)
    edge_flags: list[np.ndarray] = field(default_factory=list)
    coordinates: list[np.ndarray] = field(default_factory=list)

    def arrays(self) -> dict[str, np.ndarray]:
        """Return the arrays of all patches."""
        sizes = [(len(v), len(t)) for v, t in zip(self.vertices, self.triangles, strict=True)]
        return {
            'patch_cells': np.array(self.cells, np.int32).reshape(-1, 2),
            'patch_boxes': np.array(self.boxes, float).reshape(-1, 2, 3),
            'patch_sizes': np.array(sizes, np.int64).reshape(-1, 2),
            'vertices': np.concatenate([np.zeros(0, np.int32), *self.vertices]),
            'triangles': np.concatenate([np.zeros((0, 3), np.uint16), *self.triangles]),
            'mesh_cells': np.concatenate([np.zeros(0, np.int64), *self.mesh_cells]),
            'edge_flags': np.concatenate([np.zeros(0, np.uint8), *self.edge_flags]),
            'texture_coordinates': np.concatenate(
                [np.zeros((0, 2), np.float32), *self.coordinates]
            ),
        }


class _Simplification:
    """A block while its cells are simplified."""

    def __init__(self, block: Block):
        self._block, self._rng = block, np.random.default_rng(block.seed)
        self._own_vertices: dict[str, np.ndarray] = {}
        self._points = block.vertices['points']
        self._faces = block.triangles['faces']
        self._wedges: Wedges | None = None
        if 'coordinates' in block.triangles:
            self._wedges = Wedges(self._faces, block.triangles['coordinates'])
        #: Marks and places of vertices, or of wedges, in `_compact`.
        count = len(self._points if self._wedges is None else self._wedges.vertices)
        self._is_used = np.zeros(max(count, len(self._points)), bool)
        self._places = np.empty(len(self._is_used), np.int32)
        if block.is_shared is not None:
            self._prepare_full_mesh(block.is_shared)
        self._made_by = block.triangles['made_by']
        self._errors: list[float] = []
        self._boxes: list[np.ndarray] = []
        self._probes = [np.zeros((0, 5), np.int32)]
        self._probe_weights = [np.zeros((0, 3), np.float32)]
        self._full, self._other = _Patches(), _Patches()
        self._vertex_count = len(self._points)
        self._new_vertices = [{n: v[:0] for n, v in block.vertices.items()}]
        self._merges: list[np.ndarray] = [np.zeros((0, 2), np.int32)]

    def _prepare_full_mesh(self, is_shared):
        """Set areas and normals of vertices, borders, and all vertices as samples."""
        block, count = self._block, len(self._points)
        areas, normals = areas_and_normals(self._points, self._faces, block.bounds)
        self._own_vertices['areas'] = areas
        if 'normals' not in block.vertices:
            self._own_vertices['normals'] = normals
        block.vertices |= self._own_vertices
        block.vertices['normals'] = unit(block.vertices['normals'])
        # Where blocks meet no edge is known to be of the mesh's border: it stays as it is.
        is_seam = is_shared[self._faces] & is_shared[np.roll(self._faces, -1, axis=1)]
        block.triangles['is_border'] = edges_once(self._faces, count) & ~is_seam
        owners = np.empty(count, np.int32)
        owners[self._faces.ravel()] = np.repeat(np.arange(len(self._faces), dtype=np.int32), 3)
        block.samples |= {
            'samples': self._points,
            'sample_faces': owners,
            'sample_distances': np.zeros(count, np.float32),
        }
        if self._wedges is not None:
            unit_length = block.texture_unit
            # On the side of a seam where they have these coordinates.
            owners, coordinates = self._wedges.samples(self._points, self._faces, unit_length)
            block.samples['sample_faces'] = owners
            block.samples['sample_coordinates'] = coordinates.astype(np.float32)

    def result(self) -> SimplifiedBlock:
        """Simplify all cells."""
        centers = self._centers(self._points, self._faces)
        cells = kd_cells(centers, self._rng)
        parts: list[tuple[dict[str, np.ndarray], dict[str, np.ndarray]]] = []
        if self._block.is_last:
            for ids in cells:
                self._record(ids, NO_CELL)
        else:
            samples_of_cells = self._samples_of(cells)
            jobs = self._jobs(cells, samples_of_cells)
            for job, ids, samples in zip(jobs, cells, samples_of_cells, strict=True):
                own_vertices, own_wedges, cell = job
                simplified = simplify_cell(cell)
                if simplified is None:
                    parts.append(self._kept(ids, samples))
                    continue
                part = self._replaced(ids, samples, own_vertices, simplified)
                if self._wedges is not None:
                    part[0]['coordinates'] = self._wedges.simplified(
                        own_wedges, simplified.texture, simplified.is_new
                    )
                parts.append(part)
        triangles, samples, segments = self._divided(parts)
        errors = np.array(self._errors, float)
        boxes = np.array(self._boxes, float).reshape(-1, 2, 3)
        return SimplifiedBlock(
            len(errors) > 0,
            triangles,
            samples,
            segments,
            self._own_vertices,
            _joined(self._new_vertices),
            np.concatenate(self._merges),
            {'errors': errors, 'boxes': boxes},
            {
                'probes': np.concatenate(self._probes),
                'probe_weights': np.concatenate(self._probe_weights),
            },
            self._full.arrays(),
            self._other.arrays(),
        )

    @staticmethod
    def _centers(points, faces) -> np.ndarray:
        return (points[faces[:, 0]] + points[faces[:, 1]] + points[faces[:, 2]]) / np.float32(3)

    def _jobs(self, cells, samples_of_cells) -> Iterator[tuple[np.ndarray, Any, Cell]]:
        """Yield the vertices and the wedges of each cell, and the cell to simplify."""
        is_border = self._block.triangles['is_border']
        all_samples = self._block.samples['samples']
        for ids, samples in zip(cells, samples_of_cells, strict=True):
            own_vertices, faces = self._compact(self._faces[ids])
            own_wedges, texture = None, None
            if self._wedges is not None:
                coordinates = self._block.samples['sample_coordinates'][samples].astype(float)
                own_wedges, texture = self._wedges.cell(ids, coordinates)
            cell = Cell(
                self._points[own_vertices].astype(float),
                faces,
                is_border[ids],
                all_samples[samples].astype(float),
                min(len(samples), _SAMPLES),
                self._block.bounds,
                texture,
            )
            yield own_vertices, own_wedges, cell

    def _compact(self, faces) -> tuple[np.ndarray, np.ndarray]:
        """Return the vertices of faces, and the faces as places among these."""
        self._is_used[faces] = True
        own_vertices = np.flatnonzero(self._is_used)
        self._is_used[own_vertices] = False
        self._places[own_vertices] = np.arange(len(own_vertices), dtype=np.int32)
        return own_vertices, self._places[faces]

    def _samples_of(self, cells) -> list[np.ndarray]:
        """Return the samples of each cell, at most as many as it needs."""
        cell_of_face = np.empty(len(self._faces), np.int32)
        for k, ids in enumerate(cells):
            cell_of_face[ids] = k
        cell_of_sample = cell_of_face[self._block.samples['sample_faces']]
        order = np.argsort(cell_of_sample, kind='stable')
        ends = np.searchsorted(cell_of_sample[order], np.arange(1, len(cells)))
        return [self._some(ids) for ids in np.split(order, ends)]

    def _some(self, ids) -> np.ndarray:
        """Return random samples of some, then those farthest off: small pieces have few."""
        if len(ids) <= _SAMPLES + _FARTHEST:
            return ids
        distances = self._block.samples['sample_distances'][ids]
        order = np.argpartition(distances, -_FARTHEST)
        others = ids[order[:-_FARTHEST]]
        farthest = ids[order[-_FARTHEST:]]
        return np.append(self._rng.choice(others, _SAMPLES, replace=False), farthest)

    def _kept(self, ids, samples):
        """Return the triangles and samples of a cell that could not be simplified."""
        triangles = {name: values[ids] for name, values in self._block.triangles.items()}
        kept = {name: values[samples] for name, values in self._block.samples.items()}
        kept['sample_faces'] = np.searchsorted(ids, kept['sample_faces'])
        return triangles, kept

    def _replaced(self, ids, samples, own_vertices, simplified):
        """Return the triangles and samples of a simplified cell, and note what it replaces."""
        numbers = own_vertices[simplified.continued].astype(np.int32)
        is_new = np.flatnonzero(simplified.is_new)
        numbers[is_new] = self._vertex_count + np.arange(len(is_new))
        self._vertex_count += len(is_new)
        targets = simplified.merged_into
        children = np.flatnonzero(targets >= 0)
        children = children[simplified.is_new[targets[children]]]
        self._merges.append(np.c_[own_vertices, numbers[targets]][children].astype(np.int32))
        own = {name: values[own_vertices] for name, values in self._block.vertices.items()}
        self._new_vertices.append(merged_vertices(simplified, own, children, targets[children]))
        self._replace(ids, simplified.error)
        self._probe(samples, simplified, numbers)
        count = len(simplified.faces)
        triangles = {
            'faces': numbers[simplified.faces],
            'is_border': simplified.is_border,
            'made_by': np.full(count, -1 - len(self._errors), np.int32),
            'mesh_cells': np.full(count, -1, np.int64),
        }
        if 'edge_flags' in self._block.triangles:
            triangles['edge_flags'] = np.zeros(count, np.uint8)
        own_samples = {name: values[samples] for name, values in self._block.samples.items()}
        return triangles, own_samples | {
            'sample_faces': simplified.nearest,
            'sample_distances': simplified.distances.astype(np.float32),
        }

    def _replace(self, ids, error):
        """Note that a cell has replaced triangles."""
        makers = np.unique(self._made_by[ids])
        children = np.searchsorted(self._block.cells, makers[makers >= 0])
        corners = self._points[self._faces[ids].ravel()]
        boxes = np.concatenate([box_of(corners)[None], self._block.cell_boxes[children]])
        self._boxes.append(np.stack([boxes[:, 0].min(0), boxes[:, 1].max(0)]))
        self._errors.append(max([error, *self._block.cell_errors[children]]))
        self._record(ids, -1 - len(self._errors))

    def _probe(self, samples, simplified, numbers):
        """Note where some vertices of the full mesh are on the cell that was replaced last."""
        count = min(len(samples), _SAMPLES)
        some = np.linspace(0, count - 1, min(count, _PROBES)).astype(int)
        corners = simplified.faces[simplified.nearest[some]]
        places = self._block.samples['samples'][samples[some]].astype(float)
        vertices = self._block.samples['sample_vertices'][samples[some]]
        cells = np.full(len(some), -1 - len(self._errors))
        self._probes.append(np.c_[cells, vertices, numbers[corners]].astype(np.int32))
        weights = closest_weights(places, simplified.points[corners])
        self._probe_weights.append(weights.astype(np.float32))

    def _record(self, ids, replaced_by):
        """Note the patches of triangles that one cell replaces."""
        ids = ids[np.argsort(self._made_by[ids], kind='stable')]
        makers = self._made_by[ids]
        for part in np.split(ids, np.flatnonzero(makers[1:] != makers[:-1]) + 1):
            made_by = int(self._made_by[part[0]])
            patches = self._full if made_by == NO_CELL else self._other
            if self._wedges is None:
                own_vertices, faces = self._compact(self._faces[part])
            else:
                own_wedges, faces = self._compact(self._wedges.of_corners[part])
                own_vertices = self._wedges.vertices[own_wedges]
                patches.coordinates.append(self._wedges.coordinates[own_wedges].astype(np.float32))
            patches.cells.append((made_by, replaced_by))
            patches.boxes.append(box_of(self._points[own_vertices]))
            patches.vertices.append(own_vertices.astype(np.int32))
            patches.triangles.append(faces.astype(np.uint16))
            if made_by == NO_CELL:
                patches.mesh_cells.append(self._block.triangles['mesh_cells'][part])
                if 'edge_flags' in self._block.triangles:
                    patches.edge_flags.append(self._block.triangles['edge_flags'][part])

    def _divided(self, parts):
        """Return triangles and samples in the order of the next level's blocks, and these."""
        if not parts:
            return {}, {}, np.zeros((0, 3), np.int64)
        offsets = np.cumsum([0, *(len(triangles['faces']) for triangles, _ in parts)])
        for (_, samples), offset in zip(parts, offsets, strict=False):
            samples['sample_faces'] = (samples['sample_faces'] + offset).astype(np.int32)
        triangles = _joined([triangles for triangles, _ in parts])
        samples = _joined([samples for _, samples in parts])
        points = np.concatenate([self._points, *(new['points'] for new in self._new_vertices)])
        blocks = blocks_of(self._block.planes, self._centers(points, triangles['faces']))
        order = np.argsort(blocks, kind='stable')
        blocks_of_samples = blocks[samples['sample_faces']]
        sample_order = np.argsort(blocks_of_samples, kind='stable')
        own_blocks, starts, counts = np.unique(
            blocks[order], return_index=True, return_counts=True
        )
        sample_counts = np.bincount(
            np.searchsorted(own_blocks, blocks_of_samples), minlength=len(own_blocks)
        )
        places = np.empty_like(order)
        places[order] = np.arange(len(order))
        # Faces of samples are counted from the start of their block.
        first = np.repeat(starts, sample_counts)
        triangles = {name: values[order] for name, values in triangles.items()}
        samples = {name: values[sample_order] for name, values in samples.items()}
        samples['sample_faces'] = (places[samples['sample_faces']] - first).astype(np.int32)
        return triangles, samples, np.stack([own_blocks, counts, sample_counts], 1)


def areas_and_normals(points, faces, bounds) -> tuple[np.ndarray, np.ndarray]:
    """Return the area around each vertex, times a factor, and the sums of facets' unit normals."""
    count = len(points)
    pieces = np.array_split(faces, max(len(faces) // _PIECE, 1))
    lengths, normals = map(np.concatenate, zip(*(_facets(points, p) for p in pieces), strict=True))
    least = _LEAST_AREA * float(((bounds[1] - bounds[0]) ** 2).sum())
    areas = np.bincount(faces.ravel(), np.repeat(lengths, 3), count)
    areas = np.maximum(areas, max(least, 1e-30)).astype(np.float32)
    # The mean of the facets' unit normals, as VTK has it.
    sums = [np.bincount(faces.ravel(), np.repeat(n, 3), count) for n in normals.T]
    return areas, np.stack(sums, 1).astype(np.float32)


def _facets(points, faces) -> tuple[np.ndarray, np.ndarray]:
    """Return twice the areas of triangles, and their unit normals."""
    corners = points[faces].astype(float)
    crosses = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    lengths = np.linalg.norm(crosses, axis=1)
    return lengths, crosses / np.maximum(lengths, 1e-300)[:, None]


def unit(normals) -> np.ndarray:
    """Return normals of length 1; what has none stays as it is."""
    lengths = np.linalg.norm(normals, axis=1, keepdims=True)
    return (normals / np.where(lengths > 0, lengths, 1)).astype(np.float32)


def box_of(points) -> np.ndarray:
    """Return the lowest and highest coordinates of points, (2, 3)."""
    return np.array([[axis.min() for axis in points.T], [axis.max() for axis in points.T]], float)


def _joined(parts: list[dict[str, Any]]) -> dict[str, np.ndarray]:
    return {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}
