"""Textured surfaces with seams for large meshes."""

from functools import cache

import numpy as np
import pyvista as pv

from tests.large.surfaces import noise, terrain


@cache
def checks(count=256, seed=0):
    """Return a picture of squares of many colours."""
    rng = np.random.default_rng(seed)
    picture = rng.integers(40, 255, (count // 8, count // 8, 3))
    return np.kron(picture, np.ones((8, 8, 1))).astype(np.uint8)


@cache
def globe(count=160):
    """Return a rough ball with longitudes and latitudes: a seam from pole to pole."""
    longitude, latitude = np.meshgrid(
        np.linspace(0, 1, 2 * count + 1), np.linspace(0, 1, count + 1)
    )
    a, b = 2 * np.pi * longitude, np.pi * latitude
    directions = np.stack([np.cos(a) * np.sin(b), np.sin(a) * np.sin(b), -np.cos(b)], -1)
    directions[:, -1], directions[0], directions[-1] = directions[:, 0], (0, 0, -1), (0, 0, 1)
    radii = 1 + 0.05 * np.sin(7 * directions[..., 0] + 5 * directions[..., 2])
    radii += 0.02 * np.sin(23 * directions[..., 1] * directions[..., 2])
    return _grid(directions * radii[..., None], np.stack([longitude, latitude], -1))


@cache
def charts(count=180, side=36):
    """Return the terrain cut into squares, turned and packed in another order."""
    points = np.asarray(terrain(count).points).reshape(count, count, 3)
    rng, tiles = np.random.default_rng(1), int(np.ceil((count - 1) / side))
    places = rng.permutation(tiles * tiles)
    meshes = []
    for k in range(tiles * tiles):
        row, column = divmod(k, tiles)
        own = points[row * side : (row + 1) * side + 1, column * side : (column + 1) * side + 1]
        u, v = (
            own[..., axis] * (count - 1) / side - offset
            for axis, offset in ((0, row), (1, column))
        )
        for _ in range(rng.integers(4)):
            u, v = v, 1 - u
        place_row, place_column = divmod(int(places[k]), tiles)
        place = np.stack([place_row + 0.02 + 0.96 * u, place_column + 0.02 + 0.96 * v], -1)
        meshes.append(_grid(own, place / tiles))
    starts = np.cumsum([0, *(mesh.n_points for mesh in meshes)])
    faces = [m.regular_faces + start for m, start in zip(meshes, starts, strict=False)]
    points = np.concatenate([mesh.points for mesh in meshes])
    mesh = pv.PolyData.from_regular_faces(points, np.concatenate(faces))
    coordinates = [m.active_texture_coordinates for m in meshes]
    mesh.active_texture_coordinates = np.concatenate(coordinates)
    return mesh


def _grid(points, coordinates):
    rows, columns = points.shape[:2]
    a = (np.arange(rows - 1)[:, None] * columns + np.arange(columns - 1)).ravel()
    faces = np.stack([a, a + 1, a + columns, a + 1, a + columns + 1, a + columns], 1)
    mesh = pv.PolyData.from_regular_faces(points.reshape(-1, 3), faces.reshape(-1, 3))
    mesh.active_texture_coordinates = coordinates.reshape(-1, 2)
    return mesh


@cache
def photograph(count=512):
    """Return a smooth picture with fine detail."""
    layers = [noise(count, 20 + k, 1.3) for k in range(3)]
    return np.clip(128 + 50 * np.stack(layers, -1), 0, 255).astype(np.uint8)
