"""What is seen of a billboard cloud where its mesh is seen, from all around."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pyvista as pv
from scipy import ndimage

from pvibr.gl.offscreen import triangles_seen
from pvibr.maths.octahedral import frame
from pvibr.maths.slabs import hemisphere
from pvibr.maths.vectors import unit_vectors
from pvibr.maths.views import orthographic

_SIDE = 128  # pixels along a side of a view, into which the diagonal fits
_RIM = 1  # pixels along an outline, where a displacement is no hole
_STEP = 0.5  # radians between views, or less
_NONE = np.zeros((0, 3))


@dataclass(frozen=True, eq=False)
class Triangles:
    """Triangles, and the normals of their corners, (m, 3, 3)."""

    points: np.ndarray
    faces: np.ndarray
    normals: np.ndarray

    @classmethod
    def of(cls, parts, origin) -> Triangles:
        """Return the triangles of parts near an origin, with the normals that VTK draws."""
        points, faces = joined(parts, origin)
        a, b, c = points[faces].transpose(1, 0, 2)
        normals = unit_vectors(np.cross(b - a, c - a))[:, None].repeat(3, 1)
        for part, ids in by_part(parts, np.arange(len(faces))):
            own = part.mesh.point_data.active_normals
            if own is not None and part.actor.GetProperty().GetInterpolation() != 0:
                normals[ids] = own[part.mesh.regular_faces]
        return cls(points, faces, normals)


def joined(parts, origin):
    """Return points near an origin and triangles of all parts, one part after the other."""
    first = np.cumsum([0, *(part.mesh.n_points for part in parts)])
    points = [np.asarray(part.mesh.points, float) - origin for part in parts]
    faces = [np.asarray(p.mesh.regular_faces) + k for p, k in zip(parts, first, strict=False)]
    return np.concatenate([_NONE, *points]), np.concatenate([_NONE.astype(int), *faces])


def by_part(parts, values):
    """Return each part with its own of the values of all triangles."""
    ends = np.cumsum([part.mesh.n_cells for part in parts], dtype=int)
    return zip(parts, np.split(values, ends)[:-1], strict=True)


@dataclass(frozen=True, eq=False)
class Seen:
    """The triangles that pixels of a parallel view show, -1 for none, and the places on them."""

    axes: np.ndarray
    face: np.ndarray
    points: np.ndarray


class Around:
    """Parallel views of a mesh from all around, and from other sides for another `turn`."""

    def __init__(self, points, turn=0.0):
        low, high = points.min(0), points.max(0)
        self.center, self.radius = (low + high) / 2, float(np.linalg.norm(high - low)) / 2
        cos, sin = np.cos(turn), np.sin(turn)
        half = hemisphere(_STEP) @ [[cos, sin, 0], [-sin, cos, 0], [0, 0, 1]]
        half = half if not turn else half[:, [2, 0, 1]]
        self.axes = frame(np.concatenate([half, -half[:, [1, 2, 0]]]))

    def look(self, points, faces):
        """Yield what each view shows."""
        middles, reach = self.axes @ self.center, self.radius
        views = [
            orthographic(a, m - reach, m + reach) for a, m in zip(self.axes, middles, strict=True)
        ]
        mesh = pv.PolyData.from_regular_faces(points.astype(np.float32), faces)
        numbers = triangles_seen(mesh, views, (_SIDE, _SIDE))
        grid = (np.stack(np.meshgrid(*[np.arange(_SIDE)] * 2), -1) + 0.5) * (2 / _SIDE) - 1
        for axes, middle, face in zip(self.axes, middles, numbers, strict=True):
            flat = (grid * reach + middle[:2]).reshape(-1, 2)
            places = _on_triangles(points[faces[face.ravel()]], axes, flat)
            yield Seen(axes, face, places.reshape(_SIDE, _SIDE, 3))


def inside(seen):
    """Return the pixels inside the outline, and what is seen there."""
    mask = ndimage.binary_erosion(seen.face >= 0, iterations=_RIM)
    return mask, Seen(seen.axes, seen.face[mask], seen.points[mask])


def _on_triangles(corners, axes, flat):
    """Return the places of triangles that are seen at places of a view."""
    seen = corners @ axes.T
    normal = np.cross(seen[:, 1] - seen[:, 0], seen[:, 2] - seen[:, 0])
    steep = np.abs(normal[:, 2]) <= 1e-9 * np.linalg.norm(normal, axis=1)
    slope = normal[:, :2] / np.where(steep, np.inf, normal[:, 2])[:, None]
    depth = seen[:, 0, 2] - (slope * (flat - seen[:, 0, :2])).sum(1)
    depth = np.clip(depth, seen[..., 2].min(1), seen[..., 2].max(1))
    return np.column_stack([flat, depth]) @ axes


def nearest_planes(seen, sheet, count, opaque):
    """Return which of a sheet's first planes is seen, -1 for none, how far in front, and where."""
    # Where: row and column of the texture, bottom row first.
    best = np.full(len(seen.face), -np.inf)
    plane = np.full(len(best), -1)
    texel = np.zeros((len(best), 2), int)
    for k in range(count):
        facing = sheet.axes[k, 2] @ seen.axes[2]
        if abs(facing) < 1e-6:
            continue
        front = (sheet.low[k, 2] - seen.points @ sheet.axes[k, 2]) / facing
        place = (seen.points + front[:, None] * seen.axes[2]) @ sheet.axes[k, :2].T
        place = np.floor((place - sheet.low[k, :2]) * sheet.scale).astype(int)
        ids = np.flatnonzero(((place >= 0) & (place < sheet.texels[k])).all(1) & (front > best))
        place = (place[ids] + sheet.corners[k])[:, ::-1]
        shown = opaque[place[:, 0], place[:, 1]]
        ids = ids[shown]
        best[ids], plane[ids], texel[ids] = front[ids], k, place[shown]
    return plane, best, texel


