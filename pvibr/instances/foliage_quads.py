"""Foliage as textured quads, one for each leaf or cluster."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pyvista as pv
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from pvibr.core import _vtk
from pvibr.gl.offscreen import rasterize
from pvibr.images.sheet import shelves
from pvibr.instances.mesh_pool import lendable
from pvibr.maths.views import orthographic
from pvibr.meshes.materials import copy_property, copy_texture
from pvibr.meshes.parts import Part, as_parts

_SAMPLES = 2  # along a side of a texel
_ONE_SIDED = 0.9  # of the area of triangles, seen along the normals of their groups
_EDGE = 1  # texels around a group that stay empty
_ROUNDS = 12  # of Lloyd's algorithm
_THIN = 1e-3  # least width of a quad, in parts of its length


def components(mesh) -> np.ndarray:
    """Return the connected component of each triangle."""
    _, same = np.unique(np.asarray(mesh.points), axis=0, return_inverse=True)
    triangles = same.ravel()[mesh.regular_faces]
    ends = np.concatenate([triangles[:, :2], triangles[:, 1:]])
    count = int(same.max()) + 1
    graph = coo_array((np.ones(len(ends), bool), tuple(ends.T)), shape=(count, count))
    of_point = connected_components(graph, directed=False)[1][triangles[:, 0]]
    return np.unique(of_point, return_inverse=True)[1].ravel()


def clusters(centers, count, seed=0) -> np.ndarray:
    """Return the cluster of each point, by k-means with spread seeds."""
    if count >= len(centers):
        return np.arange(len(centers))
    rng = np.random.default_rng(seed)
    means = centers[rng.choice(len(centers), 1)]
    away = np.full(len(centers), np.inf)
    for _ in range(count - 1):
        away = np.minimum(away, ((centers - means[-1]) ** 2).sum(1))
        means = np.concatenate([means, centers[[int(away.argmax())]]])
    for _ in range(_ROUNDS):
        near = cKDTree(means).query(centers)[1]
        sums = [np.bincount(near, c, minlength=count) for c in centers.T]
        sizes = np.bincount(near, minlength=count)
        means = np.where(
            sizes[:, None] > 0, np.stack(sums, 1) / np.maximum(sizes, 1)[:, None], means
        )
    return np.unique(cKDTree(means).query(centers)[1], return_inverse=True)[1].ravel()


@dataclass
class Groups:
    """Groups of triangles, each with a local frame."""

    points: np.ndarray
    source: np.ndarray
    group: np.ndarray
    triangles: np.ndarray
    axes: np.ndarray
    low: np.ndarray
    high: np.ndarray
    #: Whether the triangles of each look along its normal, so that a quad may be culled as they.
    one_sided: bool = False

    @classmethod
    def of(cls, mesh, labels) -> Groups:
        """Divide a mesh."""
        faces, count = mesh.regular_faces, mesh.n_points
        keys, corner = np.unique(labels[:, None] * np.int64(count) + faces, return_inverse=True)
        group, source = np.divmod(keys, count)
        points = np.asarray(mesh.points, float)[source]
        axes = _principal(points, group)
        a, b, c = np.asarray(mesh.points, float)[faces].swapaxes(0, 1)
        across = np.cross(b - a, c - a)
        facing = np.bincount(labels, (across * axes[labels, 2]).sum(1))
        axes *= np.where(facing < 0, -1.0, 1.0)[:, None, None] ** [[0], [1], [1]]
        one_sided = np.abs(facing).sum() > _ONE_SIDED * np.linalg.norm(across, axis=1).sum()
        low, high = _extents(points, group, axes)
        triangles = corner.reshape(-1, 3)
        return cls(points, source, group, triangles, axes, low, high, bool(one_sided))

    def turned(self, k) -> Groups:
        """Return the groups with another axis as normal."""
        axes = np.roll(self.axes, k, 1)
        low, high = _extents(self.points, self.group, axes)
        return Groups(self.points, self.source, self.group, self.triangles, axes, low, high)

    def thickness(self) -> np.ndarray:
        """Return the thickness of each group over its plane, shape (g,)."""
        return (self.high[:, 2] - self.low[:, 2]) / 2

    def local(self) -> np.ndarray:
        """Return the points in the frames of their groups, shape (n, 3)."""
        return np.einsum('nij,nj->ni', self.axes[self.group], self.points)


def _principal(points, group):
    """Return tangent, bitangent and normal of each group, right-handed."""
    count = int(group.max()) + 1
    sizes = np.bincount(group, minlength=count)
    sums = np.stack([np.bincount(group, c, minlength=count) for c in points.T], 1)
    means = sums / sizes[:, None]
    off = points - means[group]
    squares = np.empty((count, 3, 3))
    for i in range(3):
        for j in range(3):
            squares[:, i, j] = np.bincount(group, off[:, i] * off[:, j], minlength=count)
    _, vectors = np.linalg.eigh(squares)
    along, normal = vectors[:, :, 2], vectors[:, :, 0]
    return np.stack([along, np.cross(normal, along), normal], 1)


def _extents(points, group, axes):
    local = np.einsum('nij,nj->ni', axes[group], points)
    starts = np.searchsorted(group, np.arange(len(axes)))  # points come by groups
    return np.minimum.reduceat(local, starts), np.maximum.reduceat(local, starts)


@dataclass
class Layout:
    """Where each group lies in a texture."""

    corners: np.ndarray
    sizes: np.ndarray
    scale: float
    size: tuple[int, int]

    @classmethod
    def of(cls, extents, side) -> Layout:
        """Pack rectangles at the largest common scale."""
        scale = side / np.sqrt(max(float(extents.prod(1).sum()), 1e-300))
        scale = min(scale, (side - 2 * _EDGE) / float(extents.max()))
        least = 1 + 2 * _EDGE
        if len(extents) * least**2 > side**2:
            raise ValueError(f'texture is {side} texels wide: too small for {len(extents)} quads')
        while True:
            sizes = np.maximum(np.ceil(extents * scale).astype(int), 1) + 2 * _EDGE
            corners, size = shelves(sizes, 1 << 30)
            if max(size) <= side or (sizes == least).all():
                return cls(corners, sizes, scale, size)
            scale *= 0.93


def quads(part, groups, *, texels=1024) -> Part:
    """Return one textured quad per group of a part's triangles."""
    low, high = (
        np.concatenate([getattr(g, name)[:, :2] for g in groups]) for name in ('low', 'high')
    )
    extents = high - low
    extents = np.maximum(extents, _THIN * extents.max(1, keepdims=True) + 1e-30)
    layout = Layout.of(extents, texels)
    flat = _flattened(part, groups, layout, low)
    picture = pv.Texture(dilated(_drawn(part, flat, layout.size))[::-1])
    picture.interpolate, picture.repeat = True, False
    mesh = _quads(groups, layout, low, _mean_normals(part.mesh, groups))
    (out,) = as_parts(mesh, texture=picture, alpha_cutoff=0.5, color='white')
    prop = _vtk.vtkProperty()
    copy_property(prop, part.actor.GetProperty())
    prop.SetColor(1.0, 1.0, 1.0)
    if not all(g.one_sided for g in groups):
        prop.BackfaceCullingOff()
        prop.FrontfaceCullingOff()
    out.actor.SetProperty(prop)
    return out


