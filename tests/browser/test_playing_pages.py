"""Figures and crowds that play in pages, against pvibr's own pictures of the same times."""

from __future__ import annotations

import re
from unittest import mock

import numpy as np
import pytest
import pyvista as pv

import pvibr
from pvibr.animation import (
    AnimationLayer,
    Clip,
    ClipSource,
    FigureMesh,
    Mixer,
    Morphs,
    Skeleton,
    Track,
)
from pvibr.scenes.walker import walker
from tests.browser.test_pages import SIZE, flip_of, opened, picture, plotter, show

pytestmark = pytest.mark.browser

CLIPS = ('Walk', 'Wave')


def person(pl, **options):
    """A skinned figure on a floor."""
    pl.add_mesh(pv.Plane(i_size=4, j_size=4), color='tan')
    actor = pl.ibr.add_animated(walker(), name='person', **({'clip': 'Walk'} | options))
    pl.camera_position = [(2.5, -3.5, 2), (0, 0, 0.8), (0, 0, 1)]
    return actor


def people(pl, count=60):
    """A crowd whose members are near and far, each at its own time."""
    random = np.random.default_rng(6)
    places = random.uniform((-4, 0, 0), (4, 60, 0), (count, 3))
    looks = {'colors': random.integers(80, 255, (count, 3)), 'blend': 'multiply'}
    pl.add_mesh(pv.Plane(center=(0, 30, 0), i_size=20, j_size=70), color='tan')
    crowd = pl.ibr.add_animated(
        *(walker(), places),
        name='people',
        clip=[CLIPS[i % 2] for i in range(count)],
        times=random.uniform(0, 2, count),
        speeds=random.uniform(0.7, 1.3, count),
        orient=[[np.cos(a), 0, 0, np.sin(a)] for a in random.uniform(0, np.pi, count)],
        max_error=4,
        **looks,
    )
    pl.camera_position = [(0, -4, 3), (0, 5, 0.5), (0, 0, 1)]
    return crowd


def at_time(page, until, seconds):
    """Return the picture of a page at a time, at rest."""
    page.evaluate(f'window.pvibr.timeline.set({seconds})')
    until(lambda: not page.evaluate('window.pvibr.resting'))
    return picture(page)


def here_at(pl, seconds):
    """Return the picture of pvibr at a time."""
    pl.ibr.time = seconds
    pl.render()
    return pl.screenshot(return_img=True)


def compared(page, pl, until, times, bound):
    """Return the pictures of a page at times, which must be within a FLIP of pvibr's."""
    pictures = [at_time(page, until, seconds) for seconds in times]
    for seconds, there in zip(times, pictures, strict=True):
        assert flip_of(there, here_at(pl, seconds)) < bound
    return pictures


def moved(a, b):
    return np.abs(a.astype(int) - b).mean()


def clock(page):
    return page.evaluate('window.pvibr.timeline.time')


def test_a_figure_is_where_it_is_here_at_each_time(page, tmp_path, until):
    pl = plotter()
    person(pl)
    pl.ibr.time = 0.2
    here = opened(page, pl, tmp_path / 'person.html', until)
    assert clock(page) == 0.2
    assert flip_of(picture(page), here) < 0.01
    pictures = compared(page, pl, until, (0.55, 3.1), 0.01)
    assert moved(*pictures) > 0.5
    pl.close()


def test_a_crowd_is_where_it_is_here_at_each_time(page, tmp_path, until):
    pl = plotter()
    people(pl)
    here = opened(page, pl, tmp_path / 'people.html', until)
    assert flip_of(picture(page), here) < 0.03
    crowd = 'window.pvibr.renderer.figures.crowds[0].shown.levels'
    assert page.evaluate(f'{crowd}.near.flat().length')
    assert page.evaluate(f'Math.max(...{crowd}.cardCounts)')
    pictures = compared(page, pl, until, (0.4, 2.3), 0.03)
    assert moved(*pictures) > 0.5
    pl.close()


def _layers(figure):
    """Return a walk, and a wave over it that fades in."""
    wave = AnimationLayer(ClipSource(figure, 'Wave'), 0.0)
    wave.weight.go(1.0, at=0.5, fade=2.0)
    return ClipSource(figure, 'Walk'), wave


