"""A wooded valley: thousands of detailed trees, a trail and a camera path."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pyvista as pv
from scipy.interpolate import CubicSpline
from scipy.ndimage import map_coordinates
from scipy.spatial import cKDTree

from pvibr.maths.transforms import trs
from pvibr.scenes.trees import COLORS, KINDS, tree, with_looks

#: Mean distance of trees in metres.
SPACING = 30.0
#: Metres without trees on both sides of the trail.
CLEARING = 20.0
#: Grid cells along each side of the terrain.
CELLS = 128
SCALES = (0.7, 1.3)
GRASS, DRY, ROCK = np.array([[128, 150, 78], [178, 172, 108], [158, 150, 136]])


@dataclass(frozen=True)
class Landscape:
    """Terrain, trees and a trail."""

    terrain: pv.PolyData
    kinds: tuple[str, ...]
    meshes: list[pv.MultiBlock]
    index: np.ndarray
    matrices: np.ndarray
    trail: CubicSpline
    heights: np.ndarray
    size: float
    view_angle: float = 50.0

    def parts(self):
        """Return the trees as parts with their looks."""
        return [with_looks(mesh, kind) for mesh, kind in zip(self.meshes, self.kinds, strict=True)]

    def height_at(self, places):
        """Return terrain heights."""
        return _height(self.heights, self.size, np.asarray(places, dtype=np.float64))

    def path(self, frames, start=0.0, stop=1.0):
        """Return camera positions along the trail."""
        if frames < 1 or not 0 <= start <= stop <= 1:
            raise ValueError(
                'frames must be at least 1 and 0 <= start <= stop <= 1, '
                f'got {frames}, {start} and {stop}'
            )
        trail_share = np.linspace(start, stop, frames)
        eye, focus = self.trail(trail_share), self.trail(trail_share + 0.07)
        # Between 2.5 m, a walker, and 11.5 m, a low drone.
        eye_height = 7.0 - 4.5 * np.cos(trail_share * 4 * np.pi)
        eye = np.column_stack([eye, self.height_at(eye) + eye_height])
        focus = np.column_stack([focus, self.height_at(focus) + 10.0])
        up = (0.0, 0.0, 1.0)
        return [
            (tuple(e), tuple(f), up) for e, f in zip(eye.tolist(), focus.tolist(), strict=True)
        ]


def landscape(n=10_000, seed=0, size=None, triangles=50_000):
    """Return a landscape with n trees."""
    if n < 1:
        raise ValueError(f'n must be at least 1, got {n}')
    # Below 300 m the clearing would cover the terrain.
    size = max(SPACING * np.sqrt(n), 300.0) if size is None else float(size)
    rng = np.random.default_rng(seed)
    heights = _ground(size, rng)
    trail = _trail(size, rng)
    places = _places(n, size, trail, rng)
    z = _height(heights, size, places)
    return Landscape(
        terrain=_terrain(heights, size, rng),
        kinds=tuple(KINDS),
        meshes=[tree(kind, seed, triangles) for kind in KINDS],
        index=_kinds_at(places, z, size, rng),
        matrices=_matrices(places, z, rng),
        trail=trail,
        heights=heights,
        size=size,
    )


def _noise(places, wavelength, size, rng):
    """Return smooth noise of mean 0 and amplitude about 1 at positions (..., 2)."""
    knot_count = int(np.ceil(size / wavelength)) + 3
    knot_values = rng.standard_normal((knot_count, knot_count))
    knot_positions = np.moveaxis(places / wavelength + knot_count / 2, -1, 0)
    return map_coordinates(knot_values, knot_positions, order=3, mode='grid-wrap')


def _grid(size):
    line = np.linspace(-size / 2, size / 2, CELLS + 1)
    return np.stack(np.meshgrid(line, line), axis=-1)


def _ground(size, rng):
    places = _grid(size)
    # A valley, whose slopes show the forest and hide the edge of the terrain.
    rim_distance = np.linalg.norm(places, axis=-1) / (size / 2)
    hills = sum(
        size * share * _noise(places, size * wave, size, rng)
        for share, wave in ((0.022, 0.45), (0.009, 0.2), (0.0025, 0.08))
    )
    return 0.14 * size * np.minimum(rim_distance, 1.3) ** 1.7 + hills


def _height(heights, size, places):
    """Return heights on the terrain's triangles."""
    x, y = np.clip((places.reshape(-1, 2).T / size + 0.5) * CELLS, 0, CELLS)
    column, row = (np.minimum(v.astype(int), CELLS - 1) for v in (x, y))
    u, v = x - column, y - row
    near_height, far_height = heights[row, column], heights[row + 1, column + 1]
    side_height = np.where(u > v, heights[row, column + 1], heights[row + 1, column])
    point_heights = near_height + np.maximum(u, v) * (side_height - near_height)
    point_heights += np.minimum(u, v) * (far_height - side_height)
    return point_heights.reshape(places.shape[:-1])


