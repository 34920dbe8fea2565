"""Surfaces for large meshes, and what they are compared with."""

from functools import cache

import numpy as np
import pyvista as pv

from pvibr.large.build import build_hierarchy
from pvibr.large.cut import ModelView, cell_pixels, patches_within
from pvibr.large.sources import source_of


def noise(count, seed, beta):
    """Return fractal heights, (count, count), by spectral synthesis."""
    rng = np.random.default_rng(seed)
    spectrum = np.fft.rfft2(rng.standard_normal((count, count)))
    frequency = np.hypot(np.fft.fftfreq(count)[:, None], np.fft.rfftfreq(count)[None])
    frequency[0, 0] = 1
    spectrum *= frequency**-beta
    spectrum[0, 0] = 0
    heights = np.fft.irfft2(spectrum, s=(count, count))
    return heights / heights.std()


@cache
def terrain(count=180, seed=4):
    """Return a fractal terrain on the unit square, with heights and a fine pattern."""
    heights = noise(count, seed, 1.9)
    x = np.linspace(0, 1, count)
    corner = np.arange(count - 1)[:, None] * count + np.arange(count - 1)
    a = corner.ravel()
    faces = np.stack([a, a + count, a + 1, a + 1, a + count, a + count + 1], 1).reshape(-1, 3)
    points = np.stack([np.repeat(x, count), np.tile(x, count), 0.035 * heights.ravel()], 1)
    mesh = pv.PolyData.from_regular_faces(points, faces)
    mesh['height'] = heights.ravel()
    mesh['pattern'] = noise(count, seed + 1, 1.2).ravel()
    mesh.set_active_scalars('height')
    return mesh


@cache
def folded(count=64):
    """Return an isosurface of a bent gyroid, sheets behind sheets, cut by a box."""
    axis = np.linspace(-1, 1, count)
    x, y, z = np.meshgrid(axis, axis, axis, indexing='ij')
    bend = 0.25 * np.sin(3 * y + 2 * z) + 0.1 * np.sin(11 * z + 5 * x)
    a, b, c = 9 * (x + bend), 9 * (y + 0.2 * np.sin(4 * x + z)), 9 * (z + bend / 2)
    field = np.sin(a) * np.cos(b) + np.sin(b) * np.cos(c) + np.sin(c) * np.cos(a)
    step = 2 / (count - 1)
    grid = pv.ImageData(dimensions=(count,) * 3, spacing=(step,) * 3, origin=(-1, -1, -1))
    grid['field'] = field.ravel(order='F')
    mesh = grid.contour([0.0], scalars='field', method='flying_edges', compute_scalars=False)
    mesh.clear_data()
    return mesh


@cache
def blob():
    """Return a closed rough ball, points of which see each other from inside."""
    ball = pv.Icosphere(nsub=6)
    x, y, z = 6 * np.asarray(ball.points, float).T
    rough = np.sin(x) * np.cos(2 * y) + 0.4 * np.sin(3 * z + x) + 0.15 * np.sin(9 * x + 7 * y)
    points = ball.points * (1 + 0.12 * rough[:, None])
    return pv.PolyData.from_regular_faces(points, ball.regular_faces)


@cache
def hierarchy_of(make):
    """Return the hierarchy of one of the surfaces."""
    return build_hierarchy(source_of(make()).mesh)


def view_from(hierarchy, eye, pixels_per_unit=1344.0):
    """Return a view that culls nothing."""
    eye = np.asarray(eye, float) - hierarchy.origin
    return ModelView(eye, np.eye(4), pixels_per_unit, 1e-4, False)


def views_of(hierarchy, count, seed=0):
    """Return views from near and far."""
    rng = np.random.default_rng(seed)
    low, high = hierarchy.bounds
    size = np.linalg.norm(high - low)
    for k in range(count):
        direction = rng.normal(size=3)
        distance = size * (0.1 + 4 * (k / count) ** 2)
        eye = (low + high) / 2 + distance * direction / np.linalg.norm(direction)
        yield view_from(hierarchy, eye, rng.choice([300.0, 1344.0]))


def whole_cut(hierarchy, view, max_error=1.0):
    """Return the patches of a cut, those out of view included."""
    return patches_within(hierarchy, cell_pixels(hierarchy, view), max_error)
