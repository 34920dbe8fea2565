"""Buffers of a frame: what is where, in the units that are said."""

from __future__ import annotations

import numpy as np
import pytest
import pyvista as pv

import pvibr
from pvibr.core.errors import PvibrWarning
from pvibr.things import buffers

SIZE = (120, 90)


@pytest.fixture
def pl():
    pl = pv.Plotter(window_size=SIZE)
    pl.disable_anti_aliasing()
    pl.add_mesh(pv.Sphere(theta_resolution=80, phi_resolution=80), smooth_shading=True)
    pl.add_mesh(pv.Plane(center=(0, 0, -1), i_size=20, j_size=20), lighting=False)
    pl.camera_position = [(0, 0, 4), (0, 0, 0), (0, 1, 0)]
    return pl


@pytest.mark.parametrize('parallel', [False, True])
def test_depth_is_linear_in_world_units(pl, parallel):
    pl.camera.parallel_projection = parallel
    depth = pl.ibr.buffer('depth')
    assert depth.shape == SIZE[::-1]
    assert depth.dtype == np.float32
    assert depth[45, 60] == pytest.approx(3.5, abs=0.01)
    assert depth[2, 2] == pytest.approx(5.0, abs=1e-3)


def test_nothing_is_far_and_has_no_number():
    pl = pv.Plotter(window_size=SIZE)
    pl.add_mesh(pv.Sphere())
    assert np.isinf(pl.ibr.buffer('depth')[0, 0])
    assert pl.ibr.buffer('id')[0, 0] == -1
    assert not pl.ibr.buffer('normal')[0, 0].any()


def test_normals_are_those_of_a_ball(pl):
    pl.enable_parallel_projection()
    pl.camera.parallel_scale = 0.6
    normal = pl.ibr.buffer('normal')
    rows, columns = np.mgrid[:90, :120]
    x, y = (columns + 0.5 - 60) / 75, (45 - rows - 0.5) / 75
    inside = x**2 + y**2 < 0.45**2
    true = np.stack([x, y, np.sqrt(np.maximum(0.25 - x**2 - y**2, 0))], 2) / 0.5
    assert np.abs(normal - true)[inside].max() < 0.03
    assert not normal[2, 2].any()  # not lit


def test_ids_are_indices_top_row_first(pl):
    ball = next(iter(pl.renderer.actors.values()))
    top = pl.add_mesh(pv.Cube(center=(0, 1.2, 0), x_length=0.3, y_length=0.3))
    glass = pl.add_mesh(pv.Cube(center=(0, -1.2, 0)), opacity=0.5)
    ids, objects = pl.ibr.buffer('id'), pl.ibr.buffer_objects
    assert ids.dtype == np.int32
    assert objects[ids[45, 60]] is ball
    assert objects[ids[:30, 60].max()] is top
    assert len(objects) == 4
    assert ids.max() < 4
    assert not (ids == objects.index(glass)).any()


def test_objects_are_those_of_the_ids_that_were_returned(pl):
    ball = next(iter(pl.renderer.actors.values()))
    ids = pl.ibr.buffer('id')
    first = pl.add_mesh(pv.Cube(center=(9, 0, 0)), name='A')
    pl.remove_actor(ball)
    for other in ('depth', 'color', 'normal'):
        pl.ibr.buffer(other)
        assert pl.ibr.buffer_objects[ids[45, 60]] is ball
    assert first not in pl.ibr.buffer_objects
    pl.ibr.buffer('id')
    assert first in pl.ibr.buffer_objects
    assert ball not in pl.ibr.buffer_objects


def test_color_is_the_picture(pl):
    color = pl.ibr.buffer('color')
    seen = pl.screenshot() / 255
    np.testing.assert_allclose(color[..., :3], seen, atol=1 / 255)


def test_it_leaves_nothing(pl):
    pl.show(auto_close=False)
    plain = pl.screenshot()
    pl.ibr.buffer('normal')
    assert not pl.ibr.effects
    np.testing.assert_array_equal(pl.screenshot(), plain)


@pytest.mark.parametrize('high', [False, True])
def test_what_is_translucent_looks_as_before(pl, high):
    pl.add_mesh(pv.Cube(center=(0.3, 0.3, 0.6)), color='deepskyblue', opacity=0.4)
    if high:
        pl.ibr.add(pvibr.ToneMapping())
    plain = pl.ibr.buffer('color')
    pl.ibr.add(pvibr.Outline(opacity=0.001))  # surfaces are written, lines are not seen
    assert pl.ibr.buffer('id').max() > 0
    np.testing.assert_allclose(pl.ibr.buffer('color'), plain, atol=1.5 / 255)


