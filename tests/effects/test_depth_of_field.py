"""Depth of field: by closed forms, and against pictures from all over the lens."""

import numpy as np
import pytest
import pyvista as pv

import pvibr
from benchmarks.effects import depth_of_field as bench
from pvibr.maths.image_error import psnr
from pvibr.things.frame import Frame
from tests.pictures import place, shot
from tests.refusals import refused

SIZE = (200, 160)


@pytest.fixture
def half_plane():
    """Return a function that shows an unlit white half plane at a distance, edge in the middle."""

    def make(distance, *, parallel=False, color='white', back=None, **kwargs):
        pl = pv.Plotter(window_size=SIZE, **kwargs)
        pl.set_background('black')
        side = 4.0 * distance
        plate = pv.Plane(center=(side / 2, 0, -distance), i_size=side, j_size=side)
        pl.add_mesh(plate, color=color, lighting=False)
        if back is not None:
            far = pv.Plane(center=(0, 0, -back), i_size=9 * back, j_size=9 * back)
            pl.add_mesh(far, color='red', lighting=False)
        half = 4 if parallel else None
        place(pl, (0, 0, 0), (0, 0, -10), (0, 1, 0), 40, parallel=half, clip=(0.5, 100))
        pl.show(auto_close=False)
        return pl

    return make


def disk_edge(radius, x):
    """Share of a disk beyond a straight edge at x pixels from its middle."""
    t = np.clip(x / radius, -1, 1)
    return 0.5 + (t * np.sqrt(1 - t**2) + np.arcsin(t)) / np.pi


@pytest.mark.parametrize('distance', [5.0, 20.0, 10.0])
@pytest.mark.parametrize('parallel', [False, True])
def test_edges_are_as_wide_as_the_circle(half_plane, distance, parallel):
    pl = half_plane(distance, parallel=parallel)
    lens = pl.ibr.add(pvibr.DepthOfField(radius=0.3, limit=0.2, samples=256))
    row = shot(pl)[80, :, 0] / 255
    scale = Frame.of(pl.renderer).pixel_scale
    circle = 0.3 * abs(distance - 10) / 10 * scale / (1 if parallel else distance)
    middle = np.arange(SIZE[0]) + 0.5 - SIZE[0] / 2
    expected = disk_edge(max(circle, 1e-6), middle)
    assert np.abs(row - expected).max() < 0.12
    assert np.abs(row - expected).mean() < 0.006
    near, far = lens.circles(Frame.of(pl.renderer))
    assert near < 0 < far


def test_what_is_in_focus_has_no_halo(half_plane):
    """White in focus before red out of focus: no white beyond the edge, no red within."""
    pl = half_plane(10.0, back=60.0)
    off = shot(pl)
    pl.ibr.add(pvibr.DepthOfField(radius=0.5, limit=0.2))
    assert np.abs(shot(pl) - off).max() <= 1


def test_against_pictures_from_all_over_the_lens():
    with bench.spheres_in_a_row((320, 240)) as stage:
        pl = stage.plotter
        focus = np.linalg.norm(np.subtract(pl.camera.focal_point, pl.camera.position))
        off = stage.picture()
        reference = bench.accumulated(stage, 0.15, focus, 256)
        pl.ibr.add(pvibr.DepthOfField(radius=0.15, limit=0.1))
        found = psnr(stage.picture(), reference)
    assert found >= 39  # of small windows: 42 at 640 x 480
    assert found > psnr(off, reference) + 6


def test_silhouettes_near_the_focus_have_no_comb():
    """An edge aslant, two pixels out of focus: it is as even as pixels let it be."""
    for seed in (0, 3):
        slope = np.random.default_rng(seed).uniform(0.1, 0.4)
        pl = pv.Plotter(window_size=SIZE)
        plate = pv.Plane(center=(4, 0, 0), i_size=8, j_size=16)
        pl.add_mesh(plate.rotate_z(np.degrees(np.arctan(slope))), color='w', lighting=False)
        pl.set_background('black')
        place(pl, (0, 0, 8), up=(0, 1, 0), clip=(1, 50))
        pl.show(auto_close=False)
        scale = Frame.of(pl.renderer).pixel_scale
        pl.ibr.add(pvibr.DepthOfField(distance=10, radius=1.5 * 8 * 10 / (2 * scale)))
        share = shot(pl)[20:140, 40:160, 0].sum(axis=1) / 255  # where the edge is in a row
        line = np.polyval(np.polyfit(np.arange(120), share, 1), np.arange(120))
        assert np.abs(share - line).max() < 0.45  # pixels alone: 0.5


def test_an_opening_of_zero_is_a_pinhole(half_plane):
    pl = half_plane(5.0)
    off = shot(pl)
    lens = pl.ibr.add(pvibr.DepthOfField(radius=0))
    assert np.array_equal(shot(pl), off)
    assert 'radius is 0' in str(pl.ibr.report())
    lens.radius = 1e-5
    assert np.array_equal(shot(pl), off)
    assert 'half a pixel' in str(pl.ibr.report())


