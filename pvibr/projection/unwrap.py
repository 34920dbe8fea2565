"""Texture coordinates of meshes, and the surface point of each texel."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pyvista as pv
from scipy import ndimage

from pvibr.gl.offscreen import triangles_seen
from pvibr.maths.views import orthographic
from pvibr.projection.samples import Samples, normals_and_areas

#: Texels around each part of a texture that take its colours, for filters that reach over edges.
_PAD = 8


def unwrapped(mesh) -> pv.PolyData:
    """Return the triangles of a mesh's surface with texture coordinates."""
    surface = mesh if isinstance(mesh, pv.PolyData) else mesh.extract_surface(algorithm=None)
    surface = surface.triangulate()
    if surface.active_texture_coordinates is not None:
        return surface
    try:
        import xatlas
    except ImportError as error:
        msg = (
            'The mesh has no texture coordinates. Give it some (mesh.active_texture_coordinates), '
            'or install xatlas, which makes them: pip install "pvibr[uv]"'
        )
        raise ImportError(msg) from error
    points = np.asarray(surface.points, float)
    # xatlas works with float32: far from the origin it would see nothing else.
    low, high = points.min(0), points.max(0)
    small = ((points - low) / ((high - low).max() or 1.0)).astype(np.float32)
    origin, faces, uv = xatlas.parametrize(small, surface.regular_faces.astype(np.uint32))
    found = pv.PolyData.from_regular_faces(points[origin], faces.astype(int))
    found.active_texture_coordinates = np.asarray(uv, float)
    return found


@dataclass(frozen=True, eq=False)
class TexelImage:
    """The texels of :func:`texels_of` in the texture."""

    inside: np.ndarray

    def filled(self, colors, covered) -> np.ndarray:
        """Return the texture; texels around charts take the nearest colour."""
        image = np.zeros((*self.inside.shape, 4), np.uint8)
        image[self.inside] = colors
        known = self.inside.copy()
        known[self.inside] = covered
        away, near = ndimage.distance_transform_edt(~known, return_indices=True)
        beside = (away <= _PAD) & ~known
        if known.any():
            around = image[near[0], near[1]]
            image[beside, :3] = around[beside, :3]  # what filters reach, under no alpha
            outside = beside & ~self.inside
            image[outside] = around[outside]
        return np.ascontiguousarray(image[::-1])


def texels_of(mesh, size) -> tuple[Samples, TexelImage]:
    """Return the surface points of the texels of a texture."""
    width, height = np.broadcast_to(np.asarray(size), 2).tolist()
    if not (int(width) == width > 0 and int(height) == height > 0):
        msg = f'size is {size!r}; it must be whole numbers of pixels above 0.'
        raise ValueError(msg)
    uv = np.asarray(mesh.active_texture_coordinates, float)
    faces = mesh.regular_faces.reshape(-1, 3)
    flat = pv.PolyData.from_regular_faces(np.column_stack([uv, np.zeros(len(uv))]), faces)
    view = orthographic(np.eye(3), (0.0, 0.0, -1.0), (1.0, 1.0, 1.0))
    (number,) = triangles_seen(flat, [view], (int(width), int(height)))
    inside = number >= 0
    row, column = np.nonzero(inside)
    cell = number[inside]
    at = np.column_stack([(column + 0.5) / width, (row + 0.5) / height])
    share = _barycentric(uv[faces[cell]], at)
    corner = np.asarray(mesh.points, float)[faces]
    normals, area = normals_and_areas(corner)
    places = np.einsum('nk,nkd->nd', share, corner[cell])
    return Samples.at(places, normals[cell], faces[cell], area[cell]), TexelImage(inside)


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
