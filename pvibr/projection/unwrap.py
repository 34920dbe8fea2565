"""Texture coordinates of meshes, and the surface point of each texel."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import pyvista as pv
from scipy import ndimage

from pvibr.gl.offscreen import triangles_seen
from pvibr.maths.views import orthographic
from pvibr.projection.samples import Samples, normals_and_areas

#: Texels around each part of a texture that take its colours, for filters that reach over edges.
_PAD = 8
#: Triangles that xatlas unwraps at once: its time grows faster than their number.
_PART = 5000
#: Texels that are looked up at once.
_MANY = 1 << 16


def unwrapped(mesh, size=2048, advance=None) -> pv.PolyData:
    """Return the triangles of a mesh's surface with texture coordinates, for a texture's size."""
    surface = mesh if isinstance(mesh, pv.PolyData) else mesh.extract_surface(algorithm=None)
    surface = surface.triangulate()
    uv = surface.active_texture_coordinates
    if uv is not None:
        surface.active_texture_coordinates = np.asarray(uv, np.float32)  # as VTK's glTF wants them
        return surface
    try:
        import xatlas
    except ImportError as error:
        raise ImportError(
            'The mesh has no texture coordinates. Give it some (mesh.active_texture_coordinates), '
            'or install xatlas, which makes them: pip install "pvibr[uv]"'
        ) from error
    points, faces = np.asarray(surface.points, float), surface.regular_faces
    # xatlas works with float32: far from the origin it would see nothing else.
    low, high = points.min(0), points.max(0)
    small = ((points - low) / ((high - low).max() or 1.0)).astype(np.float32)
    atlas, origins, parts = xatlas.Atlas(), [], _parts(small[faces].mean(1))
    for k, rows in enumerate(parts):
        used, part = np.unique(faces[rows], return_inverse=True)
        one = xatlas.Atlas()
        one.add_mesh(small[used], part.reshape(-1, 3).astype(np.uint32))
        one.generate()
        origin, part, uv = one.get_mesh(0)
        uv = uv * [one.width, one.height] / (one.texels_per_unit or 1.0)
        atlas.add_uv_mesh(uv.astype(np.float32), part)
        origins.append(used[origin])
        if advance is not None:
            advance((k + 1) / len(parts))
    options = xatlas.PackOptions()
    options.padding, options.resolution = 2, int(np.clip(np.max(size), 256, 2048))
    atlas.generate(pack_options=options)
    return _packed(atlas, points, origins, parts)


def _packed(atlas, points, origins, parts):
    """Return the mesh of an atlas, its triangles in the order of the surface."""
    count, places, found = 0, [], np.empty((sum(map(len, parts)), 3), int)
    for k, rows in enumerate(parts):
        origin, faces, uv = atlas.get_mesh(k)
        found[rows] = faces + count
        count += len(origin)
        places.append((origins[k][origin], uv))
    origin, uv = (np.concatenate(values) for values in zip(*places, strict=True))
    mesh = pv.PolyData.from_regular_faces(points[origin], found)
    mesh.active_texture_coordinates = uv.astype(np.float32)
    return mesh


def _parts(middles) -> list[np.ndarray]:
    """Return the rows of triangles near each other, halved until they are few."""
    waiting, found = [np.arange(len(middles))], []
    while waiting:
        rows = waiting.pop()
        if len(rows) <= _PART:
            found.append(rows)
            continue
        axis = np.ptp(middles[rows], axis=0).argmax()
        rows = rows[np.argsort(middles[rows, axis], kind='stable')]
        waiting += [rows[: len(rows) // 2], rows[len(rows) // 2 :]]
    return found


@dataclass(frozen=True, eq=False)
class TexelTile:
    """Texels of a rectangle of a texture, with those around it."""

    #: Rows and columns in the texture, row 0 at the top.
    where: tuple[slice, slice]
    #: Bottom row first.
    inside: np.ndarray
    #: The triangle of each texel inside, and its barycentric coordinates there.
    cell: np.ndarray
    share: np.ndarray

    def values(self, values, empty) -> np.ndarray:
        """Return values of texels inside as the tile's image, row 0 at the top."""
        image = np.full(self.inside.shape, empty, values.dtype)
        image[self.inside] = values
        return self._own(image)

    def filled(self, colors, covered) -> np.ndarray:
        """Return the tile of a texture; texels around charts take the nearest colour."""
        image = np.zeros((*self.inside.shape, 4), np.uint8)
        image[self.inside] = colors
        known = self.inside.copy()
        known[self.inside] = covered
        if known.any():
            away, near = ndimage.distance_transform_edt(~known, return_indices=True)
            margin = away <= _PAD
            rest = ~known & (margin | ~self.inside)  # mip levels reach over all that is outside
            outside = ~self.inside[rest]
            image[rest, :3] = image[near[0][rest], near[1][rest], :3]
            image[rest, 3] = np.where(outside & margin[rest], 255, 0)
        return self._own(image)

    def samples(self, mesh) -> Samples:
        """Return the surface points of the texels inside."""
        faces = mesh.regular_faces
        corner = np.asarray(mesh.points, float)[faces]
        normals, area = normals_and_areas(corner)
        places = np.einsum('nk,nkd->nd', self.share, corner[self.cell])
        return Samples.at(places, normals[self.cell], faces[self.cell], area[self.cell])

    def _own(self, image):
        rows, columns = (part.stop - part.start for part in self.where)
        return np.ascontiguousarray(image[_PAD : _PAD + rows, _PAD : _PAD + columns][::-1])


