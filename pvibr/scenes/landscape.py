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
#: Direction of the sun; colours and intensities of sun and sky.
SUN = (-0.6, 0.3, 1.3)
SUNLIGHT, SKYLIGHT = ((1.0, 0.95, 0.85), 0.9), ((0.85, 0.93, 1.0), 0.6)
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

    def lights(self):
        """Return new lights for one plotter: sun and sky."""
        (sun, bright), (sky, dim) = SUNLIGHT, SKYLIGHT
        return [
            pv.Light(position=SUN, color=sun, intensity=bright, light_type='scene light'),
            pv.Light(color=sky, intensity=dim, light_type='headlight'),
        ]

    def height_at(self, places):
        """Return terrain heights."""
        return _height(self.heights, self.size, np.asarray(places, dtype=np.float64))

    def path(self, frames, start=0.0, stop=1.0):
        """Return camera positions along the trail."""
        if frames < 1 or not 0 <= start <= stop <= 1:
            given = f'frames is {frames}, start {start}, stop {stop}'
            raise ValueError(f'{given}; they must be at least 1 and 0 <= start <= stop <= 1.')
        share = np.linspace(start, stop, frames)
        eye, focus = self.trail(share), self.trail(share + 0.07)
        # From 2.5 m, a walker, to 11.5 m, a low drone, and back.
        lift = 7.0 - 4.5 * np.cos(share * 4 * np.pi)
        eye = np.column_stack([eye, self.height_at(eye) + lift])
        focus = np.column_stack([focus, self.height_at(focus) + 10.0])
        up = (0.0, 0.0, 1.0)
        return [
            (tuple(e), tuple(f), up) for e, f in zip(eye.tolist(), focus.tolist(), strict=True)
        ]


def landscape(n=10_000, seed=0, size=None, triangles=50_000):
    """Return a landscape with n trees."""
    if n < 1:
        raise ValueError(f'n is {n}; it must be at least 1 tree.')
    # Below 300 m the trail's clearing would cover the terrain.
    size = max(SPACING * np.sqrt(n), 300.0) if size is None else float(size)
    rng = np.random.default_rng(seed)
    heights = _ground(size, rng)
    trail = _trail(size, rng)
    places = _places(n, size, heights, trail, rng)
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
    """Return smooth noise of mean 0 and height about 1 at positions (..., 2)."""
    knots = int(np.ceil(size / wavelength)) + 3
    values = rng.standard_normal((knots, knots))
    where = np.moveaxis(places / wavelength + knots / 2, -1, 0)
    return map_coordinates(values, where, order=3, mode='grid-wrap')


def _grid(size):
    line = np.linspace(-size / 2, size / 2, CELLS + 1)
    return np.stack(np.meshgrid(line, line), axis=-1)


def _ground(size, rng):
    places = _grid(size)
    # A valley: hills hide the edge of the terrain and show the forest on their slopes.
    rim = np.linalg.norm(places, axis=-1) / (size / 2)
    hills = sum(
        size * share * _noise(places, size * wave, size, rng)
        for share, wave in ((0.022, 0.45), (0.009, 0.2), (0.0025, 0.08))
    )
    return 0.14 * size * np.minimum(rim, 1.3) ** 1.7 + hills


def _height(heights, size, places):
    """Return heights on the terrain's triangles."""
    x, y = np.clip((places.reshape(-1, 2).T / size + 0.5) * CELLS, 0, CELLS)
    column, row = (np.minimum(v.astype(int), CELLS - 1) for v in (x, y))
    u, v = x - column, y - row
    here, across = heights[row, column], heights[row + 1, column + 1]
    corner = np.where(u > v, heights[row, column + 1], heights[row + 1, column])
    found = here + np.maximum(u, v) * (corner - here) + np.minimum(u, v) * (across - corner)
    return found.reshape(places.shape[:-1])


def _terrain(heights, size, rng):
    places = _grid(size)
    points = np.concatenate([places, heights[..., None]], axis=-1).reshape(-1, 3)
    corner = (np.arange(CELLS)[:, None] * (CELLS + 1) + np.arange(CELLS)).ravel()
    right, over = corner + 1, corner + CELLS + 1
    faces = np.stack([corner, right, over + 1, corner, over + 1, over], axis=1).reshape(-1, 3)
    terrain = pv.PolyData.from_regular_faces(points, faces)
    slope = np.hypot(*np.gradient(heights, size / CELLS))
    dry = np.clip(heights / (0.2 * size) + 0.15 * _noise(places, size / 9, size, rng), 0, 1)
    rock = np.clip(4 * slope - 1.2, 0, 1)
    color = GRASS + dry[..., None] * (DRY - GRASS)
    color = color + rock[..., None] * (ROCK - color)
    color *= 1 + 0.06 * rng.standard_normal((*slope.shape, 1))
    terrain[COLORS] = np.clip(color, 0, 255).astype(np.uint8).reshape(-1, 3)
    return terrain.compute_normals(cell_normals=False, split_vertices=False)


def _trail(size, rng):
    share = np.linspace(0, 1.1, 8)
    x = (share - 0.5) * 0.62 * size
    y = 0.11 * size * np.sin(share * 7 + rng.uniform(0, 6)) + rng.normal(0, 0.015 * size, 8)
    return CubicSpline(share, np.column_stack([x, y]))


def _places(n, size, heights, trail, rng):
    """Return tree positions: clumps, at most one per cell of a fine grid."""
    cells = int(size / min(7.0, size / np.sqrt(3.0 * n)))
    cell = size / cells
    line = (np.arange(cells) + 0.5) * cell - size / 2
    places = np.stack(np.meshgrid(line, line), axis=-1).reshape(-1, 2)
    # Jittered so that neighbours stay half a cell apart.
    places += rng.uniform(-0.25, 0.25, places.shape) * cell
    away = cKDTree(trail(np.linspace(0, 1.1, 2000))).query(places)[0] > CLEARING
    clump = _noise(places, size / 14, size, rng) + 0.7 * _noise(places, size / 40, size, rng)
    free = np.flatnonzero(away)
    if len(free) < n:
        raise ValueError(
            f'n is {n}, but only {len(free)} trees fit on {size:.0f} m; give a larger size.'
        )
    weight = np.exp(1.6 * clump[free])
    return places[rng.choice(free, n, replace=False, p=weight / weight.sum())]


def _kinds_at(places, z, size, rng):
    """Return species: spruces on the slopes, poplars low in the valley, broadleaves between."""
    level = z / (0.14 * size) + 0.35 * _noise(places, size / 10, size, rng)
    level += rng.normal(0, 0.15, len(z))
    names = list(KINDS)
    index = np.full(len(z), names.index('broadleaf'))
    index[level > np.quantile(level, 0.55)] = names.index('conifer')
    index[level < np.quantile(level, 0.15)] = names.index('poplar')
    return index


def _matrices(places, z, rng):
    yaw = rng.uniform(0, np.pi, len(z))
    none = np.zeros_like(yaw)
    turns = np.column_stack([np.cos(yaw), none, none, np.sin(yaw)])
    scales = rng.uniform(*SCALES, len(z))
    # Slightly sunk into the ground, for slopes.
    return trs(np.column_stack([places, z - 0.25 * scales]), turns, scales)
