"""Buffers of a frame: what is where, in the units that are said."""

from __future__ import annotations

import numpy as np
import pytest
import pyvista as pv

import pvibr  # noqa: F401

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
    assert objects[int(ids[45, 60])] is ball
    assert objects[int(ids[:30, 60].max())] is top
    assert not (ids == objects.index(glass)).any()


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


def test_bad_name(pl):
    with pytest.raises(ValueError, match="buffer = 'height': must be one of 'depth'"):
        pl.ibr.buffer('height')
    assert not pl.ibr.effects
