"""Actors that come to and go from impostors: the others keep their images."""

import numpy as np
import pytest
import pyvista as pv

from tests.pictures import place, plotter, shot
from tests.refusals import refused

BALL = pv.Sphere(radius=0.6, theta_resolution=40, phi_resolution=30)
COUNT = 36


def make(seed=4, *, count=COUNT, **settings):
    """Return a plotter with a field of balls, and an impostor of them."""
    rng = np.random.default_rng(seed)
    pl = plotter((200, 150))
    actors = [pl.add_mesh(BALL, color=rng.uniform(0, 0.9, 3)) for _ in range(count)]
    for k, actor in enumerate(actors):
        actor.position = (*(1.6 * np.array(divmod(k, 6)) + rng.uniform(-0.2, 0.2, 2)), 0)
    place(pl, (4, -22, 13), (4, 4, 0))
    impostor = pl.ibr.add_impostor(actors, only_if_faster=False, **settings)
    pl.show(auto_close=False)
    return pl, actors, impostor, shot(pl)


def as_meshes(pl, impostor):
    impostor.enabled = False
    found = shot(pl)
    impostor.enabled = True
    return found


def alike(first, second):
    return (np.abs(first - second).max(-1) > 60).mean() < 0.015


@pytest.mark.parametrize('hierarchical', [False, True])
@pytest.mark.parametrize('seed', [4, 5])
def test_pictures_follow_and_others_keep_their_images(hierarchical, seed):
    pl, actors, impostor, before = make(seed, hierarchical=hierarchical)
    rng = np.random.default_rng(seed)
    for k in rng.permutation(COUNT)[:8].tolist():
        drawn = impostor.rendered
        actor, there = actors[k], as_meshes(pl, impostor)
        pl.renderer.RemoveActor(actor)
        without = shot(pl)
        assert alike(without, as_meshes(pl, impostor))
        assert (there != without).any()
        assert actor not in impostor.things
        pl.renderer.AddActor(actor)
        assert (shot(pl) != without).any()  # as a mesh
        impostor.add(actor)
        again = shot(pl)
        assert alike(again, before)
        assert impostor.report()['meshes'] == {}
        # Itself, and what it shares images with: no image of all of them.
        assert impostor.rendered - drawn <= (2 if not hierarchical else 2 * np.log2(COUNT) + 4)


@pytest.mark.parametrize('hierarchical', [False, True])
def test_hundreds_come_to_a_few(hierarchical):
    pl, actors, impostor, _ = make(count=3, hierarchical=hierarchical)
    more = [pv.Actor(mapper=actors[0].mapper) for _ in range(150)]
    for k, actor in enumerate(more):
        pl.renderer.AddActor(actor)
        actor.prop.color, actor.position = (0.2, 0.5, k / 150), (k % 12, k // 12, k % 3)
        actor.scale = 0.4
        if k % 10 == 9:
            impostor.add(more[k - 9 : k + 1])
        if k % 50 == 49:
            place(pl, (4, -26, 15), (5, 5, 0))
            found = shot(pl)
            assert alike(found, as_meshes(pl, impostor))
    assert sum(impostor.report()['meshes'].values()) == 0
    assert impostor.enabled
    impostor.remove(more[::2])
    assert len(impostor.things) == 3 + 75
    assert alike(shot(pl), found)  # the same, half of it as meshes
    for actor in more[1::2]:
        pl.renderer.RemoveActor(actor)
    assert alike(shot(pl), as_meshes(pl, impostor))
    assert len(impostor.things) == 3


def test_one_that_comes_and_goes_before_a_frame():
    pl, actors, impostor, before = make(hierarchical=True)
    other = pl.add_mesh(BALL.translate((20, 0, 0)), reset_camera=False)
    impostor.add(other)
    impostor.remove(other)
    impostor.add(other)
    pl.remove_actor(other)
    assert alike(shot(pl), before)
    assert impostor.enabled
    impostor.remove(actors)
    shot(pl)
    assert pl.ibr.effects == ()  # of the last actor


def test_only_within_the_budget():
    pl, actors, impostor, _ = make(hierarchical=True)
    impostor.budget_ms = 0.0
    for actor in actors[:5]:
        pl.renderer.RemoveActor(actor)
        drawn = impostor.rendered
        found = shot(pl)
        assert impostor.rendered <= drawn + 2  # one in each of two frames
        assert alike(found, as_meshes(pl, impostor))


def test_who_may_not_come_or_go_changes_nothing():
    pl, actors, impostor, before = make()
    stranger = pv.Actor(mapper=pv.DataSetMapper(BALL))
    later = pl.add_mesh(BALL, reset_camera=False)
    other = pl.ibr.add_impostor(later)
    for wrong, why in (
        (actors[0], r'actors\[0\] must be new'),
        (stranger, 'not in this subplot'),
        (later, 'already replaces some'),
        ([], 'got none'),
    ):
        refused(why, impostor.add, wrong)
    refused('must be actors', impostor.add, 3, kind=TypeError)
    refused('must be one of the 36', impostor.remove, [actors[0], later])
    assert len(impostor.things) == COUNT
    other.remove()
    pl.remove_actor(later)
    assert alike(shot(pl), before)
