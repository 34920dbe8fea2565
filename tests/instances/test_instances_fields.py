"""Fields of instances a few pixels large: they cover what the meshes do, in the same colours."""

import numpy as np
import pytest
import pyvista as pv

from pvibr.instances import group
from pvibr.maths.blocks import ascending

SIZE = (150, 90)
FEW = 64  # instances up to which each is sorted by itself, here


@pytest.fixture(scope='module', params=['sphere', 'ring', 'bean'])
def mesh(request, bean):
    made = {
        'sphere': lambda: pv.Sphere(theta_resolution=16, phi_resolution=15),
        'ring': lambda: pv.ParametricTorus(
            crosssectionradius=0.15, u_res=40, v_res=12, w_res=2
        ).triangulate(),
        'bean': lambda: bean,
    }
    return made[request.param]()


def field(mesh, n, diameter):
    """Return places on a plane, in disorder, many behind others, and a camera for them."""
    center, radius = np.array(mesh.center), mesh.length / 2
    poses = np.random.default_rng(2).uniform(-20, 20, (n, 3)) * [radius, radius, 0] - center
    angle = np.degrees(2 * np.arctan(SIZE[1] / diameter / 300))
    camera = {'eye': np.array([0, -288.0, 84.0]) * radius, 'focus': (0, 0, 0), 'angle': angle}
    return poses, camera


def cover_and_color(picture):
    cover = picture[..., 3].sum()
    return cover, picture[..., :3].sum((0, 1)) / cover


@pytest.mark.sampled
@pytest.mark.parametrize(('level', 'darker'), [('splat', 0.2), ('flat', 0.15)])
def test_large_sets_cover_what_the_meshes_do(scenes, mesh, level, darker, monkeypatch):
    monkeypatch.setattr(group, 'SORTED', FEW)
    poses, camera = field(mesh, 700, 3.5)
    drawn, truth = scenes.pair(mesh, poses, level=level, size=SIZE, camera=camera, color='tan')
    (cover, color), (whole, right) = cover_and_color(drawn), cover_and_color(truth)
    assert whole < 0.9 * np.prod(SIZE)  # there is room for too much
    assert cover == pytest.approx(whole, rel=0.06)
    # What is hidden by others is mostly what lies in the dark below.
    np.testing.assert_allclose(color, right, rtol=darker)


@pytest.mark.parametrize(('low', 'high'), [(0.0, 1.0), (-3e5, -1.0), (2.0, 2.0)])
def test_order_by_radix(low, high):
    values = np.random.default_rng(0).uniform(low, high, 5000).astype(np.float32)
    order = ascending(values)
    assert sorted(order.tolist()) == list(range(5000))
    assert (np.diff(values[order]) >= -(high - low) / 60_000).all()