@pytest.mark.parametrize('how', ['once', 'pingpong', 'twice', 'backwards', 'root', 'mixed'])
def test_clips_end_and_return_as_here(how, page, tmp_path, until):
    pl = plotter()
    actor = person(pl)
    if how == 'mixed':
        actor.driver = Mixer(*_layers(actor.figure))
    else:
        actor.play(
            'Walk',
            start=0.1,
            loop={'once': False, 'pingpong': 'pingpong'}.get(how, True),
            count=1.5 if how == 'twice' else None,
            speed=-0.8 if how == 'backwards' else 1.1,
            root=0 if how == 'root' else None,
        )
    opened(page, pl, tmp_path / 'played.html', until)
    compared(page, pl, until, (0.7, 1.9, 3.3), 0.01)
    pl.close()


def test_rigid_meshes_looks_and_transforms_play(page, tmp_path, until):
    turn = Track(0, 'rotation', [0, 1, 2], [[1, 0, 0, 0], [0, 0, 0, 1], [1, 0, 0, 0]])
    rise = Track(0, 'translation', [0, 1, 2], [[0, 0, 0], [0, 0, 1], [0, 0, 0]])
    ball = pv.Cube().triangulate().subdivide(2)
    ball['height'] = ball.points[:, 2]
    figure = pvibr.Figure(
        [FigureMesh(ball, node=0)], Skeleton([-1], np.eye(4)[None]), [Clip('up', [turn, rise])]
    )
    pl = plotter()
    # UTM coordinates: positions are relative to the figure.
    place = np.array([5e5, 4e6, 100.0])
    actor = pl.ibr.add_animated(
        figure, name='box', scalars='height', show_edges=True, show_scalar_bar=False, opacity=0.8
    )
    actor.position, actor.scale = place, (1, 2, 1)
    pl.add_mesh(pv.Plane(center=place, i_size=4, j_size=4), color='tan')
    pl.camera_position = [place + np.array([3, -6, 3]), place + np.array([0, 0, 0.5]), (0, 0, 1)]
    opened(page, pl, tmp_path / 'box.html', until)
    compared(page, pl, until, (0.3, 1.6), 0.03)
    pl.close()


def test_the_viewer_plays_chooses_and_seeks(page, tmp_path, until):
    pl = plotter()
    actor = person(pl)
    opened(page, pl, tmp_path / 'person.html', until, '')
    page.get_by_role('button', name='Play').click()
    until(lambda: clock(page) > 0.3)
    page.get_by_role('button', name='Pause').click()
    stopped = clock(page)
    page.wait_for_timeout(300)
    assert clock(page) == stopped
    page.locator('.view').focus()
    page.keyboard.press(' ')
    until(lambda: clock(page) != stopped)
    page.keyboard.press(' ')
    slider = page.get_by_role('slider', name='Time')
    box = slider.bounding_box()
    y = box['y'] + box['height'] / 2
    page.mouse.move(box['x'] + 4, y)
    page.mouse.down()
    page.mouse.move(box['x'] + box['width'] / 2, y, steps=4)
    page.mouse.up()
    length = page.evaluate('window.pvibr.timeline.length')
    assert abs(clock(page) - length / 2) < 0.1 * length
    assert re.fullmatch(r'\d+\.\d\d s', slider.get_attribute('aria-valuetext'))
    page.get_by_text('Settings').click()
    page.get_by_label('Clip').select_option('Wave')
    page.get_by_text('Settings').click()
    page.evaluate("document.querySelector('.timeline').hidden = true")
    page.evaluate("document.querySelector('.panel').hidden = true")
    actor.play('Wave', start=0.0)
    assert flip_of(at_time(page, until, 0.5), here_at(pl, 0.5)) < 0.01
    pl.close()


def test_a_click_hits_what_plays(page, tmp_path, until):
    pl = plotter()
    crowd = people(pl)
    opened(page, pl, tmp_path / 'people.html', until)
    at_time(page, until, 0.5)
    pl.ibr.time = 0.5
    pl.render()
    hits = []
    for x, y in np.random.default_rng(3).integers((60, 120), (420, 300), (40, 2)):
        hit = crowd.pick(x, SIZE[1] - 1 - y)
        page.mouse.click(float(x), float(y))
        said = page.evaluate("document.querySelector('.status').textContent")
        if hit is not None and said.startswith('people'):
            hits.append(said.split()[1].rstrip(',') == str(hit.index))
    assert len(hits) > 2
    assert np.mean(hits) > 0.8
    pl.close()


def test_only_what_moves_has_a_slider(page, tmp_path, until):
    pl = plotter()
    pl.add_mesh(pv.Cube())
    held = pl.ibr.add_animated(walker(), name='held')
    held.stop()
    here = opened(page, pl, tmp_path / 'still.html', until, '')
    assert page.locator('.timeline').count() == 0
    page.evaluate("document.querySelector('.panel').hidden = true")
    assert flip_of(picture(page), here) < 0.03
    assert 'holds a pose' in str(pl.ibr.web_report('page'))
    pl.close()


