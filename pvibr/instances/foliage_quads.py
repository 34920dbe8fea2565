"""Foliage as textured quads, one for each leaf or cluster."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pyvista as pv
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from pvibr.core import _vtk
from pvibr.gl.hidden_window import rasterize
from pvibr.instances.mesh_pool import lendable
from pvibr.maths.filled_texels import dilated
from pvibr.maths.views import orthographic
from pvibr.meshes.parts import Part, as_parts
from pvibr.meshes.surfaces import set_active
from pvibr.textures.material_textures import copy_property, copy_texture
from pvibr.textures.sheet import shelves

_SAMPLES = 2  # along a side of a texel
_ONE_SIDED = 0.9  # net projected area of triangles along their group's normal, of their area
_EDGE = 1  # empty texels around a group
_ROUNDS = 12  # of Lloyd's algorithm
_THIN = 1e-3  # minimum width of a quad relative to its length


def components(mesh) -> np.ndarray:
    """Return the connected component of each triangle."""
    _, place_of_point = np.unique(np.asarray(mesh.points), axis=0, return_inverse=True)
    triangles = place_of_point.ravel()[mesh.regular_faces]
    edge_ends = np.concatenate([triangles[:, :2], triangles[:, 1:]])
    count = int(place_of_point.max()) + 1
    graph = coo_array((np.ones(len(edge_ends), bool), tuple(edge_ends.T)), shape=(count, count))
    component_of_triangle = connected_components(graph, directed=False)[1][triangles[:, 0]]
    return np.unique(component_of_triangle, return_inverse=True)[1].ravel()


def clusters(centers, count, seed=0) -> np.ndarray:
    """Return the cluster of each point, by k-means with farthest-point seeds."""
    if count >= len(centers):
        return np.arange(len(centers))
    rng = np.random.default_rng(seed)
    means = centers[rng.choice(len(centers), 1)]
    distances = np.full(len(centers), np.inf)
    for _ in range(count - 1):
        distances = np.minimum(distances, ((centers - means[-1]) ** 2).sum(1))
        means = np.concatenate([means, centers[[int(distances.argmax())]]])
    for _ in range(_ROUNDS):
        nearest = cKDTree(means).query(centers)[1]
        cluster_sums = [np.bincount(nearest, c, minlength=count) for c in centers.T]
        sizes = np.bincount(nearest, minlength=count)
        means = np.where(
            sizes[:, None] > 0,
            np.stack(cluster_sums, 1) / np.maximum(sizes, 1)[:, None],
            means,
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
    #: Whether triangles face along their group's normal, so that its quad may be culled like them.
    one_sided: bool = False

    @classmethod
    def of(cls, mesh, labels) -> Groups:
        """Divide a mesh."""
        faces, count = mesh.regular_faces, mesh.n_points
        keys, corner_ids = np.unique(
            labels[:, None] * np.int64(count) + faces, return_inverse=True
        )
        group, source = np.divmod(keys, count)
        points = np.asarray(mesh.points, float)[source]
        axes = _principal(points, group)
        a, b, c = np.asarray(mesh.points, float)[faces].swapaxes(0, 1)
        area_normals = np.cross(b - a, c - a)
        facing_area = np.bincount(labels, (area_normals * axes[labels, 2]).sum(1))
        axes *= np.where(facing_area < 0, -1.0, 1.0)[:, None, None] ** [[0], [1], [1]]
        areas = np.linalg.norm(area_normals, axis=1)
        one_sided = np.abs(facing_area).sum() > _ONE_SIDED * areas.sum()
        low, high = _extents(points, group, axes)
        triangles = corner_ids.reshape(-1, 3)
        return cls(points, source, group, triangles, axes, low, high, bool(one_sided))

    def turned(self, k) -> Groups:
        """Return the groups with another axis as normal."""
        axes = np.roll(self.axes, k, 1)
        low, high = _extents(self.points, self.group, axes)
        return Groups(self.points, self.source, self.group, self.triangles, axes, low, high)

    def local(self) -> np.ndarray:
        """Return the points in the frames of their groups, shape (n, 3)."""
        return np.einsum('nij,nj->ni', self.axes[self.group], self.points)


def _principal(points, group):
    """Return tangent, bitangent and normal of each group, right-handed."""
    count = int(group.max()) + 1
    group_sizes = np.bincount(group, minlength=count)
    group_sums = np.stack([np.bincount(group, c, minlength=count) for c in points.T], 1)
    means = group_sums / group_sizes[:, None]
    offsets = points - means[group]
    squares = np.empty((count, 3, 3))
    for i in range(3):
        for j in range(3):
            squares[:, i, j] = np.bincount(group, offsets[:, i] * offsets[:, j], minlength=count)
    _, vectors = np.linalg.eigh(squares)
    tangents, normals = vectors[:, :, 2], vectors[:, :, 0]
    return np.stack([tangents, np.cross(normals, tangents), normals], 1)


def _extents(points, group, axes):
    local = np.einsum('nij,nj->ni', axes[group], points)
    starts = np.searchsorted(group, np.arange(len(axes)))  # points come by groups
    return np.minimum.reduceat(local, starts), np.maximum.reduceat(local, starts)


@dataclass
class TextureLayout:
    """Where each group lies in a texture."""

    corners: np.ndarray
    sizes: np.ndarray
    scale: float
    size: tuple[int, int]

    @classmethod
    def of(cls, extents, side) -> TextureLayout:
        """Pack rectangles at the largest common scale."""
        scale = side / np.sqrt(max(float(extents.prod(1).sum()), 1e-300))
        scale = min(scale, (side - 2 * _EDGE) / float(extents.max()))
        smallest = 1 + 2 * _EDGE
        if len(extents) * smallest**2 > side**2:
            raise ValueError(f'texels must be larger for {len(extents)} quads, got {side}')
        while True:
            sizes = np.maximum(np.ceil(extents * scale).astype(int), 1) + 2 * _EDGE
            corners, size = shelves(sizes, 1 << 30)
            if max(size) <= side or (sizes == smallest).all():
                return cls(corners, sizes, scale, size)
            scale *= 0.93


def quads(part, groups, *, texels=1024) -> Part:
    """Return one textured quad per group of a part's triangles."""
    low, high = (
        np.concatenate([getattr(g, name)[:, :2] for g in groups]) for name in ('low', 'high')
    )
    quad_extents = high - low
    quad_extents = np.maximum(quad_extents, _THIN * quad_extents.max(1, keepdims=True) + 1e-30)
    layout = TextureLayout.of(quad_extents, texels)
    flat_meshes = _flattened(part, groups, layout, low)
    quad_texture = pv.Texture(dilated(_drawn(part, flat_meshes, layout.size))[::-1])
    quad_texture.interpolate, quad_texture.repeat = True, False
    mesh = _quads(groups, layout, low, _mean_normals(part.mesh, groups))
    (quad_part,) = as_parts(mesh, texture=quad_texture, alpha_cutoff=0.5, color='white')
    quad_material = _vtk.vtkProperty()
    copy_property(quad_material, part.actor.GetProperty())
    quad_material.SetColor(1.0, 1.0, 1.0)
    if not all(g.one_sided for g in groups):
        quad_material.BackfaceCullingOff()
        quad_material.FrontfaceCullingOff()
    quad_part.actor.SetProperty(quad_material)
    return quad_part


