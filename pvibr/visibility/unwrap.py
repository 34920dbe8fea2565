"""Texture coordinates of meshes, and the surface points of texels."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import pyvista as pv
from scipy import ndimage

from pvibr.gl.hidden_window import triangles_seen
from pvibr.maths.views import orthographic
from pvibr.visibility.surface_samples import Samples, normals_and_areas, polydata_of

#: Texels of padding around each chart, for filters that reach across its border.
_PAD = 8
#: Most triangles that xatlas unwraps at once: its time is superlinear in their number.
_PART = 5000
#: Texels processed at once.
_MANY = 1 << 16


def unwrapped(mesh, size=2048, advance=None) -> pv.PolyData:
    """Return the triangles of a mesh's surface with texture coordinates for a texture size."""
    surface = polydata_of(mesh).triangulate()
    uv = surface.active_texture_coordinates
    if uv is not None:
        # float32, as VTK's glTF writer requires.
        surface.active_texture_coordinates = np.asarray(uv, np.float32)
        return surface
    try:
        import xatlas
    except ImportError as error:
        raise ImportError(
            'mesh must have texture coordinates (mesh.active_texture_coordinates), got none; '
            'xatlas generates them: pip install "pvibr[uv]"'
        ) from error
    points, faces = np.asarray(surface.points, float), surface.regular_faces
    # xatlas uses float32, too coarse far from the origin.
    lower, upper = points.min(0), points.max(0)
    unit_points = ((points - lower) / ((upper - lower).max() or 1.0)).astype(np.float32)
    atlas, origins, parts = xatlas.Atlas(), [], _parts(unit_points[faces].mean(1))
    for k, face_rows in enumerate(parts):
        part_points, part_faces = np.unique(faces[face_rows], return_inverse=True)
        part_atlas = xatlas.Atlas()
        part_atlas.add_mesh(unit_points[part_points], part_faces.reshape(-1, 3).astype(np.uint32))
        part_atlas.generate()
        origin, part_faces, uv = part_atlas.get_mesh(0)
        uv = uv * [part_atlas.width, part_atlas.height] / (part_atlas.texels_per_unit or 1.0)
        atlas.add_uv_mesh(uv.astype(np.float32), part_faces)
        origins.append(part_points[origin])
        if advance is not None:
            advance((k + 1) / len(parts))
    options = xatlas.PackOptions()
    options.padding, options.resolution = 2, int(np.clip(np.max(size), 256, 2048))
    atlas.generate(pack_options=options)
    return _packed(atlas, points, origins, parts)


def _packed(atlas, points, origins, parts):
    """Return the mesh of an atlas, with triangles in the order of the surface."""
    point_count, places, atlas_faces = 0, [], np.empty((sum(map(len, parts)), 3), int)
    for k, face_rows in enumerate(parts):
        origin_points, faces, uv = atlas.get_mesh(k)
        atlas_faces[face_rows] = faces + point_count
        point_count += len(origin_points)
        places.append((origins[k][origin_points], uv))
    origin_points, uv = (np.concatenate(values) for values in zip(*places, strict=True))
    mesh = pv.PolyData.from_regular_faces(points[origin_points], atlas_faces)
    mesh.active_texture_coordinates = uv.astype(np.float32)
    return mesh