def test_a_page_starts_at_a_time_and_keeps_a_size(page, tmp_path, until):
    pl = plotter()
    person(pl)
    pl.show(auto_close=False)
    path = tmp_path / 'small.html'
    pl.ibr.export_html(path, time=0.5)
    assert pl.ibr.time == 0
    whole = path.stat().st_size / 1e6
    with pytest.warns(pvibr.PvibrWarning, match='clips have one of'):
        pl.ibr.export_html(path, time=0.5, megabytes=whole - 0.004)
    assert path.stat().st_size / 1e6 < whole - 0.004
    show(page, path, until)
    assert clock(page) == 0.5
    assert flip_of(at_time(page, until, 0.9), here_at(pl, 0.9)) < 0.02
    pl.close()


def test_what_a_page_plays_is_said(tmp_path):
    pl = plotter()
    person(pl)
    dual = pl.ibr.add_animated(walker(), name='dual')
    dual.skinning = 'dual'
    report = str(pl.ibr.web_report('page'))
    assert re.search(r'person +shown +plays \d+ clips', report)
    assert re.search(r'dual +shown +meshes, posed as they are now: .*dual quaternions', report)
    with pytest.raises(ValueError, match='time must be a finite number'):
        pl.ibr.export_html(tmp_path / 'bad.html', time='now')
    assert not list(tmp_path.iterdir())
    pl.close()


def test_shadows_follow_what_plays(page, tmp_path, until):
    pl = plotter(lighting='none')
    person(pl)
    pl.add_light(pv.Light(position=(3, -2, 6), light_type='scene light'))
    pl.ibr.add(pvibr.Shadows())
    opened(page, pl, tmp_path / 'shadow.html', until)
    compared(page, pl, until, (0.2, 0.7), 0.03)
    pl.close()


@pytest.fixture(autouse=True)
def _lighter():
    with mock.patch.multiple('pvibr.figures.pose_atlas', VIEWS=8, TILES=(32,)):
        yield


def test_morph_targets_play(page, tmp_path, until):
    ball = pv.Sphere(theta_resolution=20, phi_resolution=20)
    normals = np.asarray(ball.point_normals)
    grow, shear = 0.4 * normals, np.zeros_like(normals)
    shear[:, 0] = 0.6 * ball.points[:, 2]
    morphs = Morphs([grow, shear])
    keys = [[0.0, 0.0], [1.0, 0.2], [0.0, 1.0], [0.0, 0.0]]
    clip = Clip('breathe', [Track(0, 'weights', [0, 0.5, 1.2, 2], keys)])
    figure = pvibr.Figure(
        [FigureMesh(ball, node=0, morphs=morphs)], Skeleton([-1], np.eye(4)[None]), [clip]
    )
    pl = plotter()
    pl.ibr.add_animated(figure, name='ball', color='orange', smooth_shading=True)
    pl.ibr.add_animated(figure, [[1.6, 0, 0], [2.8, 1, 0]], times=[0.4, 1.1], name='balls')
    pl.camera_position = [(1, -6, 2), (1, 0, 0), (0, 0, 1)]
    opened(page, pl, tmp_path / 'morphs.html', until)
    pictures = compared(page, pl, until, (0.4, 1.0), 0.015)
    assert moved(*pictures) > 0.5
    pl.close()


def test_attached_actors_follow_the_joint(page, tmp_path, until):
    pl = plotter()
    actor = person(pl, clip='Wave')
    actor.position, actor.orientation = (0.3, 0, 0), (0, 0, 30)
    lamp = pl.add_mesh(pv.Cube(x_length=0.3, y_length=0.3, z_length=0.6), color='red', name='lamp')
    lamp.position = (0, 0, 0.2)
    figure = actor.figure
    before, after = (figure.world(figure.sample(t, 'Wave'))[:, :3, 3] for t in (0.3, 0.65))
    hand = int(np.linalg.norm(before - after, axis=1).argmax())
    actor.attach_prop(lamp, hand)
    opened(page, pl, tmp_path / 'lamp.html', until)
    pictures = compared(page, pl, until, (0.3, 0.65), 0.01)
    red = [np.argwhere((p[..., 0] > 100) & (p[..., 1:] < 40).all(-1)).mean(0) for p in pictures]
    assert np.linalg.norm(red[0] - red[1]) > 3  # pixels
    report = str(pl.ibr.web_report('page'))
    assert 'stand still' not in report
    pl.close()
