"""Levels of detail of copies of meshes, within a triangle budget."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from pvibr.core.effect import Effect
from pvibr.export.drawn_surfaces import Surface, material_of, surface_of_part, tiled
from pvibr.meshes.parts import Part

#: Fewest and most planes of a billboard cloud.
_PLANES = (4, 32)
_CLOUD_TEXELS = 512
#: Largest fraction of the triangle budget for billboard clouds.
_CLOUDS = 0.5
#: Fewest triangles of a mesh that a cloud may replace.
_HEAVY = 200


@dataclass
class Copies:
    """A mesh with levels of detail, and the matrices of its copies."""

    owner: Effect
    levels: list
    largest: tuple
    matrices: np.ndarray
    colors: np.ndarray | None = None
    multiply: bool = False
    triangles: list = field(default_factory=list)

    def __post_init__(self):
        self.triangles = [sum(p.mesh.n_cells for p in level) for level in self.levels]

    def __len__(self):
        return len(self.matrices)

    def pixels(self, frame) -> np.ndarray:
        """Return the on-screen diameters of bounding spheres of copies, (k,), px."""
        mesh_points = np.concatenate([np.asarray(p.mesh.points, float) for p in self.levels[0]])
        mesh_center = (mesh_points.min(0) + mesh_points.max(0)) / 2
        mesh_radius = np.linalg.norm(mesh_points - mesh_center, axis=1).max()
        axes = self.matrices[:, :3, :3]
        copy_radii = mesh_radius * np.linalg.norm(axes, axis=1).max(1)
        copy_centers = axes @ mesh_center + self.matrices[:, :3, 3]
        eye_distances = np.maximum(np.linalg.norm(copy_centers - frame.eye, axis=1), frame.near)
        return 2 * copy_radii * frame.pixel_scale / (1.0 if frame.parallel else eye_distances)

    def accurate_levels(self, pixel_sizes) -> np.ndarray:
        """Return the coarsest sufficiently accurate level of each copy."""
        is_accurate = np.asarray(self.largest, float)[None] >= pixel_sizes[:, None]
        is_accurate[:, 0] = True
        return len(self.levels) - 1 - is_accurate[:, ::-1].argmax(1)

    def add_cloud(self, make_cloud, plane_count):
        """Add a billboard cloud as the coarsest level, if it has fewer triangles."""
        if self.triangles[-1] < _HEAVY:
            return
        cloud = make_cloud(self.levels[0], planes=plane_count, size=_CLOUD_TEXELS, supersample=2)
        triangle_count = 2 * cloud.mesh.n_cells
        if triangle_count < self.triangles[-1]:
            self.levels.append([cloud])
            self.triangles.append(triangle_count)
            self.largest = (*self.largest, 0.0)

    def surfaces(self, level_choice) -> list[Surface]:
        """Return all copies as one surface per part and level."""
        level_surfaces = []
        for level_number, level in enumerate(self.levels):
            copies = np.flatnonzero(level_choice == level_number)
            colors = None if self.colors is None else self.colors[copies]
            for part in level if len(copies) else ():
                surface = self._surface(part)
                level_surfaces.append(tiled(surface, self.matrices[copies], colors, self.multiply))
        return level_surfaces

    def _surface(self, part):
        if isinstance(part, Part):
            return surface_of_part(part, self.owner)
        return _surface_of_cloud(part, self)


def _surface_of_cloud(cloud, copies) -> Surface:
    quad_mesh = cloud.mesh.triangulate()
    material = material_of(copies.levels[0][0].actor.GetProperty())
    material.SetColor(1.0, 1.0, 1.0)
    return Surface(
        np.array(quad_mesh.points, float),
        np.asarray(quad_mesh.regular_faces, int),
        np.array(quad_mesh.point_data.active_normals, float),
        np.array(quad_mesh.active_texture_coordinates, float),
        None,
        np.asarray(cloud.texture.to_array()),
        material,
        copies.owner,
        cutout=0.5,
        repeat=False,
    )


def chosen_levels(groups, frame, max_triangles, make_cloud) -> list[np.ndarray]:
    """Return the level of each copy within the triangle budget; -1 drops the copy."""
    if not groups:
        return []
    pixel_sizes = [group.pixels(frame) for group in groups]
    levels = [group.accurate_levels(p) for group, p in zip(groups, pixel_sizes, strict=True)]
    if _triangles(groups, levels).sum() > max_triangles:
        copy_count = sum(map(len, groups))
        plane_count = int(np.clip(_CLOUDS * max_triangles / (4 * copy_count), *_PLANES))
        for group in groups:
            group.add_cloud(make_cloud, plane_count)
    group_ends = np.cumsum([len(group) for group in groups])[:-1]
    level_choice = np.concatenate(levels)
    smallest_first = np.argsort(np.concatenate(pixel_sizes), kind='stable')
    triangle_counts = _triangles(groups, levels)
    least_counts = np.concatenate([np.full(len(g), g.triangles[-1]) for g in groups])
    coarsest_levels = np.concatenate([np.full(len(g), len(g.levels) - 1) for g in groups])
    coarsened = _first_few(
        smallest_first, triangle_counts - least_counts, triangle_counts.sum() - max_triangles
    )
    level_choice[coarsened] = coarsest_levels[coarsened]
    triangle_counts[coarsened] = least_counts[coarsened]
    level_choice[
        _first_few(smallest_first, triangle_counts, triangle_counts.sum() - max_triangles)
    ] = -1
    return np.split(level_choice, group_ends)


def _first_few(smallest_first, savings, excess):
    """Return the first copies whose savings add up to the excess."""
    if excess <= 0:
        return smallest_first[:0]
    count = np.searchsorted(np.cumsum(savings[smallest_first]), excess) + 1
    return smallest_first[:count]


def _triangles(groups, levels):
    """Return the number of triangles of each copy."""
    return np.concatenate(
        [np.asarray(g.triangles)[k] for g, k in zip(groups, levels, strict=True)]
    )
