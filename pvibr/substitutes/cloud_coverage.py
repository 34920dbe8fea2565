"""How well a billboard cloud covers its mesh, measured in views from all around."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pyvista as pv
from scipy import ndimage

from pvibr.gl.hidden_window import triangles_seen
from pvibr.maths.octahedral import frame
from pvibr.maths.vectors import unit_vectors
from pvibr.maths.views import orthographic
from pvibr.substitutes.slabs import hemisphere

_SIDE = 128  # px along a side of a view; the mesh's diagonal fits
_RIM = 1  # px along outlines that do not count as holes
_STEP = 0.5  # most radians between views
_NONE = np.zeros((0, 3))


@dataclass(frozen=True, eq=False)
class Triangles:
    """Triangles with normals of their corners, (m, 3, 3)."""

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
            vertex_normals = part.mesh.point_data.active_normals
            if vertex_normals is not None and part.actor.GetProperty().GetInterpolation() != 0:
                normals[ids] = vertex_normals[part.mesh.regular_faces]
        return cls(points, faces, normals)


def joined(parts, origin):
    """Return points relative to an origin and triangles of all parts, concatenated."""
    first_point = np.cumsum([0, *(part.mesh.n_points for part in parts)])
    points = [np.asarray(part.mesh.points, float) - origin for part in parts]
    pairs = zip(parts, first_point, strict=False)
    faces = [np.asarray(part.mesh.regular_faces) + k for part, k in pairs]
    return np.concatenate([_NONE, *points]), np.concatenate([_NONE.astype(int), *faces])


def by_part(parts, values):
    """Split values per triangle by part; yield parts and values."""
    ends = np.cumsum([part.mesh.n_cells for part in parts], dtype=int)
    return zip(parts, np.split(values, ends)[:-1], strict=True)


@dataclass(frozen=True, eq=False)
class VisibleSurface:
    """The triangle that each pixel of a parallel view shows, -1 for none, and the point on it."""

    axes: np.ndarray
    face: np.ndarray
    points: np.ndarray


class Around:
    """Parallel views of a mesh from all around; `turn` rotates them."""

    def __init__(self, points, turn=0.0):
        low, high = points.min(0), points.max(0)
        self.center, self.radius = (low + high) / 2, float(np.linalg.norm(high - low)) / 2
        cos, sin = np.cos(turn), np.sin(turn)
        upper = hemisphere(_STEP) @ [[cos, sin, 0], [-sin, cos, 0], [0, 0, 1]]
        upper = upper if not turn else upper[:, [2, 0, 1]]
        self.axes = frame(np.concatenate([upper, -upper[:, [1, 2, 0]]]))

    def look(self, points, faces):
        """Yield the surface seen in each view."""
        view_centers, reach = self.axes @ self.center, self.radius
        pairs = zip(self.axes, view_centers, strict=True)
        views = [orthographic(axes, c - reach, c + reach) for axes, c in pairs]
        mesh = pv.PolyData.from_regular_faces(points.astype(np.float32), faces)
        face_images = triangles_seen(mesh, views, (_SIDE, _SIDE))
        grid = (np.stack(np.meshgrid(*[np.arange(_SIDE)] * 2), -1) + 0.5) * (2 / _SIDE) - 1
        for axes, middle, face in zip(self.axes, view_centers, face_images, strict=True):
            pixel_points = (grid * reach + middle[:2]).reshape(-1, 2)
            surface_points = _on_triangles(points[faces[face.ravel()]], axes, pixel_points)
            yield VisibleSurface(axes, face, surface_points.reshape(_SIDE, _SIDE, 3))


def inside(pixels):
    """Return a mask of the pixels inside the outline, and the surface seen there."""
    is_inside = ndimage.binary_erosion(pixels.face >= 0, iterations=_RIM)
    return is_inside, VisibleSurface(pixels.axes, pixels.face[is_inside], pixels.points[is_inside])


def _on_triangles(corners, axes, pixel_points):
    """Return the points of triangles seen at pixels of a view."""
    a, b, c = (corners @ axes.T).transpose(1, 0, 2)
    normal = np.cross(b - a, c - a)
    is_edge_on = np.abs(normal[:, 2]) <= 1e-9 * np.linalg.norm(normal, axis=1)
    slope = normal[:, :2] / np.where(is_edge_on, np.inf, normal[:, 2])[:, None]
    depth = a[:, 2] - (slope * (pixel_points - a[:, :2])).sum(1)
    corner_depths = np.stack([a[:, 2], b[:, 2], c[:, 2]])
    depth = np.clip(depth, corner_depths.min(0), corner_depths.max(0))
    return np.column_stack([pixel_points, depth]) @ axes


def nearest_planes(pixels, sheet, count, opaque):
    """Return the plane seen at each pixel, -1 if none, its distance in front, and the texel.

    Texels are rows and columns of the texture, bottom row first.
    """
    best_front = np.full(len(pixels.face), -np.inf)
    plane = np.full(len(best_front), -1)
    texel = np.zeros((len(best_front), 2), int)
    for k in range(count):
        facing = sheet.axes[k, 2] @ pixels.axes[2]
        if abs(facing) < 1e-6:
            continue
        front = (sheet.low[k, 2] - pixels.points @ sheet.axes[k, 2]) / facing
        flat = (pixels.points + front[:, None] * pixels.axes[2]) @ sheet.axes[k, :2].T
        cell = np.floor((flat - sheet.low[k, :2]) * sheet.scale).astype(int)
        in_rectangle = ((cell >= 0) & (cell < sheet.texels[k])).all(1)
        ids = np.flatnonzero(in_rectangle & (front > best_front))
        cell = (cell[ids] + sheet.corners[k])[:, ::-1]
        is_opaque = opaque[cell[:, 0], cell[:, 1]]
        ids = ids[is_opaque]
        best_front[ids], plane[ids], texel[ids] = front[ids], k, cell[is_opaque]
    return plane, best_front, texel


def coverage_errors(mesh, patches, owner, sheet, count, opaque, normals):
    """Return the share of the mesh's inner pixels that miss the cloud, and the normals' error.

    The latter is a mean angle in degrees; `owner` is the rectangle of each triangle of patches.
    """
    around = Around(mesh.points, turn=1.0)
    views = around.look(mesh.points, mesh.faces)
    patch_views = around.look(patches.points, patches.faces) if len(patches.faces) else None
    pixel_count = hole_count = 0
    angles = []
    for view in views:
        is_inside, mesh_pixels = inside(view)
        plane, front, texel = nearest_planes(mesh_pixels, sheet, count, opaque)
        if patch_views is not None:
            nearest = plane, front, texel
            _overlay_patches(next(patch_views), is_inside, mesh_pixels, owner, sheet, nearest)
        is_covered = plane >= 0
        pixel_count, hole_count = pixel_count + len(plane), hole_count + int((~is_covered).sum())
        k, (row, column) = plane[is_covered], texel[is_covered].T
        cloud_normals = np.einsum('nd,nde->ne', normals[row, column], sheet.axes[k])
        mesh_normals = _normals(mesh, mesh_pixels.face[is_covered], mesh_pixels.points[is_covered])
        # Both toward the viewer.
        away = mesh_pixels.axes[2]
        facing = np.sign((cloud_normals @ away) * (mesh_normals @ away))
        cosine = facing * (unit_vectors(cloud_normals) * mesh_normals).sum(1)
        angles.append(np.arccos(np.clip(cosine, -1, 1)))
    return hole_count / max(pixel_count, 1), float(np.degrees(np.mean(np.concatenate(angles))))


def _overlay_patches(view, is_inside, mesh_pixels, owner, sheet, nearest):
    """Let patches in front replace the nearest planes, in place."""
    plane, front, texel = nearest
    face, points = view.face[is_inside], view.points[is_inside]
    in_front = (points - mesh_pixels.points) @ mesh_pixels.axes[2]
    ids = np.flatnonzero((face >= 0) & (in_front > front))
    plane[ids] = owner[face[ids]]
    texel_position = np.floor(sheet.flattened(points[ids], plane[ids])[:, 1::-1]).astype(int)
    texel[ids] = np.clip(texel_position, 0, sheet.side - 1)


def _normals(mesh, face, points):
    """Return unit normals of points on triangles, interpolated between corners."""
    a, b, c = mesh.points[mesh.faces[face]].transpose(1, 0, 2)
    area = np.cross(b - a, c - a)
    total = np.maximum((area * area).sum(1), 1e-300)
    u = (np.cross(b - points, c - points) * area).sum(1) / total
    v = (np.cross(c - points, a - points) * area).sum(1) / total
    weights = np.stack([u, v, 1 - u - v], 1).clip(0, 1)
    return unit_vectors(np.einsum('nc,ncd->nd', weights, mesh.normals[face]))