def _parts(middles) -> list[np.ndarray]:
    """Return indices of triangles in compact parts of at most `_PART`, by median splits."""
    pending, parts = [np.arange(len(middles))], []
    while pending:
        face_rows = pending.pop()
        if len(face_rows) <= _PART:
            parts.append(face_rows)
            continue
        axis = np.ptp(middles[face_rows], axis=0).argmax()
        face_rows = face_rows[np.argsort(middles[face_rows, axis], kind='stable')]
        pending += [face_rows[: len(face_rows) // 2], face_rows[len(face_rows) // 2 :]]
    return parts


@dataclass(frozen=True, eq=False)
class TexelTile:
    """Texels of a rectangle of a texture, with padding."""

    #: Rows and columns of the rectangle in the texture, row 0 at the top.
    where: tuple[slice, slice]
    #: Which texels, padding included, are on a triangle; bottom row first.
    inside: np.ndarray
    #: The triangle of each of these, and its barycentric coordinates there.
    cell: np.ndarray
    share: np.ndarray

    def values(self, values, empty) -> np.ndarray:
        """Return an image of the tile from values of texels inside, row 0 at the top."""
        image = np.full(self.inside.shape, empty, values.dtype)
        image[self.inside] = values
        return self._cropped(image)

    def filled(self, colors, covered, *, keep_bare=False) -> np.ndarray:
        """Return the tile's RGBA image, the nearest colour beside charts, or where not covered."""
        image = np.zeros((*self.inside.shape, 4), np.uint8)
        image[self.inside] = colors
        is_known = self.inside.copy()
        is_known[self.inside] = covered
        if is_known.any():
            distance, nearest = ndimage.distance_transform_edt(~is_known, return_indices=True)
            margin = distance <= _PAD
            # Mip levels average over everything that is not covered.
            to_fill = ~is_known & (margin | ~self.inside | (not keep_bare))
            outside = ~self.inside[to_fill]
            image[to_fill, :3] = image[nearest[0][to_fill], nearest[1][to_fill], :3]
            image[to_fill, 3] = np.where(outside & margin[to_fill], 255, 0)
        return self._cropped(image)

    def samples(self, mesh) -> Samples:
        """Return the surface points of the texels inside."""
        faces = mesh.regular_faces
        corner = np.asarray(mesh.points, float)[faces]
        normals, area = normals_and_areas(corner)
        texel_points = np.einsum('nk,nkd->nd', self.share, corner[self.cell])
        return Samples.at(texel_points, normals[self.cell], faces[self.cell], area[self.cell])

    def _cropped(self, image):
        height, width = (part.stop - part.start for part in self.where)
        return np.ascontiguousarray(image[_PAD : _PAD + height, _PAD : _PAD + width][::-1])


def checked_size(size) -> tuple[int, int]:
    """Return the width and height of a texture, validated."""
    width, height = np.broadcast_to(np.asarray(size), 2).tolist()
    if not (int(width) == width > 0 and int(height) == height > 0):
        raise ValueError(f'size must be positive whole numbers of pixels, got {size!r}')
    return int(width), int(height)


def tiles_of(mesh, size, side=2048) -> Iterator[TexelTile]:
    """Yield the tiles of a mesh's texture, row by row from the top."""
    width, height = checked_size(size)
    tile_w, tile_h = min(side, width), min(side, height)
    uv = np.asarray(mesh.active_texture_coordinates, float)
    faces = mesh.regular_faces
    uv_mesh = pv.PolyData.from_regular_faces(np.column_stack([uv, np.zeros(len(uv))]), faces)
    tile_corners = [(x, y) for y in range(0, height, tile_h) for x in range(0, width, tile_w)]
    scale = np.array([width, height], float)
    corners = [np.array([x, height - min(y + tile_h, height)]) - _PAD for x, y in tile_corners]
    tile_size = np.array([tile_w, tile_h]) + 2 * _PAD
    views = [
        orthographic(np.eye(3), (*(lower / scale), -1.0), (*((lower + tile_size) / scale), 1.0))
        for lower in corners
    ]
    tile_triangles = triangles_seen(uv_mesh, views, tuple(tile_size.tolist()))
    for (x, y), lower, face_of_texel in zip(tile_corners, corners, tile_triangles, strict=True):
        where = slice(y, min(y + tile_h, height)), slice(x, min(x + tile_w, width))
        yield TexelTile(
            where, face_of_texel >= 0, *_places(uv, faces, face_of_texel, lower, scale)
        )


def _places(uv, faces, face_of_texel, lower_texel, scale):
    """Return triangles and barycentric coordinates of a tile's texels that have a triangle."""
    row, column = np.nonzero(face_of_texel >= 0)
    cell = face_of_texel[row, column]
    share = np.empty((len(cell), 3), np.float32)
    for start in range(0, len(cell), _MANY):
        chunk = slice(start, start + _MANY)
        texel_uv = (np.column_stack([column[chunk], row[chunk]]) + 0.5 + lower_texel) / scale
        share[chunk] = _barycentric(uv[faces[cell[chunk]]], texel_uv)
    return cell, share


def texel_spacing(mesh, size) -> float:
    """Return the mean distance between texels on a mesh, world units."""
    uv = np.asarray(mesh.active_texture_coordinates, float) * checked_size(size)
    uv_corners = np.pad(uv, ((0, 0), (0, 1)))[mesh.regular_faces]
    return float(np.sqrt(mesh.area / max(normals_and_areas(uv_corners)[1].sum(), 1e-300)))


def _barycentric(corners, texel_uv):
    """Return barycentric coordinates, (n, 3), clipped to the triangle."""
    a, b = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    p = texel_uv - corners[:, 0]
    det = a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]
    det = np.where(det == 0, 1, det)
    s = (p[:, 0] * b[:, 1] - p[:, 1] * b[:, 0]) / det
    t = (a[:, 0] * p[:, 1] - a[:, 1] * p[:, 0]) / det
    share = np.clip(np.stack([1 - s - t, s, t], 1), 0, 1)
    return share / share.sum(1, keepdims=True)
