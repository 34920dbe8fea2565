"""Playing of clips by actors: there and back, counts, ends, root motion, and props on joints."""

from __future__ import annotations

import numpy as np
import pytest
import pyvista as pv

from pvibr import Figure, PvibrWarning
from pvibr.animation import Clip, ClipSource, FigureMesh, Pose, Skeleton, Track
from tests.animation.conftest import refused

STEP = Clip('step', [Track(0, 'translation', [0, 2], [[0, 0, 0], [4, 0, 0]])])
TURN = Clip('turn', [Track(1, 'rotation', [0, 1], [[1, 0, 0, 0], [1, 0, 0, 1]])])


@pytest.fixture
def walker():
    """Return a figure of two joints, the second one above the first."""
    skeleton = Skeleton([-1, 0], Pose([[0, 0, 0], [0, 0, 1]]), ['hip', 'hand'])
    return Figure([FigureMesh(pv.Cube(), node=0)], skeleton, [STEP, TURN])


@pytest.fixture
def plotter():
    plotter = pv.Plotter(off_screen=True, window_size=(60, 40))
    plotter.show(auto_close=False)  # from now on render() draws
    yield plotter
    plotter.close()


def places(source, times):
    return source.sample(np.array(times)).translation[..., 0, 0].tolist()


def test_there_and_back(walker):
    source = ClipSource(walker, 'step', loop='pingpong')
    assert places(source, [0, 1, 2, 3, 4, 5, -1]) == [0, 2, 4, 2, 0, 2, 2]
    assert places(ClipSource(walker, 'step', 2.0, loop='pingpong'), [1, 1.5]) == [4, 2]
    assert walker.sample(3.0, 'step', 'pingpong').translation[0, 0] == 2
    with pytest.raises(ValueError, match=r"loop must be one of True, False.* got 'back'"):
        ClipSource(walker, 'step', loop='back')


@pytest.mark.parametrize(
    ('loop', 'count', 'ends'),
    [
        (True, 1, [0, 2, 4, 4, 4, 4]),
        (True, 2, [0, 2, 0, 2, 4, 4]),
        (True, 1.5, [0, 2, 0, 2, 2, 2]),
        ('pingpong', 1, [0, 2, 4, 2, 0, 0]),
        ('pingpong', 0.5, [0, 2, 4, 4, 4, 4]),
        (False, None, [0, 2, 4, 4, 4, 4]),
    ],
)
def test_counts(walker, loop, count, ends):
    source = ClipSource(walker, 'step', loop=loop, count=count)
    assert places(source, [0, 1, 2, 3, 4, 5]) == ends
    assert places(source, [-1]) == [0]


def test_a_root_moves_on_and_stops_with_the_count(walker):
    source = ClipSource(walker, 'step', root='hip')
    assert places(source, [1, 3, 5, -1]) == [2, 6, 10, -2]
    counted = ClipSource(walker, 'step', root='hip', count=2)
    assert places(counted, [1, 3, 4, 9]) == [2, 6, 8, 8]


@pytest.mark.parametrize('count', [0, -1, np.inf, np.nan])
def test_counts_that_are_none(walker, count):
    refused('count must', ClipSource, walker, 'step', count=count)


def test_an_actor_plays_backwards_from_the_end(walker, plotter):
    actor = plotter.ibr.add_animated(walker)
    actor.play('step', speed=-1.0, loop=False, start=1.0)
    found = []
    for time in (1.0, 2.0, 4.0):
        plotter.ibr.time = time
        found.append(actor.pose.translation[0, 0])
    assert found == [4, 2, 0]


def test_the_end_is_told_once_and_may_play_on(walker, plotter):
    actor = plotter.ibr.add_animated(walker)
    told = []

    def play_on(ended):
        told.append((plotter.ibr.time, ended))
        ended.play('step', loop=False, on_finished=lambda a: told.append('again'))

    actor.play('step', loop='pingpong', count=1, on_finished=play_on)
    for time in (1.0, 3.9, 4.5, 4.6, 5.5):
        plotter.ibr.time = time
        plotter.render()
    assert told == [(4.5, actor)]
    assert actor.pose.translation[0, 0] == 2
    plotter.ibr.time = 7.0
    plotter.render()
    plotter.render()
    assert told[1:] == ['again']


