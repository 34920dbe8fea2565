"""Simplification by collapses of edges onto their ends: the points left are some of the mesh's.

Garland and Heckbert, "Surface simplification using quadric error metrics", SIGGRAPH 1997, in
passes of collapses apart from one another, as on GPUs: Papageorgiou and Platis, "Triangular mesh
simplification on the GPU", The Visual Computer 31, 2015. Distances count in several poses of the
mesh: Mohr and Gleicher, "Deformation sensitive decimation", University of Wisconsin, 2003.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import scipy  # whose modules load when they are first used

from pvibr.maths.vectors import unit_vectors

#: Weight of the lines that must stay, as edges of holes and of textures, relative to surfaces.
_LINE_WEIGHT = 1.0
#: Distance, relative to the mesh, that is as bad as a normal off by 1; and weight of that by
#: which a texture is shifted.
_NORMAL_WEIGHT, _TEXTURE_WEIGHT = 0.05, 0.5
#: Cosine of the angle by which a triangle may turn in one collapse.
_TURN = 0.3
#: Share of the points, those cheapest to collapse, from which a pass takes its collapses.
_CHEAPEST = 0.1
_SAME_VALUE = 1e-4  # relative to the range of an array: corners that differ by more are apart
_SAME_NORMAL = 0.5  # of corners at one place: a sharper edge stays
_SAME_PLACE = 1e-3  # the same for places in a pose, relative to the mesh


def collapsed(mesh, welded, poses, step, *, smooth) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Collapse edges on and on; yield corners and cells left at each share of the triangles."""
    # Corners are points of the mesh, (m, 3), which are known in some poses, (v, 3) each; normals
    # count where it is smooth.
    classes = _corner_classes(mesh, welded, poses, smooth)
    points_of_classes = np.zeros(classes.max() + 1, int)
    points_of_classes[classes] = welded.corners
    points_of_vertices = np.zeros(len(welded.points), int)
    points_of_vertices[welded.faces] = welded.corners
    places = np.array([points[points_of_vertices] for points in poses])
    collapses = Collapses(places, welded.faces, classes, _attributes(mesh, welded, smooth))
    count = len(welded.faces)
    while collapses.collapse():
        if len(collapses.cells) <= step * count:
            count = len(collapses.cells)
            yield points_of_classes[collapses.classes], welded.cells[collapses.cells]