def coverage_errors(mesh, patches, owner, sheet, count, opaque, normals):
    """Return the share of the mesh's inner pixels without any of the cloud, and normals' angle."""
    # The mean angle where both are seen, degrees. The owner of a patch's triangle is the rectangle
    # of the sheet that it is drawn onto.
    around = Around(mesh.points, turn=1.0)
    views = around.look(mesh.points, mesh.faces)
    others = around.look(patches.points, patches.faces) if len(patches.faces) else None
    pixels = missed = 0
    angles = []
    for view in views:
        mask, seen = inside(view)
        plane, front, texel = nearest_planes(seen, sheet, count, opaque)
        if others is not None:
            _put_patches(next(others), mask, seen, owner, sheet, (plane, front, texel))
        shown = plane >= 0
        pixels, missed = pixels + len(plane), missed + int((~shown).sum())
        k, (row, column) = plane[shown], texel[shown].T
        cloud = np.einsum('nd,nde->ne', normals[row, column], sheet.axes[k])
        truth = _normals(mesh, seen.face[shown], seen.points[shown])
        cloud, truth = (n * np.sign(n @ seen.axes[2])[:, None] for n in (cloud, truth))
        angles.append(np.arccos(np.clip((unit_vectors(cloud) * truth).sum(1), -1, 1)))
    return missed / max(pixels, 1), float(np.degrees(np.mean(np.concatenate(angles))))


def _put_patches(view, mask, seen, owner, sheet, found):
    """Replace what patches are in front of."""
    plane, front, texel = found
    face, points = view.face[mask], view.points[mask]
    ahead = (points - seen.points) @ seen.axes[2]
    ids = np.flatnonzero((face >= 0) & (ahead > front))
    plane[ids] = owner[face[ids]]
    place = np.floor(sheet.flattened(points[ids], plane[ids])[:, 1::-1]).astype(int)
    texel[ids] = np.clip(place, 0, sheet.side - 1)


def _normals(mesh, face, points):
    """Return the unit normals of places on triangles, between those of the corners."""
    a, b, c = mesh.points[mesh.faces[face]].transpose(1, 0, 2)
    area = np.cross(b - a, c - a)
    total = np.maximum((area * area).sum(1), 1e-300)
    u = (np.cross(b - points, c - points) * area).sum(1) / total
    v = (np.cross(c - points, a - points) * area).sum(1) / total
    weights = np.stack([u, v, 1 - u - v], 1).clip(0, 1)
    return unit_vectors(np.einsum('nc,ncd->nd', weights, mesh.normals[face]))
