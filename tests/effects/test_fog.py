"""Fog: transmission along rays, integrated in float64."""

import numpy as np
import pytest
import pyvista as pv

import pvibr
from tests.pictures import place, plotter, shot
from tests.refusals import refused

SIZE = (120, 90)


def ground(parallel, offset, seed):
    """Return a plotter of a white floor and a wall far away, at large coordinates too."""
    rng = np.random.default_rng(seed)
    pl = plotter(SIZE)
    pl.set_background('black')
    for center, direction in (((0, 0, -1), (0, 0, 1)), ((0, 9, 0), (0, -1, 0))):
        plane = pv.Plane(center=np.add(center, offset), direction=direction, i_size=30, j_size=30)
        pl.add_mesh(plane, color='white', lighting=False)
    eye = np.array([rng.uniform(-1, 1), -6, rng.uniform(0.5, 2)]) + offset
    place(pl, eye, np.add((0, 4, -0.5), offset), parallel=1 if parallel else None)
    return pl


def rays(pl):
    """Return where the rays of pixels begin and where they end, (h, w, 3) each."""
    camera = pl.camera
    eye, focus = np.array(camera.position), np.array(camera.focal_point)
    ahead = (focus - eye) / np.linalg.norm(focus - eye)
    right = np.cross(ahead, camera.up)
    right /= np.linalg.norm(right)
    up = np.cross(right, ahead)
    half = (
        camera.parallel_scale
        if camera.parallel_projection
        else np.tan(np.radians(camera.view_angle) / 2)
    )
    x, y = (np.arange(n) + 0.5 - n / 2 for n in SIZE)
    across = (x * half / (SIZE[1] / 2))[None, :, None] * right
    across = across - (y * half / (SIZE[1] / 2))[:, None, None] * up
    if camera.parallel_projection:
        return eye + across, np.broadcast_to(ahead, across.shape)
    return np.broadcast_to(eye, across.shape), ahead + across


@pytest.mark.parametrize('parallel', [False, True])
@pytest.mark.parametrize('height', [None, 0.7])
@pytest.mark.parametrize(('offset', 'seed'), [((0, 0, 0), 1), ((5e5, -4e6, 300), 2)])
def test_transmission_is_that_of_the_air_between(parallel, height, offset, seed):
    pl = ground(parallel, offset, seed)
    base = offset[2] - 0.5
    pl.ibr.add(pvibr.Fog(8.0, begin=2.0, height=height, base=base, color=(0, 0, 1)))
    pl.show(auto_close=False)
    found = shot(pl)[..., 0] / 255
    starts, ways = rays(pl)
    far = np.stack(
        [
            (offset[2] - 1 - starts[..., 2]) / ways[..., 2],
            (offset[1] + 9 - starts[..., 1]) / ways[..., 1],
        ]
    )
    reach = np.where(far > 0, far, np.inf).min(axis=0)
    length = reach * np.linalg.norm(ways, axis=-1)
    begin = np.minimum(2.0 / length, 1.0)
    parts = begin[..., None] + (1 - begin[..., None]) * (np.arange(400) + 0.5) / 400
    heights = (starts + 0 * ways)[..., 2:] + ways[..., 2:] * reach[..., None] * parts - base
    dense = np.exp(-heights / height) if height else np.ones_like(heights)
    through = np.exp(-dense.mean(axis=-1) * np.maximum(length - 2.0, 0) / 8.0)
    assert np.ptp(through) > 0.1
    assert np.abs(found - through).max() < 0.02


@pytest.mark.parametrize('above', [0, 3, 6])
def test_thin_fog_seen_from_far_above(above):
    pl = plotter(SIZE)
    pl.add_mesh(pv.Plane(i_size=9, j_size=9), color='white', lighting=False)
    place(pl, (0, -1e-3, 10))
    height = 0.05  # the eye is 200 times as high
    pl.ibr.add(pvibr.Fog(0.05, height=height, base=-above * height, color=(0, 0, 0)))
    pl.show(auto_close=False)
    found = shot(pl)[SIZE[1] // 2, SIZE[0] // 2, 0] / 255
    assert found == pytest.approx(np.exp(-np.exp(-above)), abs=0.01)


def test_colour_is_that_of_the_horizon_or_the_background():
    pl = ground(False, (0, 0, 0), 3)
    pl.set_background((0.25, 0.5, 0.75))
    fog = pl.ibr.add(pvibr.Fog(1e-3))
    pl.show(auto_close=False)
    np.testing.assert_allclose(shot(pl)[80, 60], [64, 128, 191], atol=1)
    pl.ibr.add(pvibr.Sky(horizon=(0.5, 0.25, 1.0)))
    np.testing.assert_allclose(shot(pl)[80, 60], [128, 64, 255], atol=1)
    fog.color = (1, 0, 0)
    np.testing.assert_array_equal(shot(pl)[80, 60], [255, 0, 0])


def test_by_default_it_is_the_same_at_any_scale():
    found = []
    for scale in (1e-6, 1.0):
        pl = plotter(SIZE)
        pl.set_background('white')
        pl.add_mesh(pv.Sphere(radius=scale), color='black', lighting=False)
        place(pl, (0, -6 * scale, 0))
        pl.ibr.add(pvibr.Fog())
        pl.show(auto_close=False)
        found.append(shot(pl))
    assert np.abs(found[0] - found[1]).max() <= 2
    middle = found[1][SIZE[1] // 2, SIZE[0] // 2]
    np.testing.assert_allclose(middle, 255 * (1 - np.exp(-5 / (3 * 12**0.5))), atol=2)


@pytest.mark.parametrize('settings', [{'visibility': 0}, {'height': -1}, {'color': (1, 0)}])
def test_bad_settings(settings):
    refused(f'{next(iter(settings))} must be ', pvibr.Fog, **settings)