def checked_size(size) -> tuple[int, int]:
    """Return the width and height of a texture."""
    width, height = np.broadcast_to(np.asarray(size), 2).tolist()
    if not (int(width) == width > 0 and int(height) == height > 0):
        raise ValueError(f'size is {size!r}; it must be whole numbers of pixels above 0.')
    return int(width), int(height)


def tiles_of(mesh, size, side=2048) -> Iterator[TexelTile]:
    """Yield the tiles of a texture of a mesh, rows of them from the top."""
    width, height = checked_size(size)
    wide, high = min(side, width), min(side, height)
    uv = np.asarray(mesh.active_texture_coordinates, float)
    faces = mesh.regular_faces
    flat = pv.PolyData.from_regular_faces(np.column_stack([uv, np.zeros(len(uv))]), faces)
    starts = [(x, y) for y in range(0, height, high) for x in range(0, width, wide)]
    scale = np.array([width, height], float)
    corners = [np.array([x - _PAD, height - min(y + high, height) - _PAD]) for x, y in starts]
    room = np.array([wide, high]) + 2 * _PAD
    views = [
        orthographic(np.eye(3), (*(low / scale), -1.0), (*((low + room) / scale), 1.0))
        for low in corners
    ]
    seen = triangles_seen(flat, views, tuple(room.tolist()))
    for (x, y), low, number in zip(starts, corners, seen, strict=True):
        where = slice(y, min(y + high, height)), slice(x, min(x + wide, width))
        yield TexelTile(where, number >= 0, *_places(uv, faces, number, low, scale))


def _places(uv, faces, number, low, scale):
    """Return the triangles of a tile's texels that have one, and barycentric coordinates there."""
    row, column = np.nonzero(number >= 0)
    cell = number[row, column]
    share = np.empty((len(cell), 3), np.float32)
    for start in range(0, len(cell), _MANY):
        part = slice(start, start + _MANY)
        at = (np.column_stack([column[part], row[part]]) + 0.5 + low) / scale
        share[part] = _barycentric(uv[faces[cell[part]]], at)
    return cell, share


def texel_spacing(mesh, size) -> float:
    """Return the mean distance of a texture's texels on a mesh, world units."""
    uv = np.asarray(mesh.active_texture_coordinates, float) * checked_size(size)
    flat = np.pad(uv, ((0, 0), (0, 1)))[mesh.regular_faces]
    return float(np.sqrt(mesh.area / max(normals_and_areas(flat)[1].sum(), 1e-300)))


def _barycentric(corners, at):
    """Return barycentric coordinates, (n, 3), clipped to the triangle."""
    a, b = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    p = at - corners[:, 0]
    det = a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]
    det = np.where(det == 0, 1, det)
    s = (p[:, 0] * b[:, 1] - p[:, 1] * b[:, 0]) / det
    t = (a[:, 0] * p[:, 1] - a[:, 1] * p[:, 0]) / det
    share = np.clip(np.stack([1 - s - t, s, t], 1), 0, 1)
    return share / share.sum(1, keepdims=True)
