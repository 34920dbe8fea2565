"""The texture of a billboard cloud: planes flattened, rendered at once, packed."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pyvista as pv
from scipy import ndimage

from pvibr.billboard_clouds.coverage import by_part
from pvibr.gl import set_fragment_uniforms
from pvibr.gl.offscreen import rasterize
from pvibr.instances.bake import unlit_actor
from pvibr.maths.image_error import box_reduce
from pvibr.maths.packing import largest_scale
from pvibr.maths.views import orthographic
from pvibr.meshes.decimate import take_arrays

_MARGIN = 2  # texels around each picture that take its colours
_TURNS = 45  # rectangles are tried at every second degree
_BLOCK = 1 << 20  # distances looked at together


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
        """Return each image's corners, counter-clockwise, in world and texture space."""
        unit = np.array([[0, 0], [1, 0], [1, 1], [0, 1]])
        texel = unit * self.texels[:, None]
        flat = self.low[:, None].repeat(4, 1)
        flat[..., :2] += texel / self.scale
        points = np.einsum('kcd,kde->kce', flat, self.axes)
        return points, (self.corners[:, None] + texel) / self.side

    def flattened(self, points, plane):
        """Return points in texels of the texture, with their height above it."""
        flat = np.einsum('n...d,ned->n...e', points, self.axes[plane])
        to = np.column_stack([self.corners, np.zeros(len(self.corners))])
        shape = (len(plane), *[1] * (flat.ndim - 2), 3)
        return (flat - self.low[plane].reshape(shape)) * self.scale + to[plane].reshape(shape)


def arranged(planes, points, faces, side) -> Sheet:
    """Return the smallest rectangles around the contents of each plane, packed into a square."""
    order = np.argsort(planes.owner, kind='stable')
    starts = np.searchsorted(planes.owner[order], np.arange(len(planes) + 1))
    axes, low, sizes = [], [], []
    for k in range(len(planes)):
        ids = np.unique(faces[order[starts[k] : starts[k + 1]]])
        own, corner, size = _rectangle(points[ids], planes.normals[k])
        axes.append(own)
        low.append([*corner, planes.offsets[k]])
        sizes.append(size)
    size, first = np.array(sizes), np.array(low)
    try:
        scale, texels, corners = largest_scale(size, side, _MARGIN)
    except ValueError as error:
        raise ValueError(
            f'size is {side}; {len(planes)} billboards need more texels. Raise size or epsilon.'
        ) from error
    first[:, :2] -= (texels / scale - size) / 2
    return Sheet(np.array(axes), first, scale, texels, corners, side)


def _rectangle(points, normal):
    """Return axes, lower corner and size of a small rectangle around points on a plane."""
    u = np.cross(np.eye(3)[np.abs(normal).argmin()], normal)
    u /= np.linalg.norm(u)
    flat = points @ np.stack([u, np.cross(normal, u)]).T
    angle = np.arange(_TURNS) * (np.pi / 2 / _TURNS)
    cos, sin = np.cos(angle), np.sin(angle)
    wide = flat[:, :1] * cos + flat[:, 1:] * sin
    high = flat[:, 1:] * cos - flat[:, :1] * sin
    best = int(np.argmin(np.ptp(wide, axis=0) * np.ptp(high, axis=0)))
    if np.ptp(wide[:, best]) < np.ptp(high[:, best]):  # shelves like what lies flat
        wide, high, cos, sin = high, -wide, -sin, cos
    right = cos[best] * u + sin[best] * np.cross(normal, u)
    pair = np.stack([wide[:, best], high[:, best]], 1)
    return np.stack([right, np.cross(normal, right), normal]), pair.min(0), np.ptp(pair, axis=0)


def draw(parts, patches, origin, planes, sheet, reach, supersample):
    """Render the triangles near each plane onto it, and those of patches onto theirs."""
    color, normal = _rendered(parts, patches, origin, planes, sheet, reach, supersample)
    coverage = color[..., 3]
    solid = _solid(coverage, sheet, len(reach))
    weight = np.maximum(coverage, 1e-6)[..., None]
    shown = np.dstack([_spread(color[..., :3] / weight, coverage > 0), solid])
    length = np.linalg.norm(normal, axis=-1, keepdims=True)
    normal = np.where(length > 1e-6, normal / np.maximum(length, 1e-6), [0.0, 0.0, 1.0])
    normal = _spread(normal, coverage > 0) * 0.5 + 0.5
    return tuple(
        np.ascontiguousarray(np.rint(255 * a.clip(0, 1))[::-1].astype(np.uint8))
        for a in (shown, normal)
    )


def opaque_texels(parts, origin, planes, sheet, reach):
    """Return where :func:`draw` makes the texture opaque, nearly; bottom row first."""
    color, _ = _rendered(parts, [], origin, planes, sheet, reach, 1)
    return _solid(color[..., 3], sheet, len(reach))