def test_bad_name(pl):
    with pytest.raises(ValueError, match=r"name must be one of 'depth'.* got 'height'"):
        pl.ibr.buffer('height')
    assert not pl.ibr.effects


def scene(**options):
    pl = pv.Plotter(window_size=SIZE, **options)
    pl.disable_anti_aliasing()
    for column in range(options.get('shape', (1, 1))[1]):
        pl.subplot(0, column)
        pl.add_mesh(pv.Sphere(theta_resolution=40, phi_resolution=40), smooth_shading=True)
        pl.add_mesh(pv.Plane(center=(0, 0, -1), i_size=2, j_size=2), lighting=False)
        pl.add_mesh(pv.Cube(center=(0.6, 0, 0)).rotate_x(30))
        pl.camera_position = [(0, 0, 4), (0, 0, 0), (0, 1, 0)]
    return pl


def translucent(pl):
    pl.add_mesh(pv.Sphere(center=(0, 0, 0.8)), opacity=0.5)


def peeled(pl):
    pl.enable_depth_peeling()
    translucent(pl)


def volume(pl):
    grid = pv.ImageData(dimensions=(8, 8, 8), spacing=(0.2, 0.2, 0.2), origin=(-0.7, -0.7, 0))
    grid['v'] = np.linspace(0, 255, grid.n_points)
    pl.add_volume(grid, show_scalar_bar=False)


def needs_hdr(pl):
    pl.ibr.add(pvibr.ToneMapping())
    translucent(pl)


def many(pl):
    pl.ibr.add_instances(pv.Sphere(radius=0.1), [(-0.8, 0.5, 0.5), (0.8, -0.5, 0.5)])


def layered(pl):
    pl.renderer.SetPreserveColorBuffer(True)


FREE = (translucent, peeled, volume, needs_hdr, many, layered, pv.Plotter.add_axes)
BUSY = (
    lambda pl: pl.set_background('black', top='white'),
    lambda pl: pl.enable_anti_aliasing('msaa', multi_samples=4),
    lambda pl: pl.enable_ssao(),
    lambda pl: pl.enable_eye_dome_lighting(),
    lambda pl: pl.enable_anti_aliasing('ssaa'),
    lambda pl: pl.show_bounds(),
    lambda pl: pl.enable_hidden_line_removal(),
)


@pytest.mark.sampled
@pytest.mark.parametrize('columns', [1, 2])
@pytest.mark.parametrize('change', FREE + BUSY)
def test_written_with_the_scene_and_drawn_again_are_the_same(change, columns, monkeypatch):
    pl = scene(shape=(1, columns))
    change(pl)
    pl.show(auto_close=False)
    plain = pl.screenshot()
    with_the_scene = [pl.ibr.buffer(name) for name in ('id', 'normal')]
    monkeypatch.setattr(buffers.Drawn, 'draw', None)
    if change in FREE:
        pl.ibr.buffer('id')
    else:
        with pytest.warns(PvibrWarning, match='not callable'), pytest.raises(RuntimeError):
            pl.ibr.buffer('id')
    monkeypatch.undo()
    monkeypatch.setattr(buffers._Shared, '_is_free', lambda *_: False)
    again = [pl.ibr.buffer(name) for name in ('id', 'normal')]
    same = with_the_scene[0] == again[0]
    assert set(np.unique(again[0])) >= {-1, 0, 1, 2}
    assert same.mean() > 0.998  # impostors choose their cards again
    assert np.abs(with_the_scene[1] - again[1])[same].max() < 1e-4
    pl.render()
    np.testing.assert_array_equal(pl.screenshot(), plain)


@pytest.mark.parametrize('kind', ['spheres', 'cylinders', 'billboards'])
def test_peeled_things_keep_their_colours_beside_what_reads_surfaces(kind):
    """Depth peeling has second colours of its own, which ids are not written to."""
    points = np.random.default_rng(3).uniform(-3, 3, (20, 3))
    add = {
        'spheres': lambda ibr: ibr.add_spheres(points, 0.8, color='orange', opacity=0.5),
        'cylinders': lambda ibr: ibr.add_cylinders(points, points + 1, 0.4, opacity=0.5),
        'billboards': lambda ibr: ibr.add_billboards(
            points, np.full((4, 4, 4), 120, np.uint8), cutout=None
        ),
    }
    pl = pv.Plotter(window_size=(120, 90), off_screen=True)
    pl.disable_anti_aliasing()
    pl.enable_depth_peeling()
    add[kind](pl.ibr)
    pl.camera_position = [(0, -20, 2), (0, 0, 0), (0, 0, 1)]
    plain = pl.screenshot()
    assert plain.std() > 5
    pl.ibr.add(pvibr.Outline())  # of opaque surfaces, of which there are none
    pl.render()
    np.testing.assert_array_equal(pl.screenshot(), plain)
