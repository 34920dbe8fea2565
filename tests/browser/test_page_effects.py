"""Shadows, image effects and shapes by rays in pages, against pvibr's own pictures."""

from __future__ import annotations

import numpy as np
import pytest
import pyvista as pv

import pvibr
from tests.browser.test_pages import cones, flip_of, opened, picture, plotter

pytestmark = pytest.mark.browser


def lit(pl, kind):
    """Put a sun, a spot or a lamp in a scene, beside a weak headlight."""
    pl.add_light(pv.Light(light_type='headlight', intensity=0.3))
    places = {'sun': {}, 'spot': {'cone_angle': 50}, 'lamp': {'cone_angle': 180}}
    options = places[kind] | {'positional': kind != 'sun', 'focal_point': (0, 0, 0)}
    position = (2, -3, 3) if kind == 'lamp' else (8, -6, 12)
    pl.add_light(pv.Light(position=position, light_type='scene light', intensity=0.8, **options))


@pytest.mark.parametrize('method', ['pcf', 'pcss'])
@pytest.mark.parametrize('kind', ['sun', 'spot', 'lamp'])
def test_shadows_fall_on_meshes_and_instances(kind, method, page, tmp_path, until):
    pl = plotter(lighting='none')
    lit(pl, kind)
    instances = cones(pl, color='green')
    pl.add_mesh(pv.Sphere(center=(0, -6, 2)), color='orange', smooth_shading=True)
    plain = pl.screenshot(return_img=True)
    shadows = pl.ibr.add(pvibr.Shadows(method=method))
    here = opened(page, pl, tmp_path / 'shadows.html', until)
    there = picture(page)
    assert flip_of(there, here) < 0.03
    # Where pvibr's picture has shadows the page has them, on the ground and on instances.
    darker = plain.astype(int).sum(2) - here.astype(int).sum(2) > 90
    assert darker.mean() > 0.003
    match = np.abs(there.astype(int) - here)[darker].sum(1) < 60
    assert match.mean() > 0.85
    rows = {row.effect: row for row in pl.ibr.web_report('page').rows}
    assert rows[shadows.name].state == rows[instances.name].state == 'shown'
    pl.close()


def test_other_shadows_are_filtered_maps_and_that_is_said(tmp_path):
    pl = plotter(lighting='none')
    lit(pl, 'sun')
    lit(pl, 'spot')
    pl.add_mesh(pv.Sphere())
    pl.add_mesh(pv.Plane(center=(0, 0, -1), i_size=5, j_size=5))
    pl.ibr.add(pvibr.Shadows(method='msm'))
    pl.show(auto_close=False)
    with pytest.warns(pvibr.PvibrWarning, match="method 'msm'.*of 1 more"):
        pl.ibr.export_html(tmp_path / 'soft.html')
    pl.close()


EFFECTS = {
    'fog': lambda: pvibr.Fog(20, color='lightgray'),
    'low fog': lambda: pvibr.Fog(5, height=1.0, base=-0.5),
    'sky': lambda: pvibr.Sky(top='navy'),
    'panorama': lambda: pvibr.Sky(np.random.default_rng(0).integers(0, 255, (8, 16, 3), np.uint8)),
    'tones': lambda: pvibr.ToneMapping('aces', exposure=0.7),
    'exposure': lambda: pvibr.ToneMapping('agx', auto=True),
    'bloom': lambda: pvibr.Bloom(0.4),
    'screen': lambda: pvibr.Bloom(0.4, chain='tent', blend='screen', downsample=4),
    'outline': lambda: pvibr.Outline(color='red'),
    'luminance': lambda: pvibr.Outline(ids=False, depth=False, normal=False, luminance=True),
    'occlusion': lambda: pvibr.AmbientOcclusion(radius=2.0),
    'vignette': lambda: pvibr.Vignette(center=(0.3, 0.6)),
}


@pytest.mark.filterwarnings('ignore:not in the page.*auto:pvibr.PvibrWarning')
@pytest.mark.parametrize('name', EFFECTS)
def test_image_effects_are_drawn_in_the_page(name, page, tmp_path, until):
    pl = plotter()
    cones(pl, color='green')
    pl.add_mesh(pv.Sphere(center=(0, -6, 2)), color='orange', smooth_shading=True, specular=1)
    pl.set_background('black', top='darkblue')
    plain = pl.screenshot(return_img=True)
    effect = pl.ibr.add(EFFECTS[name]())
    here = opened(page, pl, tmp_path / 'effect.html', until)
    there = picture(page)
    assert flip_of(there, here) < 0.03
    assert flip_of(there, here) < 0.4 * flip_of(plain, here)
    rows = {row.effect: row.state for row in pl.ibr.web_report('page').rows}
    assert rows[effect.name] == 'shown'
    pl.close()


def test_a_still_view_is_the_mean_of_many_pictures(page, tmp_path, until):
    pl = plotter()
    pl.add_mesh(pv.Cube(), color='black', lighting=False)
    grays = len(np.unique(pl.screenshot(return_img=True)))
    still = pl.ibr.add(pvibr.Accumulation(16))
    pl.render()
    while still.unfinished:
        pl.render()
    here = opened(page, pl, tmp_path / 'still.html', until)
    assert page.evaluate('pvibr.sample') == 15
    there = picture(page)
    assert flip_of(there, here) < 0.01
    assert len(np.unique(there)) > 2 * grays
    page.locator('.view').focus()
    page.keyboard.press('ArrowLeft')
    assert page.evaluate('pvibr.sample') == 0
    until(lambda: page.evaluate('pvibr.settled && pvibr.sample === 15'))
    pl.close()