def _terrain(heights, size, rng):
    places = _grid(size)
    points = np.concatenate([places, heights[..., None]], axis=-1).reshape(-1, 3)
    corner = (np.arange(CELLS)[:, None] * (CELLS + 1) + np.arange(CELLS)).ravel()
    right_corner, upper_corner = corner + 1, corner + CELLS + 1
    faces = np.stack(
        [corner, right_corner, upper_corner + 1, corner, upper_corner + 1, upper_corner], axis=1
    ).reshape(-1, 3)
    terrain = pv.PolyData.from_regular_faces(points, faces)
    slope = np.hypot(*np.gradient(heights, size / CELLS))
    dry_share = np.clip(heights / (0.2 * size) + 0.15 * _noise(places, size / 9, size, rng), 0, 1)
    rock_share = np.clip(4 * slope - 1.2, 0, 1)
    color = GRASS + dry_share[..., None] * (DRY - GRASS)
    color = color + rock_share[..., None] * (ROCK - color)
    color *= 1 + 0.06 * rng.standard_normal((*slope.shape, 1))
    terrain[COLORS] = np.clip(color, 0, 255).astype(np.uint8).reshape(-1, 3)
    return terrain.compute_normals(cell_normals=False, split_vertices=False)


def _trail(size, rng):
    knot_shares = np.linspace(0, 1.1, 8)
    x = (knot_shares - 0.5) * 0.62 * size
    y = 0.11 * size * np.sin(knot_shares * 7 + rng.uniform(0, 6)) + rng.normal(0, 0.015 * size, 8)
    return CubicSpline(knot_shares, np.column_stack([x, y]))


def _places(n, size, trail, rng):
    """Return clumped tree positions, at most one per cell of a fine grid."""
    cell_count = int(size / min(7.0, size / np.sqrt(3.0 * n)))
    cell_size = size / cell_count
    grid_line = (np.arange(cell_count) + 0.5) * cell_size - size / 2
    places = np.stack(np.meshgrid(grid_line, grid_line), axis=-1).reshape(-1, 2)
    # Jitter keeps neighbours half a cell apart.
    places += rng.uniform(-0.25, 0.25, places.shape) * cell_size
    is_clear = cKDTree(trail(np.linspace(0, 1.1, 2000))).query(places)[0] > CLEARING
    clump_noise = _noise(places, size / 14, size, rng) + 0.7 * _noise(places, size / 40, size, rng)
    free_cells = np.flatnonzero(is_clear)
    if len(free_cells) < n:
        raise ValueError(
            f'n must be at most {len(free_cells)} on {size:.0f} m, got {n}: use a larger size'
        )
    tree_weights = np.exp(1.6 * clump_noise[free_cells])
    return places[rng.choice(free_cells, n, replace=False, p=tree_weights / tree_weights.sum())]


def _kinds_at(places, z, size, rng):
    """Return species: spruces on the slopes, poplars low in the valley, broadleaves between."""
    relative_height = z / (0.14 * size) + 0.35 * _noise(places, size / 10, size, rng)
    relative_height += rng.normal(0, 0.15, len(z))
    names = list(KINDS)
    index = np.full(len(z), names.index('broadleaf'))
    index[relative_height > np.quantile(relative_height, 0.55)] = names.index('conifer')
    index[relative_height < np.quantile(relative_height, 0.15)] = names.index('poplar')
    return index


def _matrices(places, z, rng):
    yaw = rng.uniform(0, np.pi, len(z))
    zeros = np.zeros_like(yaw)
    quaternions = np.column_stack([np.cos(yaw), zeros, zeros, np.sin(yaw)])
    scales = rng.uniform(*SCALES, len(z))
    # Sunk a little into the ground, for slopes.
    return trs(np.column_stack([places, z - 0.25 * scales]), quaternions, scales)
