"""Where all lights follow the camera, one sun stands for them: as bright, and it casts."""

import numpy as np
import pytest
import pyvista as pv

import pvibr

SIZE = (200, 150)
LOW, ABOVE = [(5, -7, 2.5), (0, 0, 0), (0, 0, 1)], [(0, 0, 9), (0, 0, 0), (0, 1, 0)]


def plotter(camera=LOW, lighting='light kit'):
    pl = pv.Plotter(off_screen=True, window_size=SIZE, lighting=lighting)
    pl.set_background('black')
    pl.add_mesh(pv.Plane(i_size=6, j_size=6), color='white')
    pl.add_mesh(pv.Sphere(center=(0, 0, 0.8)), color='white')
    pl.camera_position = camera
    return pl


def picture(pl):
    pl.render()
    return pl.screenshot(return_img=True).astype(float)


def brightness(pl):
    return [(light.intensity, light.on) for light in pl.renderer.lights]


@pytest.mark.parametrize('lighting', ['light kit', 'three lights'])
@pytest.mark.parametrize('camera', [LOW, ABOVE], ids=['low', 'above'])
def test_as_bright_and_no_shadow_is_black(lighting, camera):
    pl = plotter(camera, lighting)
    plain = picture(pl)
    pl.ibr.add(pvibr.Shadows(casts=[]))
    unshadowed = picture(pl)
    pl.ibr.effects[0].casts = None
    shadowed = picture(pl)
    seen = plain.max(-1) > 0
    assert 0.8 < unshadowed[seen].mean() / plain[seen].mean() < 1.2
    assert unshadowed.max() <= max(plain.max(), 230) + 2
    darker = unshadowed.mean(-1) - shadowed.mean(-1) > 10
    assert 0.01 < darker.mean() / seen.mean() < 0.5
    assert shadowed[darker].mean(-1).min() > 0.2 * plain[darker].mean(-1).min()


def test_moving_the_camera_draws_nothing_again():
    pl = plotter()
    shadows = pl.ibr.add(pvibr.Shadows())
    picture(pl)
    before = shadows.report()['views drawn']
    for _ in range(3):
        pl.camera.azimuth += 20
        picture(pl)
    assert shadows.report()['views drawn'] == before == 1


def test_lights_are_as_they_were_when_it_goes():
    pl = plotter()
    plain, lights = picture(pl), brightness(pl)
    shadows = pl.ibr.add(pvibr.Shadows())
    assert np.abs(picture(pl) - plain).max() > 30
    assert len(brightness(pl)) == len(lights) + 1
    for end in (lambda: setattr(shadows, 'enabled', False), lambda: pl.ibr.remove(shadows)):
        shadows.enabled = True
        picture(pl)
        end()
        np.testing.assert_array_equal(picture(pl), plain)
        np.testing.assert_allclose(brightness(pl), lights)


def test_a_light_that_stands_still_takes_its_place():
    pl = plotter()
    lights = brightness(pl)
    shadows = pl.ibr.add(pvibr.Shadows())
    picture(pl)
    pl.add_light(pv.Light(position=(1, -1, 2), light_type='scene light'))
    picture(pl)
    np.testing.assert_allclose(brightness(pl)[: len(lights)], lights)
    assert len(pl.renderer.lights) == len(lights) + 1
    assert shadows.report()['lights'] == 1
    shadows.lights = 'all'
    picture(pl)
    assert shadows.report()['lights'] == len(lights)  # all but the headlight
    pl.remove_all_lights()
    shadows.lights = 'auto'
    picture(pl)
    picture(pl)


@pytest.mark.parametrize('method', ['pcf', 'pcss', 'vsm', 'volume'])
def test_strength_is_the_share_that_a_shadow_takes(method):
    pl = plotter(lighting='none')
    pl.add_light(pv.Light(position=(0.2, 0.1, 4), light_type='scene light'))
    shadows = pl.ibr.add(pvibr.Shadows(method=method))
    found = {}
    for strength in (0.0, 0.5, 1.0):
        shadows.strength = strength
        found[strength] = picture(pl)
    dark = found[0.0].mean(-1) - found[1.0].mean(-1) > 100
    assert dark.sum() > 20
    half = (found[0.0] + found[1.0]) / 2
    assert np.abs(found[0.5] - half)[dark].max() <= 2