def _flattened(part, groups, layout, low):
    """Return the triangles of all groups projected along their normals, side by side."""
    flat_meshes, first_group = [], 0
    for g in groups:
        count = len(g.axes)
        local = g.local()
        texel_corners = layout.corners[first_group : first_group + count] + _EDGE
        flat = np.empty_like(local)
        margins = layout.sizes[first_group : first_group + count] - 2 * _EDGE
        widths = (g.high - g.low)[:, :2] * layout.scale
        group_low = low[first_group : first_group + count]
        flat[:, :2] = (local[:, :2] - group_low[g.group]) * layout.scale
        flat[:, :2] += (texel_corners + (margins - widths) / 2)[g.group]
        depths = np.maximum((g.high - g.low)[:, 2], 1e-300)
        flat[:, 2] = ((local[:, 2] - g.low[g.group, 2]) / depths[g.group]).clip(0, 1)
        mesh = pv.PolyData.from_regular_faces(flat, g.triangles)
        source = part.mesh
        for name in source.point_data:
            mesh.point_data[name] = np.asarray(source.point_data[name])[g.source]
        for name in source.cell_data:
            mesh.cell_data[name] = np.asarray(source.cell_data[name])
        _keep_active(source, mesh)
        flat_meshes.append(mesh)
        first_group += count
    return flat_meshes


def _keep_active(source, mesh):
    set_active(mesh, source.active_scalars_info)
    if source.active_texture_coordinates is not None:
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
    # Unlit, there is no normal to flip.
    actor.GetShaderProperty().ClearFragmentShaderReplacement('//VTK::Normal::Impl', True)
    actor.SetTexture(copy_texture(part.actor.GetTexture()))
    actor.ForceOpaqueOn()
    return actor


def _mean_normals(mesh, groups):
    """Return the mean normal of each group, None without normals."""
    point_normals = mesh.point_data.active_normals
    if point_normals is None:
        return None
    normals = []
    for g in groups:
        vertex_normals = np.asarray(point_normals, float)[g.source]
        sums = np.stack([np.bincount(g.group, c) for c in vertex_normals.T], 1)
        lengths = np.linalg.norm(sums, axis=1, keepdims=True)
        normals.append(np.where(lengths > 1e-9, sums / np.maximum(lengths, 1e-9), g.axes[:, 2]))
    return np.concatenate(normals)


def _quads(groups, layout, low, normals):
    """Return the quads as triangles, with texture coordinates."""
    axes = np.concatenate([g.axes for g in groups])
    widths = np.concatenate([(g.high - g.low)[:, :2] for g in groups]) * layout.scale
    offsets = np.concatenate([(g.high + g.low)[:, 2] / 2 for g in groups])
    # Half a texel larger than the group on each side, where it fades out.
    unit_corners = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], float)
    margins = layout.sizes - 2 * _EDGE - widths
    texel_positions = 0.5 + unit_corners * (layout.sizes[:, None] - 1)
    in_plane = (texel_positions - (_EDGE + margins / 2)[:, None]) / layout.scale + low[:, None]
    out_of_plane = np.broadcast_to(offsets[:, None, None], (*in_plane.shape[:2], 1))
    local = np.concatenate([in_plane, out_of_plane], 2)
    points = np.einsum('gki,gij->gkj', local, axes).reshape(-1, 3)
    first_points = 4 * np.arange(len(axes))[:, None]
    faces = (first_points + np.array([0, 1, 2, 0, 2, 3])).reshape(-1, 2, 3)
    if normals is not None:
        # VTK flips the normals of faces seen from behind.
        faces_back = (axes[:, 2] * normals).sum(1) < 0
        faces[faces_back] = faces[faces_back][:, :, ::-1]
    mesh = pv.PolyData.from_regular_faces(points, faces.reshape(-1, 3))
    if normals is not None:
        mesh.point_data.active_normals = normals.repeat(4, 0).astype(np.float32)
    texture_coordinates = (layout.corners[:, None] + texel_positions) / layout.size
    mesh.active_texture_coordinates = texture_coordinates.reshape(-1, 2).astype(np.float32)
    return mesh
