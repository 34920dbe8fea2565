"""What is small on large ground has its shadow, by every kind of light, against rays."""

import numpy as np
import pytest
import pyvista as pv

import pvibr
from benchmarks.common.light_scenes import LightScene, bare, light_at
from benchmarks.common.rays import Rays
from benchmarks.shadows.errors import drawn, sight

pytestmark = pytest.mark.sampled


@pytest.mark.parametrize('kind', ['directional', 'spot', 'point'])
@pytest.mark.parametrize('size', [100.0, 1e4])
def test_a_box_of_a_metre_on_wide_ground(kind, size):
    turn = np.random.default_rng(int(size)).uniform(2.2, 4.0)  # to the side of the box
    ground = bare(pv.Plane(i_size=size, j_size=size, i_resolution=40, j_resolution=40))
    box = bare(pv.Cube(center=(0, 0, 0.5)).rotate_z(np.degrees(turn)))
    way = np.array([0.6 * np.cos(turn), 0.6 * np.sin(turn), 0.7])
    lights = {
        'directional': light_at(way * size),
        'spot': light_at(way * size * 0.5, cone=30.0),
        'point': light_at(way * size * 0.05, cone=90.0),
    }
    scene = LightScene('box', [ground, box], lights, ((4, -9, 5), (0, 0, 0.3), (0, 0, 1)))
    with sight(scene, Rays(scene.meshes), kind, (200, 150), clipping=(1.0, 3 * size)) as found:
        _as_rays_say(found, {'method': 'pcf'})


@pytest.mark.parametrize(
    ('kind', 'method'), [('directional', 'pcf'), ('directional', 'msm'), ('spot', 'pcf')]
)
def test_a_lamp_and_a_sun_over_land_of_100_000_sizes(kind, method):
    """A lamp hangs nearer to what casts than a thousandth of the way to the end of the land."""
    land, near = (bare(pv.Plane(i_size=n, j_size=n)) for n in (1e5, 40.0))
    box = bare(pv.Box((-0.5, 0.5, -0.25, 0.25, 0, 1.2)).rotate_z(50))
    lights = {'directional': light_at((3, 2, 5)), 'spot': light_at((3, 2, 5), cone=58.0)}
    scene = LightScene('box', [land, box], lights, ((-2, -6, 3), (0, 0, 0), (0, 0, 1)))
    with sight(scene, Rays([near, box]), kind, (160, 120), clipping=(0.5, 60)) as found:
        _as_rays_say(found, {'method': method}, soft=method == 'msm')


def test_the_housing_behind_a_lamp_takes_no_precision_of_its_depth():
    pl = pv.Plotter(off_screen=True, window_size=(96, 64), lighting='none')
    pl.add_light(light_at((0, 0, 5), cone=50.0))
    for box in ((-20, 20, -20, 20, -0.1, 0), (-0.5, 0.5, -0.5, 0.5, 5.01, 5.2)):
        pl.add_mesh(pv.Box(box))
    shadows = pl.ibr.add(pvibr.Shadows())
    pl.show(auto_close=False)
    (view,) = shadows.views_of(pl.renderer.lights[0])
    assert 1 < view.near < 5 <= view.far  # the floor; a thousandth of the way before


def _as_rays_say(found, setting, soft=False):
    lit = drawn(found, setting)
    band = found.wide_band if soft else found.band
    known = np.isfinite(lit) & np.isfinite(found.lit) & ~found.away & ~band
    dark = known & (found.lit == 0)
    assert dark.sum() > 20
    assert (np.abs(lit - found.lit)[known] > 0.5).mean() <= 5e-4
    assert (lit[dark] < 0.5).mean() > 0.99
