"""Frames in which nothing changed show what the last one showed."""

import numpy as np
import pytest
import pyvista as pv

from tests.calls import calls_of
from tests.pictures import off, place, plotter, shot

BALL = pv.Sphere(theta_resolution=40, phi_resolution=40)
AT_REST = 60  # frames


def scene():
    """Return a plotter with an impostor of many balls, and their actors."""
    pl = plotter((160, 120))
    places = np.random.default_rng(3).uniform(-8, 8, (40, 3)) * (1, 1, 0.2)
    actors = [pl.add_mesh(BALL, color='tomato') for _ in places]
    for actor, at in zip(actors, places, strict=True):
        actor.position = at
    impostor = pl.ibr.add_impostor(actors, only_if_faster=False)
    place(pl, (30, -25, 12))
    pl.show(auto_close=False)
    return pl, impostor, actors


def rest(pl):
    for _ in range(AT_REST):
        pl.render()


def test_little_is_called():
    pl, impostor, actors = scene()
    before = shot(pl)
    rest(pl)
    frames, rendered = impostor._frames, impostor.rendered
    assert len(calls_of(pl.render)) < 420 + 6 * len(actors)
    np.testing.assert_array_equal(shot(pl), before)
    assert impostor._frames > frames
    assert impostor.rendered == rendered
    assert impostor.report()['shown'] == len(actors)


def moved(pl, _impostor, actors):
    actors[3].position = (1.0, -14.0, 2.0)


def painted(pl, _impostor, actors):
    for actor in actors:
        actor.prop.color = 'blue'


def hidden(pl, _impostor, actors):
    for actor in actors[::2]:
        actor.visibility = False


def turned(pl, _impostor, _actors):
    pl.camera.Azimuth(40)


def resized(pl, _impostor, _actors):
    pl.window_size = (100, 140)


def removed(pl, impostor, actors):
    impostor.remove(actors[5])
    pl.remove_actor(actors[7])


def relit(pl, _impostor, _actors):
    pl.remove_all_lights()
    pl.add_light(pv.Light(position=(-30, 5, 2), light_type='scene light'))


@pytest.mark.parametrize('change', [moved, painted, hidden, turned, resized, removed, relit])
def test_changes_are_seen(change):
    pl, *rest_of_scene = scene()
    rest(pl)
    before = shot(pl)
    change(pl, *rest_of_scene)
    after = shot(pl)
    fresh, *fresh_rest = scene()
    change(fresh, *fresh_rest)
    expected = shot(fresh)
    assert after.shape != before.shape or (off(after, before) > 15).any()
    assert (off(after, expected) > 15).mean() < 0.003


def test_settings_are_followed():
    pl, impostor, actors = scene()
    rest(pl)
    impostor.max_error = 1e-3
    pl.camera.Azimuth(0.01)
    shot(pl)
    rendered = impostor.rendered
    impostor.max_error, impostor.only_if_faster = 1.0, True
    rest(pl)
    impostor.only_if_faster = False
    shot(pl)
    assert impostor.report()['shown'] == len(actors)
    assert impostor.rendered >= rendered


def test_two_cameras_in_turn():
    pl, _impostor, _actors = scene()
    first = shot(pl)
    pl.camera.Azimuth(90)
    second = shot(pl)
    rest(pl)
    for _ in range(2):
        pl.camera.Azimuth(-90)
        assert (off(shot(pl), first) > 15).mean() < 0.002
        pl.camera.Azimuth(90)
        assert (off(shot(pl), second) > 15).mean() < 0.002