def test_another_clip_cancels_the_end(walker, plotter):
    actor = plotter.ibr.add_animated(walker)
    actor.play('step', loop=False, on_finished=lambda _: pytest.fail('told'))
    actor.play('turn')
    plotter.ibr.time = 9.0
    plotter.render()


def test_what_fails_at_the_end_is_named(walker, plotter):
    actor = plotter.ibr.add_animated(walker)
    actor.play('step', loop=False, on_finished=lambda _: 1 / 0)
    plotter.ibr.time = 9.0
    with pytest.warns(PvibrWarning, match='on_finished of .* raised ZeroDivisionError'):
        plotter.render()
    assert actor.pose.translation[0, 0] == 4


def test_bad_ends(walker, plotter):
    actor = plotter.ibr.add_animated(walker)
    refused('on_finished must have an end', actor.play, 'step', on_finished=print)
    refused(r'start must .*got nan', actor.play, 'step', start=np.nan)
    for name in ('start', 'speed', 'fade'):
        refused(rf"{name} must .*got 'x'", actor.play, 'step', **{name: 'x'}, kind=TypeError)
    for name in ('pose', 'weights'):
        refused(f"{name} = 'x'", setattr, actor, name, 'x')
    refused('pose must have shape', setattr, actor, 'pose', None)
    with pytest.raises(TypeError, match=r'on_finished must be callable.* got 3'):
        actor.play('step', loop=False, on_finished=3)
    refused(r"loop must .*got 'x'", actor.play, 'step', loop='x')
    refused('joint must be in the skeleton', actor.play, 'step', root='tail')


def test_many_fades_keep_only_the_last_two_clips(walker, plotter):
    actor = plotter.ibr.add_animated(walker)
    for i in range(20):
        plotter.ibr.time = float(i)
        actor.play(('step', 'turn')[i % 2], fade=0.5)
    depth, source = 0, actor.driver
    while hasattr(source, 'before'):
        depth, source = depth + 1, source.before
    assert depth == 1


def test_props_follow_a_joint(walker, plotter):
    actor = plotter.ibr.add_animated(walker, clip='turn')
    actor.position = (10, 0, 0)
    sword = plotter.add_mesh(pv.Cube(center=(1, 0, 0)))
    lamp = pv.Light(light_type='scene light')
    plotter.add_light(lamp)
    rider = plotter.ibr.add_animated(Figure([FigureMesh(pv.Cube(center=(0, 2, 0)))]))
    offset = np.eye(4)
    offset[:3, 3] = 0, 0, 5
    actor.attach_prop(sword, 'hand')
    actor.attach_prop(rider, 'hand', offset)
    actor.attach_prop(lamp, 1)
    np.testing.assert_allclose(sword.center, (11, 0, 1), atol=1e-12)
    plotter.ibr.time = 0.99999999
    actor.position = (20, 0, 0)
    plotter.render()  # a quarter turn about z
    np.testing.assert_allclose(sword.center, (20, 1, 1), atol=1e-6)
    np.testing.assert_allclose(rider.center, (18, 0, 6), atol=1e-6)
    lit = pv.array_from_vtkmatrix(lamp.transform_matrix)
    np.testing.assert_allclose(lit[:3, 3], (20, 0, 1), atol=1e-6)
    actor.detach_prop(sword)
    actor.detach_prop(sword)
    actor.position = (0, 0, 0)
    plotter.render()
    np.testing.assert_allclose(sword.center, (20, 1, 1), atol=1e-6)
    assert rider.center[0] < 0


def test_props_that_cannot_be_held(walker, plotter):
    actor = plotter.ibr.add_animated(walker)
    refused('must be an actor, a light', actor.attach_prop, 'sword', 'hand', kind=TypeError)
    refused('must be an actor, a light', actor.attach_prop, actor, 'hand', kind=TypeError)
    refused("got 'tail'", actor.attach_prop, pv.Actor(), 'tail')
    refused(r'offset must have shape', actor.attach_prop, pv.Actor(), 'hand', [1, 2, 3])