def test_colours_of_flat_fields_stay(half_plane):
    pl = half_plane(5.0, color='#37a1c9', back=50.0)
    off = shot(pl)
    pl.ibr.add(pvibr.DepthOfField(radius=0.3, limit=0.2))
    away = np.r_[0:60, 140:200]
    assert np.abs(shot(pl) - off)[:, away].max() <= 1


def test_a_transparent_background_stays_so(half_plane):
    pl = half_plane(20.0)
    pl.ibr.add(pvibr.DepthOfField(radius=0.3, limit=0.2, samples=256))
    rgba = shot(pl, transparent_background=True)
    assert rgba.shape[2] == 4
    assert rgba[:, :80, 3].max() == 0
    assert rgba[:, 120:, 3].min() == 255
    share = rgba[80, 80:120, 3] / 255
    circle = 0.3 * 0.05 * Frame.of(pl.renderer).pixel_scale
    assert np.abs(share - disk_edge(circle, np.arange(-19.5, 20))).max() < 0.12


def test_focus_on_points_actors_and_distances(half_plane):
    pl = half_plane(10.0)
    ball = pl.add_mesh(pv.Sphere(center=(1, 1, -20)))
    frame = Frame.of(pl.renderer)
    lens = pvibr.DepthOfField()
    assert lens.focus(frame) == pytest.approx(10)
    lens.target = (5, 0, -30)
    assert lens.focus(frame) == pytest.approx(30)
    lens.target = ball
    assert lens.focus(frame) == pytest.approx(20, rel=1e-4)
    ball.position = (0, 0, -5)
    assert lens.focus(frame) == pytest.approx(25, rel=1e-4)
    lens.target = pl.ibr.add_instances(pv.Sphere(radius=0.1), [[0, 0, -11], [0, 0, -13]])
    assert lens.focus(frame) == pytest.approx(12, rel=1e-4)
    lens.distance = 3
    assert lens.focus(frame) == 3
    assert lens.aperture(3.0) == pytest.approx(0.3 / 5.6)
    lens.focal_length = 0.05
    assert lens.aperture(3.0) == pytest.approx(0.05 / 5.6)


def test_state_keeps_points():
    lens = pvibr.DepthOfField((1, 2, 3), f_number=4)
    other = pvibr.DepthOfField()
    assert other.restore(lens.state()) == []
    assert other.target == (1.0, 2.0, 3.0)
    assert other.f_number == 4
    refused('f_number', other.restore, {'target': [0, 0, 0], 'f_number': -1})
    assert other.target == (1.0, 2.0, 3.0)


@pytest.mark.parametrize('target', [(1, 2), 'ball', (1, 2, np.nan), 3.0])
def test_bad_targets(target):
    refused('target must be', pvibr.DepthOfField, target)


@pytest.mark.parametrize(
    'settings', [{'f_number': 0}, {'radius': -1}, {'samples': 4}, {'limit': 0}, {'debug': 'x'}]
)
def test_bad_settings(settings):
    refused(next(iter(settings)), pvibr.DepthOfField, **settings)


def test_scale_free():
    """The same picture of a scene a thousand million times as small."""
    found = []
    for size in (1.0, 1e-6):
        pl = pv.Plotter(window_size=SIZE)
        pl.add_mesh(pv.Sphere(radius=size, center=(0, 0, -2 * size)), color='tan')
        pl.add_mesh(
            pv.Cube(center=(size, size, 2 * size), x_length=size, y_length=size, z_length=size),
            color='red',
        )
        place(pl, (0, 0, 8 * size), up=(0, 1, 0), clip=(2 * size, 20 * size))
        pl.ibr.add(pvibr.DepthOfField(f_number=1.0))
        pl.show(auto_close=False)
        found.append(shot(pl))
    assert np.abs(found[0] - found[1]).mean() < 0.5


@pytest.mark.parametrize('stage', ['coc', 'near', 'far'])
def test_stages_are_shown(half_plane, stage):
    pl = half_plane(5.0, back=50.0)
    lens = pl.ibr.add(pvibr.DepthOfField(radius=0.3))
    on = shot(pl)
    lens.debug = stage
    assert np.abs(shot(pl) - on).max() > 20


def test_light_above_white_stays_light(half_plane):
    """A lamp of four times white, out of focus: its disk is brighter where that is seen."""
    found = []
    for high in (False, True):
        pl = half_plane(20.0, color='black')
        pl.remove_all_lights()
        pl.add_light(pv.Light(position=(0, 0, 0), light_type='headlight', intensity=4.0))
        pl.add_mesh(pv.Disc(center=(-1, 0, -19), inner=0, outer=0.15, c_res=24), color='white')
        pl.ibr.add(pvibr.DepthOfField(radius=0.4, distance=10, limit=0.2, needs_hdr=high))
        found.append(shot(pl)[..., 0].max())
        pl.close()
    assert found[1] > 2 * found[0]
