"""Copies of meshes within a triangle budget: the level of detail of each copy."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from pvibr.core.effect import Effect
from pvibr.export.surfaces import Surface, material_of, surface_of_part, tiled
from pvibr.meshes.parts import Part

#: Fewest and most planes of a billboard cloud.
_PLANES = (4, 32)
_CLOUD_TEXELS = 512
#: Maximum fraction of the triangle budget for billboard clouds.
_CLOUDS = 0.5
#: Fewest triangles of a mesh that is replaced by a cloud.
_HEAVY = 200


@dataclass
class Copies:
    """A mesh with its levels of detail, and the matrices of its copies."""

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
        """Return the diameters of copies on the screen for any view direction, (k,), px."""
        points = np.concatenate([np.asarray(p.mesh.points, float) for p in self.levels[0]])
        center = (points.min(0) + points.max(0)) / 2
        radius = np.linalg.norm(points - center, axis=1).max()
        axes = self.matrices[:, :3, :3]
        radii = radius * np.linalg.norm(axes, axis=1).max(1)
        centers = axes @ center + self.matrices[:, :3, 3]
        away = np.maximum(np.linalg.norm(centers - frame.eye, axis=1), frame.near)
        return 2 * radii * frame.pixel_scale / (1.0 if frame.parallel else away)

    def wanted(self, pixels) -> np.ndarray:
        """Return the coarsest level that is accurate enough for each copy."""
        good = np.asarray(self.largest, float)[None] >= pixels[:, None]
        good[:, 0] = True
        return len(self.levels) - 1 - good[:, ::-1].argmax(1)

    def add_cloud(self, planes):
        """Add a billboard cloud as the coarsest level, if it has fewer triangles."""
        from pvibr.billboard_clouds.cloud import billboard_cloud

        if self.triangles[-1] < _HEAVY:
            return
        cloud = billboard_cloud(self.levels[0], planes=planes, size=_CLOUD_TEXELS, supersample=2)
        count = 2 * cloud.mesh.n_cells
        if count < self.triangles[-1]:
            self.levels.append([cloud])
            self.triangles.append(count)
            self.largest = (*self.largest, 0.0)

    def surfaces(self, chosen) -> list[Surface]:
        """Return all copies, as one surface per part and level."""
        found = []
        for k, level in enumerate(self.levels):
            rows = np.flatnonzero(chosen == k)
            for part in level if len(rows) else ():
                one = self._surface(part)
                colors = None if self.colors is None else self.colors[rows]
                found.append(tiled(one, self.matrices[rows], colors, self.multiply))
        return found

    def _surface(self, part):
        if isinstance(part, Part):
            return surface_of_part(part, self.owner)
        return _surface_of_cloud(part, self)


def _surface_of_cloud(cloud, copies) -> Surface:
    mesh = cloud.mesh.triangulate()
    material = material_of(copies.levels[0][0].actor.GetProperty())
    material.SetColor(1.0, 1.0, 1.0)
    return Surface(
        np.array(mesh.points, float),
        np.asarray(mesh.regular_faces, int),
        np.array(mesh.point_data.active_normals, float),
        np.array(mesh.active_texture_coordinates, float),
        None,
        np.asarray(cloud.texture.to_array()),
        material,
        copies.owner,
        cutout=0.5,
        repeat=False,
    )


def chosen_levels(groups, frame, most) -> list[np.ndarray]:
    """Return the level of each copy, -1 if it is left out, within the triangle budget."""
    if not groups:
        return []
    pixels = [group.pixels(frame) for group in groups]
    levels = [group.wanted(p) for group, p in zip(groups, pixels, strict=True)]
    if _total(groups, levels) > most:
        count = sum(map(len, groups))
        for group in groups:
            planes = int(np.clip(_CLOUDS * most / (4 * count), *_PLANES))
            group.add_cloud(planes)
    ends = np.cumsum([len(group) for group in groups])[:-1]
    flat = np.concatenate(levels)
    order = np.argsort(np.concatenate(pixels), kind='stable')
    asked = _triangles(groups, levels)
    least = np.concatenate([np.full(len(g), g.triangles[-1]) for g in groups])
    lightest = np.concatenate([np.full(len(g), len(g.levels) - 1) for g in groups])
    light = _first_few(order, asked - least, asked.sum() - most)
    flat[light] = lightest[light]
    asked[light] = least[light]
    flat[_first_few(order, asked, asked.sum() - most)] = -1
    return np.split(flat, ends)


def _first_few(order, saved, too_many):
    """Return the first copies that together save enough triangles."""
    if too_many <= 0:
        return order[:0]
    count = np.searchsorted(np.cumsum(saved[order]), too_many) + 1
    return order[:count]


def _triangles(groups, levels):
    """Return the number of triangles of each copy."""
    return np.concatenate(
        [np.asarray(g.triangles)[k] for g, k in zip(groups, levels, strict=True)]
    )


def _total(groups, levels) -> int:
    return int(_triangles(groups, levels).sum())