def _flattened(part, groups, layout, low):
    """Return the triangles of all groups flattened along their normals, side by side."""
    pieces, first = [], 0
    for g in groups:
        count = len(g.axes)
        local = g.local()
        corners = layout.corners[first : first + count] + _EDGE
        flat = np.empty_like(local)
        spare = layout.sizes[first : first + count] - 2 * _EDGE
        wide = (g.high - g.low)[:, :2] * layout.scale
        flat[:, :2] = (local[:, :2] - low[first : first + count][g.group]) * layout.scale
        flat[:, :2] += (corners + (spare - wide) / 2)[g.group]
        depth = np.maximum((g.high - g.low)[:, 2], 1e-300)
        flat[:, 2] = ((local[:, 2] - g.low[g.group, 2]) / depth[g.group]).clip(0, 1)
        mesh = pv.PolyData.from_regular_faces(flat, g.triangles)
        source = part.mesh
        for name in source.point_data:
            mesh.point_data[name] = np.asarray(source.point_data[name])[g.source]
        for name in source.cell_data:
            mesh.cell_data[name] = np.asarray(source.cell_data[name])
        _keep_active(source, mesh)
        pieces.append(mesh)
        first += count
    return pieces


def _keep_active(source, mesh):
    info, coordinates = source.active_scalars_info, source.active_texture_coordinates
    if info.name is not None and info.association.name in ('POINT', 'CELL'):
        mesh.set_active_scalars(info.name, preference=info.association.name.lower())
    if coordinates is not None:
        name = source.GetPointData().GetTCoords().GetName()
        mesh.GetPointData().SetActiveTCoords(name)


