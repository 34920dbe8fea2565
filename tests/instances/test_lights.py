"""Images are lit as meshes are, by any lights, also those that came after the bake."""

from __future__ import annotations

import numpy as np
import pytest
import pyvista as pv

import pvibr

pytestmark = pytest.mark.sampled

POSES = np.array([[0, 0, 0], [1.6, 0, 0], [0, 1.8, 0.3], [1.6, 1.8, 0]])
CAMERA = {'eye': (-2.0, -9.0, 4.0), 'focus': (0.8, 0.8, 0.0)}
SIZE = (180, 130)

LIGHTS = {
    'none': [],
    'headlight': [{'light_type': 'headlight'}],
    'camera': [{'light_type': 'camera light', 'position': (1, 1, 1)}],
    'two': [
        {'position': (5, -3, 6), 'color': 'red', 'light_type': 'scene light'},
        {'position': (-5, -3, 1), 'color': 'blue', 'light_type': 'scene light'},
    ],
    'behind': [{'position': (3, 9, 2), 'light_type': 'scene light'}],
    'near': [{'position': (1, -2, 2), 'cone_angle': 90, 'attenuation_values': (0, 0, 0.2)}],
    'cone': [{'position': (0.8, -2, 4), 'cone_angle': 14, 'exponent': 3}],
}
LOOKS = {
    'flat': {},
    'highlights': {'smooth_shading': True, 'specular': 0.8, 'specular_power': 20},
    'unlit': {'lighting': False},
}


def light(pl, lights):
    pl.remove_all_lights()
    for how in lights:
        added = pv.Light(focal_point=(0.8, 0.8, 0), **how)
        added.positional = 'cone_angle' in how
        pl.add_light(added)


@pytest.mark.parametrize('look', LOOKS.values(), ids=LOOKS)
@pytest.mark.parametrize('level', ['parallax', 'blended'])
def test_moved_lights(scenes, see, bean, look, level):
    look = {'color': 'tan'} | look
    pl, _ = scenes.instances(bean, POSES, level=level, size=SIZE, camera=CAMERA, **look)
    truth = scenes.actors(bean, POSES, size=SIZE, scale=4, camera=CAMERA, **look)
    for name, lights in LIGHTS.items():
        light(pl, lights)
        light(truth, lights)
        drawn, wanted = see.grab(pl), see.reduce(see.grab(truth), 4)
        shown = (wanted < 0.99).any(-1)
        assert shown.mean() > 0.05
        off = np.abs(drawn - wanted)[shown].mean()
        assert off < (0.04 if name == 'cone' else 0.025), name
    pl.close()
    truth.close()


def test_near_meshes_in_a_cone_of_light(scenes, see, bean):
    pl, _ = scenes.instances(bean, POSES, level='mesh', size=SIZE, camera=CAMERA, color='tan')
    truth = scenes.actors(bean, POSES, size=SIZE, camera=CAMERA, color='tan')
    for plotter in (pl, truth):
        light(plotter, LIGHTS['cone'])
    np.testing.assert_allclose(see.grab(pl), see.grab(truth), atol=1.01 / 255)


@pytest.mark.parametrize('rise', [0.4, 2.0])
def test_lights_see_the_outlines_of_meshes(scenes, see, bean, rise):
    """Also where a low light's texels are oblong, and things on cards shadow themselves."""
    poses = [[2 * x, 2 * y, 0.0] for x in range(4) for y in range(3)]
    look = {'color': 'tan', 'size': (200, 150)}
    look['camera'] = {'eye': (-2.0, -9.0, 5.0), 'focus': (3.0, 2.0, 0.0)}
    pl, _ = scenes.instances(bean, poses, **look)
    pictures = []
    for plotter in (pl, scenes.actors(bean, poses, **look)):
        light(plotter, [{'position': (3, 1, 3 * rise), 'light_type': 'scene light'}])
        plotter.add_mesh(pv.Plane(center=(3, 2, -0.5), i_size=30, j_size=30), color='white')
        plain = see.grab(plotter)
        plotter.ibr.add(pvibr.Shadows(resolution=512))
        pictures.append((plain, see.grab(plotter)))
        plotter.close()
    (plain, dark), (other, truth) = pictures
    alike = np.abs(plain - other).max(-1) < 0.1
    wrong = alike & (np.abs(dark - truth).max(-1) > 0.25)
    assert (np.abs(other - truth).max(-1) > 0.25).mean() > 0.03
    assert wrong.sum() < 0.001 * alike.sum()


def test_levels_of_depth_maps(scenes, bean):
    pl, beans = scenes.instances(bean, POSES)
    model = beans.groups[0].model
    shown, square, oblong = model.limits(1.0), *(model.depth_limits(1.0, a) for a in (1.0, 4.0))
    pl.close()
    assert (square.mesh_from <= shown.mesh_from).all()
    assert (square.mesh_from <= model.levels[0].triangles ** 0.5).all()
    assert (square.mesh_to[1] > shown.mesh_to[1]).all()
    np.testing.assert_allclose(oblong.mesh_to[1:], 4 * square.mesh_to[1:])
    assert not square.cards['splat'].any()
    np.testing.assert_array_equal(square.cards['blended'][1], square.mesh_from)