def test_all_effects_in_one_of_two_subplots_that_turns(page, tmp_path, until):
    pl = plotter(shape=(1, 2))
    for column in range(2):
        pl.subplot(0, column)
        cones(pl, color='green')
    for effect in (pvibr.Shadows(), *(EFFECTS[n]() for n in EFFECTS if n != 'panorama')):
        if type(effect) not in [type(e) for e in pl.ibr.effects]:
            pl.ibr.add(effect)
    pl.enable_parallel_projection()
    here = opened(page, pl, tmp_path / 'all.html', until)
    assert flip_of(picture(page), here) < 0.03
    page.mouse.move(300, 200)
    page.mouse.down()
    page.mouse.move(330, 210, steps=3)
    page.mouse.up()
    until(lambda: not page.evaluate('window.pvibr.resting'))
    camera = page.evaluate('window.pvibr.cameras[1]')
    pl.subplot(0, 1)
    pl.camera_position = [camera[k] for k in ('position', 'focal_point', 'up')]
    pl.render()
    assert flip_of(picture(page), pl.screenshot(return_img=True)) < 0.03
    pl.close()


def test_chosen_actors_have_outlines(page, tmp_path, until):
    pl = plotter()
    pl.add_mesh(pv.Cube(), color='white', lighting=False, name='plain')
    chosen = pl.add_mesh(pv.Sphere(center=(2, 0, 0)), color='white', lighting=False, name='lined')
    pl.ibr.add(pvibr.Outline([chosen], color='red', width=4))
    here = opened(page, pl, tmp_path / 'chosen.html', until)
    red = [(p[..., 0] > 200) & (p[..., 1] < 60) for p in (here, picture(page))]
    assert red[0].sum() > 200
    assert (red[0] ^ red[1]).sum() < 0.1 * red[0].sum()
    pl.close()


def shapes(pl, **options):
    """Spheres, ellipsoids and cylinders on a floor, near and far."""
    random = np.random.default_rng(6)
    places = random.uniform((-8, -6, 0.5), (8, 30, 0.5), (300, 3))
    first, second, third = np.split(places, 3)
    pl.add_mesh(pv.Plane(center=(0, 12, 0), i_size=20, j_size=40), color='tan')
    pl.ibr.add_spheres(first, random.uniform(0.1, 0.5, 100), color='orange', **options)
    pl.ibr.add_ellipsoids(second, random.uniform(0.1, 0.6, (100, 3)), color='cyan')
    pl.ibr.add_cylinders(third, third + random.normal(0, 0.5, (100, 3)), 0.1, color='red')
    pl.camera_position = [(1, -10, 4), (0, 6, 0), (0, 0, 1)]


@pytest.mark.parametrize('looks', ['opaque', 'translucent', 'parallel'])
def test_shapes_are_drawn_by_rays(looks, page, tmp_path, until):
    pl = plotter()
    shapes(pl, opacity=0.5 if looks == 'translucent' else 1.0)
    if looks == 'parallel':
        pl.enable_parallel_projection()
        pl.camera.parallel_scale = 5
    pl.ibr.add(pvibr.Shadows())
    here = opened(page, pl, tmp_path / 'shapes.html', until)
    assert flip_of(picture(page), here) < 0.02
    pl.close()


def test_many_spheres_are_a_small_page_and_change_colors(page, tmp_path, until):
    pl = plotter()
    random = np.random.default_rng(7)
    places = random.normal(0, 3, (100_000, 3))
    balls = pl.ibr.add_spheres(places, 0.05, scalars=places[:, 2], name='balls')
    pl.remove_scalar_bar() if pl.scalar_bars else None
    path = tmp_path / 'balls.html'
    here = opened(page, pl, path, until)
    assert path.stat().st_size < 3e6
    assert flip_of(picture(page), here) < 0.02
    page.evaluate(
        '() => { const v = window.pvibr, t = v.subplots[0].things[0];'
        " v.recolor(t, Object.keys(t.scalars)[0], [-3, 3], 'gray') }"
    )
    balls.map('gray', clim=(-3, 3))
    pl.render()
    assert flip_of(picture(page), pl.screenshot(return_img=True)) < 0.02
    pl.close()


@pytest.mark.parametrize('mode', ['replace', 'modulate', 'lit'])
def test_images_are_projected_in_the_page(mode, page, tmp_path, until):
    pl = plotter()
    cones(pl, color='green')
    pl.add_mesh(pv.Sphere(center=(0, -4, 2)), color='orange', smooth_shading=True)
    camera = pv.Camera()
    camera.position, camera.focal_point, camera.up = (2, -12, 14), (0, -2, 0), (0, 1, 0)
    options = {'lit': True} if mode == 'lit' else {'mode': mode}
    plain = pl.screenshot(return_img=True)
    projector = pl.ibr.add(pvibr.Projector(pv.examples.mapfile, camera, **options))
    here = opened(page, pl, tmp_path / 'projected.html', until)
    there = picture(page)
    assert flip_of(there, here) < 0.035
    assert flip_of(there, here) < 0.4 * flip_of(plain, here)
    assert {r.effect: r.state for r in pl.ibr.web_report('page').rows}[projector.name] == 'shown'
    pl.close()
