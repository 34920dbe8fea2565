"""Things that are hidden cast no shadow, and stay hidden beside what draws scenes elsewhere."""

import numpy as np
import pytest
import pyvista as pv

import pvibr

POINTS = [[0, 0, 2.0], [1.5, 0, 2.0]]
THINGS = {
    'instances': lambda pl: pl.ibr.add_instances(pv.Sphere(), POINTS, bake=False),
    'images': lambda pl: pl.ibr.add_instances(pv.Sphere(), POINTS, bake=True, force_level='flat'),
    'spheres': lambda pl: pl.ibr.add_spheres(POINTS, radius=0.5),
    'figure': lambda pl: pl.ibr.add_animated(pv.Sphere(center=(0, 0, 2))),
}
DRAWING_ELSEWHERE = {
    'hard': lambda: pvibr.Shadows(method='hard', resolution=256),
    'pcf': lambda: pvibr.Shadows(resolution=256),
    'volume': lambda: pvibr.Shadows(method='volume'),
    'projector': lambda: pvibr.Projector(np.full((8, 8, 3), [90, 160, 90], np.uint8), beam()),
}


def beam():
    """A camera above the scene."""
    camera = pv.Camera()
    camera.position, camera.focal_point = (3, -4, 8), (0, 0, 0)
    return camera


def stage(effect):
    pl = pv.Plotter(off_screen=True, window_size=(160, 120), lighting='none')
    pl.add_light(pv.Light(position=(2, -2, 8), light_type='scene light'))
    pl.add_mesh(pv.Plane(i_size=8, j_size=8), color='white')
    pl.ibr.add(effect())
    pl.camera_position = [(6, -8, 7), (0, 0, 0), (0, 0, 1)]
    return pl


@pytest.fixture(autouse=True)
def small_images(monkeypatch):
    monkeypatch.setattr('pvibr.instances.levels._GRID', (4, 16))


@pytest.mark.parametrize('effect', DRAWING_ELSEWHERE.values(), ids=DRAWING_ELSEWHERE)
@pytest.mark.parametrize('add', THINGS.values(), ids=THINGS)
def test_what_is_hidden_is_gone_with_its_shadow(add, effect):
    bare = stage(effect)
    bare.show(auto_close=False)
    pl = stage(effect)
    thing = add(pl)
    pl.camera_position = bare.camera_position
    pl.show(auto_close=False)
    assert (pl.image != bare.image).any(-1).sum() > 200
    thing.visibility = False
    for _ in range(2):
        pl.render()
        assert np.abs(pl.image.astype(int) - bare.image).max() <= 2
    thing.visibility = True
    pl.render()
    assert (pl.image != bare.image).any(-1).sum() > 200
    pl.close()
    bare.close()
