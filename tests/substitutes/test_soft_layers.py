"""Soft layers hide what is behind them, wherever they pierce one another and other things."""

import numpy as np
import pytest
import pyvista as pv
from scipy.ndimage import distance_transform_edt

from tests.pictures import place, plotter, rgba

SIZE = (150, 100)
MESHES = (
    pv.Sphere(theta_resolution=30, phi_resolution=31),
    pv.ParametricTorus(u_res=40, v_res=20, w_res=8),
    pv.Cube(),
    pv.Cylinder(height=3, radius=0.3, resolution=30),
    pv.Plane(i_size=3, j_size=3),
)


def scene(seed, samples, setup=None):
    """Return a plotter with random groups of actors that pierce one another, and the groups."""
    rng = np.random.default_rng(seed)
    pl = plotter(SIZE)
    pl.render_window.SetMultiSamples(samples)
    groups = []
    for _ in range(rng.integers(2, 5)):
        groups.append([])
        for _ in range(rng.integers(1, 4)):
            actor = pl.add_mesh(MESHES[rng.integers(len(MESHES))], color=rng.uniform(0, 1, 3))
            actor.position = rng.uniform(-2, 2, 3)
            actor.orientation = rng.uniform(0, 360, 3)
            actor.scale = 3 * [float(np.exp(rng.uniform(-1, 0.7)))]
            groups[-1].append(actor)
    if setup is not None:
        setup(pl)
    away = rng.normal(size=3)
    place(pl, away / np.linalg.norm(away) * rng.uniform(6, 12), up=(0, 0.1, 1))
    return pl, groups


def deep_inside(seed, samples, blur):
    """Return the pixels of which one group covers all that a blur mixes into them."""
    pl, groups = scene(seed, samples)
    reach, found = 3 * blur + 1.5, np.zeros(SIZE[::-1], bool)
    for group in groups:
        for actor in (a for other in groups for a in other):
            actor.visibility = actor in group
        covered = np.pad(rgba(pl)[..., 3] > 0.99, 1)  # beyond the border nothing is known
        found |= distance_transform_edt(covered)[1:-1, 1:-1] > reach
    pl.close()
    return found


def beside(pl):
    """Add a ground plane, spheres by rays and glass."""
    pl.add_mesh(pv.Plane(center=(0, 0, -1), i_size=4, j_size=4))
    pl.ibr.add_spheres(np.random.default_rng(2).uniform(-2, 2, (10, 3)), radius=0.4)
    pl.add_mesh(MESHES[0], opacity=0.4).scale = (5.0, 5.0, 5.0)


@pytest.mark.sampled
@pytest.mark.parametrize('setup', [None, beside], ids=['alone', 'beside others'])
@pytest.mark.parametrize(('samples', 'blur'), [(0, 0.0), (4, 0.0), (0, 3.0), (4, 1.0)])
def test_no_background_shows_through_layers(samples, blur, setup):
    count = 0
    for seed in (3, 5):
        inside = deep_inside(seed, samples, blur)
        pl, groups = scene(seed, samples, setup)
        pl.ibr.add_image_layers(groups, only_if_faster=False, blur=blur)
        through = 1 - rgba(pl)[..., 3][inside]
        pl.close()
        assert (through > 8 / 255).sum() <= 10
        assert not (through > 60 / 255).any()
        count += inside.sum()
    assert count > 2000


def test_effects_that_read_depth_find_what_half_covers_a_pixel():
    pl = plotter(SIZE)
    ball = pl.add_mesh(MESHES[0])
    place(pl, (0, -3, 0))
    layers = pl.ibr.add_image_layers([ball], only_if_faster=False, blur=4.0)
    covered = rgba(pl)[..., 3]
    shown = [np.isfinite(pl.ibr.buffer('depth'))]
    pl.ibr.remove(layers)
    pl.render()
    shown.append(np.isfinite(pl.ibr.buffer('depth')))
    assert ((covered > 0.05) & (covered < 0.95)).sum() > 1000
    assert np.mean(shown[0] != shown[1]) < 0.01