class Collapses:
    """A mesh whose edges are collapsed in passes, in several poses, (poses, v, 3)."""

    def __init__(self, places, faces, classes, attributes):
        self.classes = classes
        #: Triangle of the mesh of each that is left.
        self.cells = np.arange(len(faces))
        self._vertex_of = np.zeros(classes.max() + 1, int)
        self._vertex_of[classes] = faces
        self._places = np.swapaxes(places, 0, 1)  # (v, poses, 3)
        self._quadrics = np.zeros((*self._places.shape[:2], 4, 4))
        self._refused = np.zeros(0, int)
        self._add_planes()
        self._add_lines()
        self._add_attributes(attributes)

    @property
    def faces(self) -> np.ndarray:
        """Vertices of the triangles that are left, (m, 3)."""
        return self._vertex_of[self.classes]

    # -- quadrics -----------------------------------------------------------------------------

    def _add_planes(self):
        """Add the planes of the triangles, weighted by area, to their corners."""
        a, b, c = np.moveaxis(self._places[self.faces], 1, 0)
        normals = np.cross(b - a, c - a)
        areas = np.linalg.norm(normals, axis=-1)
        for k in range(3):
            self._add(self.faces[:, k], unit_vectors(normals), a, areas / 6)

    def _add_lines(self):
        """Add planes along edges of one triangle, or whose triangles are of other classes."""
        faces = self.faces
        starts, ends = self.classes.ravel(), np.roll(self.classes, -1, axis=1).ravel()
        # An edge within a surface is there the other way round, between the same classes.
        width = len(self._vertex_of)
        is_line = ~np.isin(starts * width + ends, ends * width + starts)
        rows = np.repeat(np.arange(len(faces)), 3)[is_line]
        u, v = self._vertex_of[starts[is_line]], self._vertex_of[ends[is_line]]
        a, b, c = np.moveaxis(self._places[faces[rows]], 1, 0)
        along = self._places[v] - self._places[u]
        weights = _LINE_WEIGHT * np.square(along).sum(-1)
        planes = unit_vectors(np.cross(along, np.cross(b - a, c - a)))
        for ends_of in (u, v):
            self._add(ends_of, planes, self._places[u], weights)

    def _add_attributes(self, values):
        """Add how attributes change along triangles, in the first pose, to corners' classes.

        Hoppe, "New quadric metric for simplifying meshes with appearance attributes", IEEE
        Visualization 1999.
        """
        count, class_count = values.shape[2], len(self._vertex_of)
        sums, corners = np.zeros((class_count, count)), np.zeros(class_count)
        np.add.at(sums, self.classes, values)
        np.add.at(corners, self.classes, 1.0)
        self._attributes = sums / np.maximum(corners, 1.0)[:, None]
        a, b, c = np.moveaxis(self._places[self.faces, 0], 1, 0)
        normals = np.cross(b - a, c - a)
        areas = np.linalg.norm(normals, axis=1)
        normals = unit_vectors(normals)
        # Along the triangle, from the differences along two of its sides.
        along = np.stack([np.cross(c - a, normals), np.cross(normals, b - a)], 2)
        along /= np.maximum(areas, 1e-300)[:, None, None]
        differences = values[:, 1:] - values[:, :1]
        gradients = np.einsum('mik,mka->mai', along, differences)
        rows = np.zeros((len(areas), count, 4 + count))
        rows[..., :3] = gradients
        rows[..., 3] = values[:, 0] - np.einsum('mai,mi->ma', gradients, a)
        rows[..., 4:] = -np.eye(count)
        quadrics = np.einsum('m,mai,maj->mij', areas / 6, rows, rows)
        self._class_quadrics = np.zeros((class_count, 4 + count, 4 + count))
        for k in range(3):
            np.add.at(self._class_quadrics, self.classes[:, k], quadrics)

    def _add(self, vertices, normals, points, weights):
        """Add planes through points, (n, poses, 3), to the quadrics of vertices."""
        planes = np.concatenate([normals, -(normals * points).sum(-1, keepdims=True)], -1)
        quadrics = weights[..., None, None] * planes[..., :, None] * planes[..., None, :]
        np.add.at(self._quadrics, vertices, quadrics)

    # -- collapses ----------------------------------------------------------------------------

    def collapse(self) -> int:
        """Collapse the cheapest edges that are apart from one another; return how many."""
        u, v, pairs = self._candidates()
        if not len(u):
            return 0
        at = np.concatenate([self._places[v], np.ones((*self._places[v].shape[:2], 1))], -1)
        costs = np.einsum('nki,nkij,nkj->n', at, self._quadrics[u], at)
        edges, from_class, to_class = pairs.T
        at = np.concatenate([at[edges, 0], self._attributes[to_class]], 1)
        quadrics = self._class_quadrics[from_class]
        costs += np.bincount(edges, np.einsum('ni,nij,nj->n', at, quadrics, at), len(u))
        order = np.lexsort((costs, u))
        first = order[np.unique(u[order], return_index=True)[1]]  # the cheapest of each vertex
        first = first[np.argsort(costs[first], kind='stable')]
        alive = len(np.unique(self.faces))
        first = first[: max(int(_CHEAPEST * alive), 1)]
        first = first[self._apart(u[first])]
        turned = self._turned(u[first], v[first])
        keys = u[first] * len(self._places) + v[first]
        self._refused = np.union1d(self._refused, keys[turned])
        first = first[~turned]
        self._apply(u[first], v[first], pairs[:, 1:])
        return len(first) or int(turned.any())

    def _candidates(self):
        """Return vertices that may collapse, what onto, and which class onto which by edge."""
        faces, classes, count = self.faces, self.classes, len(self._places)
        sides = [(i, j) for i in range(3) for j in range(3) if i != j]
        u, v, from_class, to_class = (
            np.concatenate([values[:, side[k]] for side in sides])
            for values, k in ((faces, 0), (faces, 1), (classes, 0), (classes, 1))
        )
        keys, edges = np.unique(u * count + v, return_inverse=True)
        edges = edges.reshape(-1)
        u, v = keys // count, keys % count
        widths = np.bincount(edges)
        # Each class of a vertex must find one of the vertex that it collapses onto.
        pairs = np.unique(np.stack([edges, from_class, to_class], 1), axis=0)
        found = np.unique(pairs[:, :2], axis=0)
        edge_pairs, edge_classes = (
            np.bincount(p[:, 0], minlength=len(keys)) for p in (pairs, found)
        )
        vertex_classes = np.bincount(self._vertex_of[np.unique(classes)], minlength=count)
        is_valid = (edge_pairs == edge_classes) & (edge_classes == vertex_classes[u])
        # Vertices on the edge of a hole stay there; edges of three triangles stay.
        borders = np.bincount(u[widths == 1], minlength=count)
        tangled = np.bincount(u[widths > 2], minlength=count) > 0
        is_valid &= ~tangled[u] & (borders[u] <= 2) & ((borders[u] == 0) | (widths == 1))
        # Vertices next to both are those of the edge's triangles, else the surface would fold.
        graph = scipy.sparse.csr_array((np.ones(len(u), np.int32), (u, v)), shape=(count, count))
        is_valid &= np.asarray((graph @ graph)[u, v]).ravel() == widths
        is_valid &= ~np.isin(keys, self._refused)
        pairs = pairs[is_valid[pairs[:, 0]]]
        pairs[:, 0] = (is_valid.cumsum() - 1)[pairs[:, 0]]
        return u[is_valid], v[is_valid], pairs

    def _apart(self, u) -> np.ndarray:
        """Return which of ranked vertices share no triangle with one of a lower rank."""
        ranks = np.full(len(self._places), len(u))
        ranks[u] = np.arange(len(u))
        at_corners = ranks[self.faces]
        is_first = np.ones(len(self._places), bool)
        is_first[self.faces[at_corners > at_corners.min(1, keepdims=True)]] = False
        return is_first[u]

    def _turned(self, u, v) -> np.ndarray:
        """Return which collapses turn a triangle too far in any pose."""
        targets = np.full(len(self._places), -1)
        targets[u] = v
        faces, onto = self.faces, targets[self.faces]
        moved_faces = np.where(onto >= 0, onto, faces)
        is_left = (moved_faces != np.roll(moved_faces, 1, axis=1)).all(1) & (onto >= 0).any(1)
        before, after = (self._normals(f) for f in (faces[is_left], moved_faces[is_left]))
        is_turned = ((before * after).sum(-1) < _TURN).any(1)
        turned = np.zeros(len(self._places), bool)
        turned[faces[is_left][(onto[is_left] >= 0) & is_turned[:, None]]] = True
        return turned[u]

    def _normals(self, faces):
        a, b, c = np.moveaxis(self._places[faces], 1, 0)
        return unit_vectors(np.cross(b - a, c - a))

    def _apply(self, u, v, pairs):
        np.add.at(self._quadrics, v, self._quadrics[u])
        targets = np.full(len(self._places), -1)
        targets[u] = v
        of_these = targets[self._vertex_of[pairs[:, 0]]] == self._vertex_of[pairs[:, 1]]
        class_onto = np.arange(len(self._vertex_of))
        from_class, to_class = pairs[of_these].T
        class_onto[from_class] = to_class
        np.add.at(self._class_quadrics, to_class, self._class_quadrics[from_class])
        self.classes = class_onto[self.classes]
        faces = self.faces
        is_left = (faces != np.roll(faces, 1, axis=1)).all(1)
        self.classes, self.cells = self.classes[is_left], self.cells[is_left]