def _drawn(part, meshes, size):
    """Return premultiplied RGBA from 0 to 1 of flattened meshes, bottom row first."""
    width, height = size
    view = orthographic(np.eye(3), (0.0, 0.0, -1.0), (width, height, 2.0))
    actors = [_unlit(part, mesh) for mesh in meshes]
    picture = rasterize(actors, view, size, samples=_SAMPLES, blend=True)[0]
    picture = picture.astype(np.float32) / 255
    picture = picture.reshape(height, _SAMPLES, width, _SAMPLES, 4)
    return picture.mean((1, 3))


def _unlit(part, mesh):
    mapper = part.polydata_mapper()
    mapper.SetInputDataObject(mesh)
    actor = lendable(part, mapper)
    prop = _vtk.vtkProperty()
    copy_property(prop, part.actor.GetProperty())
    prop.LightingOff()
    prop.BackfaceCullingOff()
    prop.FrontfaceCullingOff()
    actor.SetProperty(prop)
    # Unlit, there is no normal to turn.
    actor.GetShaderProperty().ClearFragmentShaderReplacement('//VTK::Normal::Impl', True)
    actor.SetTexture(copy_texture(part.actor.GetTexture()))
    actor.ForceOpaqueOn()
    return actor


def dilated(picture):
    """Return straight RGBA whose transparent texels take the nearest colours.

    Premultiplied averages are pulled up a pyramid, holes take the finest that has any: Gortler et
    al., "The Lumigraph", SIGGRAPH 1996, section 3.4.
    """
    levels = [picture]
    while max(levels[-1].shape[:2]) > 1:
        a = levels[-1]
        a = np.pad(a, ((0, a.shape[0] % 2), (0, a.shape[1] % 2), (0, 0)))
        levels.append(0.25 * (a[::2, ::2] + a[1::2, ::2] + a[::2, 1::2] + a[1::2, 1::2]))
    filled = np.zeros((1, 1, 3), np.float32)
    for a in reversed(levels):
        if filled.shape[:2] != a.shape[:2]:
            filled = filled.repeat(2, 0).repeat(2, 1)[: a.shape[0], : a.shape[1]]
        alpha = a[..., 3:]
        filled = np.where(alpha > 0, a[..., :3] / np.maximum(alpha, 1e-6), filled)
    rgba = np.concatenate([filled, picture[..., 3:]], 2)
    return np.rint(255 * rgba.clip(0, 1)).astype(np.uint8)


def _mean_normals(mesh, groups):
    """Return the mean normal of each group, None without normals."""
    given = mesh.point_data.active_normals
    if given is None:
        return None
    rows = []
    for g in groups:
        each = np.asarray(given, float)[g.source]
        sums = np.stack([np.bincount(g.group, c) for c in each.T], 1)
        lengths = np.linalg.norm(sums, axis=1, keepdims=True)
        rows.append(np.where(lengths > 1e-9, sums / np.maximum(lengths, 1e-9), g.axes[:, 2]))
    return np.concatenate(rows)


def _quads(groups, layout, low, normals):
    """Return the quads as triangles, with texture coordinates."""
    axes = np.concatenate([g.axes for g in groups])
    wide = np.concatenate([(g.high - g.low)[:, :2] for g in groups]) * layout.scale
    middle = np.concatenate([(g.high + g.low)[:, 2] / 2 for g in groups])
    # Half a texel more than the group on each side, where it fades out.
    corner = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], float)
    spare = layout.sizes - 2 * _EDGE - wide
    texel = 0.5 + corner * (layout.sizes[:, None] - 1)
    off = (texel - (_EDGE + spare / 2)[:, None]) / layout.scale + low[:, None]
    local = np.concatenate([off, np.broadcast_to(middle[:, None, None], (*off.shape[:2], 1))], 2)
    points = np.einsum('gki,gij->gkj', local, axes).reshape(-1, 3)
    first = 4 * np.arange(len(axes))[:, None]
    faces = (first + np.array([0, 1, 2, 0, 2, 3])).reshape(-1, 2, 3)
    if normals is not None:
        # VTK turns normals of what is seen from behind.
        behind = (axes[:, 2] * normals).sum(1) < 0
        faces[behind] = faces[behind][:, :, ::-1]
    mesh = pv.PolyData.from_regular_faces(points, faces.reshape(-1, 3))
    if normals is not None:
        mesh.point_data.active_normals = normals.repeat(4, 0).astype(np.float32)
    uv = (layout.corners[:, None] + texel) / layout.size
    mesh.active_texture_coordinates = uv.reshape(-1, 2).astype(np.float32)
    return mesh
