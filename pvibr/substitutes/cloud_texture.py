"""The texture of a billboard cloud: planes flattened, rendered at once, packed."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pyvista as pv
from scipy import ndimage

from pvibr.gl import set_fragment_uniforms
from pvibr.gl.hidden_window import rasterize
from pvibr.instances.bake import unlit_actor
from pvibr.maths.image_error import box_reduce
from pvibr.maths.views import orthographic
from pvibr.meshes.decimate import take_arrays
from pvibr.substitutes.cloud_coverage import by_part

_MARGIN = 2  # texels of padding around each image
_TURNS = 45  # rotations tried for each rectangle, every second degree
_BLOCK = 1 << 20  # distances computed at once


@dataclass(frozen=True, eq=False)
class Sheet:
    """The rectangle of each plane, in world and texture space."""

    axes: np.ndarray
    low: np.ndarray
    scale: float
    texels: np.ndarray
    corners: np.ndarray
    side: int

    def quads(self):
        """Return the corners of each image, counter-clockwise, in world and texture space."""
        unit = np.array([[0, 0], [1, 0], [1, 1], [0, 1]])
        texel_corners = unit * self.texels[:, None]
        flat_corners = self.low[:, None].repeat(4, 1)
        flat_corners[..., :2] += texel_corners / self.scale
        points = np.einsum('kcd,kde->kce', flat_corners, self.axes)
        return points, (self.corners[:, None] + texel_corners) / self.side

    def flattened(self, points, plane):
        """Return points in texels of the texture, with height above it."""
        plane_points = np.einsum('n...d,ned->n...e', points, self.axes[plane])
        texture_corners = np.column_stack([self.corners, np.zeros(len(self.corners))])
        shape = (len(plane), *[1] * (plane_points.ndim - 2), 3)
        offsets, scale = plane_points - self.low[plane].reshape(shape), self.scale
        return offsets * scale + texture_corners[plane].reshape(shape)


def arranged(planes, points, faces, side) -> Sheet:
    """Return a small rectangle around the triangles of each plane, packed into a square."""
    order = np.argsort(planes.owner, kind='stable')
    starts = np.searchsorted(planes.owner[order], np.arange(len(planes) + 1))
    axes, plane_lows, size_list = [], [], []
    for k in range(len(planes)):
        ids = np.unique(faces[order[starts[k] : starts[k + 1]]])
        plane_axes, corner, plane_sizes = _rectangle(points[ids], planes.normals[k])
        axes.append(plane_axes)
        plane_lows.append([*corner, planes.offsets[k]])
        size_list.append(plane_sizes)
    plane_sizes, low_corners = np.array(size_list), np.array(plane_lows)
    try:
        scale, texels, corners = largest_scale(plane_sizes, side, _MARGIN)
    except ValueError as error:
        raise ValueError(
            f'size must have room for {len(planes)} billboards, got {side}: raise size or epsilon'
        ) from error
    low_corners[:, :2] -= (texels / scale - plane_sizes) / 2
    return Sheet(np.array(axes), low_corners, scale, texels, corners, side)


def _rectangle(points, normal):
    """Return axes, lower corner and size of a small rectangle around points on a plane."""
    u = np.cross(np.eye(3)[np.abs(normal).argmin()], normal)
    u /= np.linalg.norm(u)
    flat_points = points @ np.stack([u, np.cross(normal, u)]).T
    angle = np.arange(_TURNS) * (np.pi / 2 / _TURNS)
    cos, sin = np.cos(angle), np.sin(angle)
    rotated_x = flat_points[:, :1] * cos + flat_points[:, 1:] * sin
    rotated_y = flat_points[:, 1:] * cos - flat_points[:, :1] * sin
    best = int(np.argmin(np.ptp(rotated_x, axis=0) * np.ptp(rotated_y, axis=0)))
    if np.ptp(rotated_x[:, best]) < np.ptp(rotated_y[:, best]):  # wide ones pack better on shelves
        rotated_x, rotated_y, cos, sin = rotated_y, -rotated_x, -sin, cos
    right = cos[best] * u + sin[best] * np.cross(normal, u)
    best_points = np.stack([rotated_x[:, best], rotated_y[:, best]], 1)
    axes = np.stack([right, np.cross(normal, right), normal])
    return axes, best_points.min(0), np.ptp(best_points, axis=0)


def draw(parts, patches, origin, planes, sheet, reach, supersample):
    """Render triangles near each plane onto it, and patches onto theirs: colour and normal."""
    color, normal = _rendered(parts, patches, origin, planes, sheet, reach, supersample)
    coverage = color[..., 3]
    solid = _solid(coverage, sheet, len(reach))
    safe_coverage = np.maximum(coverage, 1e-6)[..., None]
    albedo = np.dstack([_spread(color[..., :3] / safe_coverage, coverage > 0), solid])
    normal_length = np.linalg.norm(normal, axis=-1, keepdims=True)
    unit = normal / np.maximum(normal_length, 1e-6)
    normal = np.where(normal_length > 1e-6, unit, [0.0, 0.0, 1.0])
    normal = _spread(normal, coverage > 0) * 0.5 + 0.5
    return tuple(
        np.ascontiguousarray(np.rint(255 * a.clip(0, 1))[::-1].astype(np.uint8))
        for a in (albedo, normal)
    )


def opaque_texels(parts, origin, planes, sheet, reach):
    """Return about where :func:`draw` makes the texture opaque; bottom row first."""
    color, _ = _rendered(parts, [], origin, planes, sheet, reach, 1)
    return _solid(color[..., 3], sheet, len(reach))


def _rendered(parts, patches, origin, planes, sheet, reach, supersample):
    """Return colours with coverage, and normals, premultiplied by it; bottom row first."""
    flat_parts = [
        _laid_out(part, origin, planes, owner, sheet, reach if k < len(parts) else None)
        for k, (part, owner) in enumerate(by_part([*parts, *patches], planes.owner))
    ]
    return _drawn(flat_parts, sheet.side, supersample)


def _laid_out(part, origin, planes, owner, sheet, reach):
    """Return a part flattened into the texture; `reach` repeats triangles on nearby planes."""
    mesh = part.mesh
    points, faces = np.asarray(mesh.points, float) - origin, np.asarray(mesh.regular_faces)
    face, plane = np.arange(len(faces)), owner
    if reach is not None:
        face, plane = _pairs(points[faces], planes, owner, sheet, reach)
    ids = faces[face].ravel()
    flat_mesh, flat_corners = pv.PolyData(), sheet.flattened(points[faces[face]], plane)
    flat_mesh.points = flat_corners.reshape(-1, 3).astype(np.float32)
    flat_mesh.regular_faces = np.arange(len(ids)).reshape(-1, 3).astype(int)
    take_arrays(mesh, flat_mesh, ids, face)
    is_flat = part.actor.GetProperty().GetInterpolation() == 0
    _turn_normals(flat_mesh, sheet.axes[plane], flat=is_flat)
    return part.with_mesh(flat_mesh)


def _turn_normals(mesh, axes, *, flat):
    """Rotate the normals of unshared corners with their triangles."""
    for data, corner_axes in ((mesh.point_data, axes.repeat(3, 0)), (mesh.cell_data, axes)):
        if data.active_normals is None:
            continue
        if flat:  # VTK then computes face normals
            del data[data.active_normals_name]
        else:
            turned_normals = np.einsum('ned,nd->ne', corner_axes, np.asarray(data.active_normals))
            data.active_normals = turned_normals.astype(np.float32)


def _pairs(corners, planes, owner, sheet, reach):
    """Return pairs of triangle and plane: the own plane, and others within reach."""
    faces, planes_of_faces = [], []
    block, count = max(1, _BLOCK // len(planes)), len(reach)
    for start in range(0, len(corners), block):
        block_corners = corners[start : start + block]
        corner_distance = np.abs(planes.distances(block_corners)).max(1)[:, :count]
        own_plane = owner[start : start + block]
        face, plane = np.nonzero(corner_distance <= reach)
        texel = sheet.flattened(block_corners[face], plane)[..., :2]
        texel = texel - sheet.corners[plane][:, None]
        is_inside = ((texel >= 0) & (texel <= sheet.texels[plane][:, None])).all((1, 2))
        is_extra = is_inside & (plane != own_plane[face])
        faces.append(np.concatenate([np.arange(len(block_corners)), face[is_extra]]) + start)
        planes_of_faces.append(np.concatenate([own_plane, plane[is_extra]]))
    return np.concatenate(faces), np.concatenate(planes_of_faces)


def _drawn(parts, side, supersample):
    greatest_height = max(float(np.abs(part.mesh.points[:, 2]).max()) for part in parts) + 1
    view = orthographic(np.eye(3), (0.0, 0.0, -greatest_height), (side, side, greatest_height))
    actors = [_actor(part) for part in parts]
    images = rasterize(actors, view, (side, side), ('rgba8', 'rgba8'), samples=supersample)
    color, normal = (_reduced(pixels, len(pixels) // side) for pixels in images)
    return color, normal[..., :3] * 2 - color[..., 3:]


def _actor(part):
    actor = unlit_actor(part, closed=False)
    set_fragment_uniforms([actor], {'ibr_object_from_view': np.eye(3)})
    return actor


def _reduced(pixels, factor):
    """Return means of squares of samples, 0 to 1, in blocks of rows to limit memory."""
    step = 64 * factor
    row_blocks = [box_reduce(pixels[k : k + step], factor) for k in range(0, len(pixels), step)]
    return np.concatenate(row_blocks) / 255


def _solid(coverage, sheet, count):
    """Return opaque texels: as many as the coverage in the first rectangles, all in others."""
    solid = np.zeros(coverage.shape, bool)
    for k, ((x, y), (w, h)) in enumerate(zip(sheet.corners, sheet.texels, strict=True)):
        own_coverage = coverage[y : y + h, x : x + w]
        if k >= count:
            solid[y : y + h, x : x + w] = True
            continue
        opaque_count = int(np.ceil(own_coverage.sum()))
        if opaque_count:
            threshold = max(np.sort(own_coverage, axis=None)[-opaque_count], 1e-3)
            solid[y : y + h, x : x + w] = own_coverage >= threshold
    return solid


def _spread(image, is_known):
    """Fill transparent texels with the nearest colour, for texture filters."""
    if not is_known.any():
        return image
    row, column = ndimage.distance_transform_edt(
        ~is_known, return_distances=False, return_indices=True
    )
    return image[row, column]


def shelves(sizes, width):
    """Pack rectangles (n, 2) on shelves, tallest first; return lower left corners and height.

    The height is the largest integer if one is too wide.
    """
    sizes = np.asarray(sizes, int)
    corners = np.zeros_like(sizes)
    if (sizes[:, 0] > width).any():
        return corners, np.iinfo(int).max
    x = y = shelf = 0
    for k in np.lexsort((-sizes[:, 0], -sizes[:, 1])):
        w, h = sizes[k]
        if x + w > width:
            x, y, shelf = 0, y + shelf, 0
        corners[k] = x, y
        x, shelf = x + w, max(shelf, h)
    return corners, int(y + shelf)


def largest_scale(sizes, side, margin):
    """Return the most texels per unit at which rectangles (n, 2) fit into a square.

    And their sizes with margins, and lower left corners, in texels.
    """
    sizes = np.asarray(sizes, float)

    def packed(scale):
        texels = np.maximum(np.ceil(sizes * scale - 1e-9), 1).astype(int) + 2 * margin
        return texels, *shelves(texels, side)

    fitting_scale, upper_scale = 0.0, side / max(sizes.max(), 1e-300)
    if packed(fitting_scale)[2] > side:
        raise ValueError(f'side must be larger for {len(sizes)} rectangles, got {side}')
    for _ in range(30):
        middle_scale = (fitting_scale + upper_scale) / 2
        if packed(middle_scale)[2] <= side:
            fitting_scale = middle_scale
        else:
            upper_scale = middle_scale
    return fitting_scale, *packed(fitting_scale)[:2]
