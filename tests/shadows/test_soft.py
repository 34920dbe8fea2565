"""Soft shadows on grounds of any size, against rays to the whole light."""

import numpy as np
import pytest
import pyvista as pv
from scipy import ndimage

import pvibr
from benchmarks.common.light_scenes import LightScene, bare, light_at
from benchmarks.common.rays import Rays
from benchmarks.shadows.errors import drawn, sight
from tests.pictures import shown

EXTENTS = {'directional': 4.0, 'spot': 0.25, 'point': 0.12}


def standing(rng):
    """Return a pillar, a box, a ball and a disk in the air."""
    for kind in range(4):
        x, y = rng.uniform(-1.2, 1.2, 2)
        high, r = rng.uniform(0.3, 1.2), rng.uniform(0.15, 0.3)
        up = {'center': (x, y, high / 2), 'direction': (0, 0, 1), 'radius': r, 'height': high}
        yield (
            pv.Cylinder(**up),
            pv.Box((x - r, x + r, y - r, y + r, 0, high)),
            pv.Sphere(radius=r, center=(x, y, r)),
            pv.Disc(center=(x, y, high), inner=0, outer=r, c_res=60),
        )[kind]


def scene(seed, ground):
    rng = np.random.default_rng(seed)
    floor = pv.Plane(i_size=ground, j_size=ground, i_resolution=1, j_resolution=1)
    meshes = [bare(m.extract_surface(algorithm=None)) for m in (floor, *standing(rng))]
    turn = rng.uniform(0, 2 * np.pi)
    way = np.array([0.6 * np.cos(turn), 0.6 * np.sin(turn), 1.0])
    lights = {
        'directional': light_at(way * 10),
        'spot': light_at(way * 6, cone=35.0),
        'point': light_at(way * 3.5, cone=90.0),
    }
    return LightScene('standing', meshes, lights, ((2.0, -6.0, 4.5), (0, 0, 0.2), (0, 0, 1)))


@pytest.mark.sampled
@pytest.mark.parametrize('kind', EXTENTS)
@pytest.mark.parametrize(('ground', 'taps'), [(4.0, 64), (40.0, 16), (1000.0, 16)])
def test_the_umbra_is_dark_and_the_rest_is_right(kind, ground, taps):
    extent, made = EXTENTS[kind], scene(int(ground), ground)
    with sight(made, Rays(made.meshes), kind, (200, 150), extent=extent) as found:
        lit = drawn(found, {'method': 'pcss', 'taps': taps, 'angle': extent, 'radius': extent})
    known = np.isfinite(lit) & np.isfinite(found.lit) & ~found.away
    # One pixel from the edge, also across corners.
    umbra = ndimage.binary_erosion(known & (found.lit == 0), np.ones((3, 3)))
    edge = known & (found.lit > 0.02) & (found.lit < 0.98)
    assert umbra.sum() > 50
    assert (lit[umbra] > 0.1).mean() <= 0.001
    assert np.abs(lit - found.lit)[known].mean() < 0.004
    assert np.abs(lit - found.lit)[edge].mean() < 0.15


def test_a_lamp_without_a_radius_is_as_large_in_every_view():
    pl = pv.Plotter(off_screen=True, window_size=(160, 120), lighting='none')
    lamp = pv.Light(position=(400, 100, 300), light_type='scene light', positional=True)
    lamp.cone_angle = 35
    pl.add_light(lamp)
    pl.add_mesh(pv.Plane(i_size=3000, j_size=3000, i_resolution=1, j_resolution=1), color='white')
    pl.add_mesh(pv.Box((-8, 8, -8, 8, 0, 16)), color='white')
    pl.add_mesh(pv.Box((14, 16, -8, -6, 0, 3)), color='white')
    pl.camera_position = [(10, -45, 30), (5, -4, 0), (0, 0, 1)]
    shadows = pl.ibr.add(pvibr.Shadows(method='pcss'))
    found = shown(pl)
    views = shadows.views_of(lamp)
    assert len(views) > 1
    assert views[-1].far < 0.98 * views[0].far
    shadows.radius = views[0].far / 50
    pl.render()
    same = pl.screenshot().astype(int)
    shadows.radius = views[-1].far / 50
    pl.render()
    other = pl.screenshot().astype(int)
    np.testing.assert_array_equal(found, same)
    assert np.abs(found - other).max() > 8