def _corner_classes(mesh, welded, poses, smooth) -> np.ndarray:
    """Return the class of each corner of a welded mesh: what is alike there, and moves alike."""
    keys = [welded.faces.ravel()]
    for data, ids in ((mesh.point_data, welded.corners), (mesh.cell_data, welded.cells)):
        for name in data:
            values = np.asarray(data[name], float).reshape(data.valid_array_len, -1)
            step = _SAME_VALUE * (np.nanmax(values) - np.nanmin(values)) or 1.0
            if name == data.active_normals_name:
                step = _SAME_NORMAL if smooth else np.inf
            rows = np.rint(np.nan_to_num(values) / step)[ids.ravel()]
            keys += [*(rows if ids.ndim > 1 else np.repeat(rows, 3, axis=0)).T]
    for points in poses:
        step = _SAME_PLACE * np.ptp(points, axis=0).max() or 1.0
        keys += [*np.rint(points[welded.corners.ravel()] / step).T]
    _, classes = np.unique(np.stack(keys, 1), axis=0, return_inverse=True)
    return classes.reshape(-1, 3)


def _attributes(mesh, welded, smooth) -> np.ndarray:
    """Return what must be right at the corners of a welded mesh, (m, 3, a), as distances.

    Texture coordinates are those at which the texture is as large as the surface.
    """
    points = np.asarray(mesh.points, float)
    columns = [np.zeros((*welded.faces.shape, 0))]
    if smooth and mesh.point_data.active_normals is not None:
        normals = np.asarray(mesh.point_data.active_normals, float)
        columns.append(_NORMAL_WEIGHT * np.ptp(points, axis=0).max() * normals[welded.corners])
    coordinates = mesh.point_data.active_texture_coordinates
    if coordinates is not None:
        flat = np.pad(np.nan_to_num(np.asarray(coordinates, float)), ((0, 0), (0, 1)))
        areas = [_area(values[welded.corners]) for values in (points, flat)]
        scale = (areas[0] / areas[1]) ** 0.5 if areas[1] > 0 else 0.0
        columns.append(_TEXTURE_WEIGHT * scale * flat[welded.corners][..., :2])
    return np.concatenate(columns, -1)


def _area(corners) -> float:
    a, b, c = np.moveaxis(corners, 1, 0)
    return float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum())