def _rendered(parts, patches, origin, planes, sheet, reach, supersample):
    """Return colours with coverage and normals, both times coverage; bottom row first."""
    all_parts, near = [*parts, *patches], [reach] * len(parts) + [None] * len(patches)
    flat = [
        _laid_out(part, origin, planes, owner, sheet, away)
        for (part, owner), away in zip(by_part(all_parts, planes.owner), near, strict=True)
    ]
    return _drawn(flat, sheet.side, supersample)


def _laid_out(part, origin, planes, owner, sheet, reach):
    """Return a part flattened into the texture, with some triangles on several planes."""
    mesh = part.mesh
    points, faces = np.asarray(mesh.points, float) - origin, np.asarray(mesh.regular_faces)
    face, plane = np.arange(len(faces)), owner
    if reach is not None:
        face, plane = _pairs(points[faces], planes, owner, sheet, reach)
    ids = faces[face].ravel()
    new = pv.PolyData()
    new.points = sheet.flattened(points[faces[face]], plane).reshape(-1, 3).astype(np.float32)
    new.regular_faces = np.arange(len(ids)).reshape(-1, 3).astype(int)
    take_arrays(mesh, new, ids, face)
    _turn_normals(new, sheet.axes[plane], flat=part.actor.GetProperty().GetInterpolation() == 0)
    return part.with_mesh(new)


def _turn_normals(mesh, axes, *, flat):
    """Rotate the normals of unshared corners with their triangles."""
    for data, of in ((mesh.point_data, axes.repeat(3, 0)), (mesh.cell_data, axes)):
        if data.active_normals is None:
            continue
        if flat:  # then VTK takes those of the triangles, whatever there is
            del data[data.active_normals_name]
        else:
            turned = np.einsum('ned,nd->ne', of, np.asarray(data.active_normals))
            data.active_normals = turned.astype(np.float32)


def _pairs(corners, planes, owner, sheet, reach):
    """Return triangles and planes: its own of each, and others nearby within a rectangle."""
    found = []
    block = max(1, _BLOCK // len(planes))
    count = len(reach)
    for start in range(0, len(corners), block):
        some = corners[start : start + block]
        away = np.abs(planes.distances(some)).max(1)[:, :count]
        mine = owner[start : start + block]
        face, plane = np.nonzero(away <= reach)
        texel = sheet.flattened(some[face], plane)[..., :2] - sheet.corners[plane][:, None]
        inside = ((texel >= 0) & (texel <= sheet.texels[plane][:, None])).all((1, 2))
        other = inside & (plane != mine[face])
        found.append(
            (
                np.concatenate([np.arange(len(some)), face[other]]) + start,
                np.concatenate([mine, plane[other]]),
            )
        )
    face, plane = (np.concatenate(a) for a in zip(*found, strict=True))
    return face, plane


def _drawn(parts, side, supersample):
    high = max(float(np.abs(part.mesh.points[:, 2]).max()) for part in parts) + 1
    view = orthographic(np.eye(3), (0.0, 0.0, -high), (side, side, high))
    actors = [_actor(part) for part in parts]
    found = rasterize(actors, view, (side, side), ('rgba8', 'rgba8'), samples=supersample)
    color, normal = (_reduced(pixels, len(pixels) // side) for pixels in found)
    return color, normal[..., :3] * 2 - color[..., 3:]


def _actor(part):
    actor = unlit_actor(part, closed=False)
    set_fragment_uniforms([actor], {'ibr_object_from_view': np.eye(3)})
    return actor


def _reduced(pixels, factor):
    """Return means of squares of samples, some rows at a time; 0 to 1."""
    step = 64 * factor
    rows = [box_reduce(pixels[k : k + step], factor) for k in range(0, len(pixels), step)]
    return np.concatenate(rows) / 255


def _solid(coverage, sheet, count):
    """Return the opaque texels: in the first rectangles as many as their coverage, else all."""
    solid = np.zeros(coverage.shape, bool)
    for k, ((x, y), (w, h)) in enumerate(zip(sheet.corners, sheet.texels, strict=True)):
        own = coverage[y : y + h, x : x + w]
        if k >= count:
            solid[y : y + h, x : x + w] = True
            continue
        opaque = int(np.ceil(own.sum()))
        least = max(np.sort(own, axis=None)[-opaque], 1e-3) if opaque else 2.0
        solid[y : y + h, x : x + w] = own >= least
    return solid


def _spread(image, known):
    """Fill transparent texels with the nearest colour, for filters of any width."""
    if not known.any():
        return image
    row, column = ndimage.distance_transform_edt(
        ~known, return_distances=False, return_indices=True
    )
    return image[row, column]
