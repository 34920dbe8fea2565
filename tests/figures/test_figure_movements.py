"""Movements that are put together, in a scene: pictures beside those of posed meshes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pvibr import Figure
from pvibr.animation import (
    AnimationLayer,
    ClipSource,
    Correctives,
    FigureMesh,
    FrameRange,
    Mixer,
    PoseSource,
    StateGraph,
    VertexAnimationStates,
    joint_mask,
)
from pvibr.animation.pose import Pose
from tests.figures.makers import bend, bending, growing, worm
from tests.figures.test_animated_actor import differing, plotter, shot


def beside(figure, time, driver=None):
    """Return how many pixels a figure and its mesh differ in, and how many show something."""
    pictures = []
    for as_mesh in (False, True):
        pl = plotter()
        if as_mesh:
            pose = figure.sample(time) if driver is None else driver.sample(time)
            pl.add_mesh(figure.mesh(pose=pose), color='tan')
        else:
            actor = pl.ibr.add_animated(figure, color='tan')
            actor.driver = actor.driver if driver is None else driver
            pl.ibr.time = time
        pictures.append(shot(pl))
        pl.close()
    return differing(*pictures), differing(pictures[1], pictures[1][0, 0])


@pytest.mark.parametrize('time', [0.4, 1.2, 2.0])
def test_states_and_layers_drive_a_figure(time):
    figure = worm(clips=[bending()])
    still = PoseSource(figure.rest)
    graph = StateGraph({'rest': still, 'bend': ClipSource(figure, 'bend')}, fade=0.5)
    graph.go('bend', at=1.0)
    twist = AnimationLayer(
        PoseSource(bend(figure, 0.3)), 0.8, joint_mask(figure.skeleton, [2], 1), figure.rest
    )
    apart, seen = beside(figure, time, Mixer(graph, twist))
    assert apart <= 2
    assert seen > 500


def test_an_order_is_given_while_it_plays():
    figure = worm(clips=[bending()])
    graph = StateGraph(
        {'rest': PoseSource(figure.rest), 'bend': ClipSource(figure, 'bend')}, fade=0.5
    )
    pl = plotter()
    actor = pl.ibr.add_animated(figure, color='tan')
    actor.driver = graph
    pl.ibr.time = 3.0
    before = shot(pl)
    graph.go('bend')  # now
    assert graph.visits(9.0)[-1].begin == 3.0
    pl.ibr.time = 4.0
    after = shot(pl)
    pl.ibr.time = 2.0
    assert differing(before, after) > 100
    assert differing(before, shot(pl)) == 0
    pl.close()


@pytest.mark.parametrize('time', [0.3, 1.0, 1.6, 4.0])
def test_states_choose_key_frames(time):
    states = VertexAnimationStates(
        {'low': FrameRange(0, 2, fps=2.0), 'high': FrameRange(3, 5, fps=2.0)}, fade=1.0
    )
    states.go('high', at=0.75)
    states.go('low', at=1.25)
    body = growing().meshes[0]
    figure = Figure([FigureMesh(body.mesh, frames=replace(body.frames, states=states))])
    apart, seen = beside(figure, time)
    assert apart <= 2
    assert seen > 100


@pytest.mark.parametrize('skinning', ['linear', 'dual'])
def test_corrected_poses(skinning):
    bare = worm()
    pose = bend(bare, 0.5)
    key = Pose(*(part[None] for part in (pose.translation, pose.rotation, pose.scale)))
    points, normals = bare.posed(0, pose, skinning)
    thick = points + 0.2 * normals
    fixed = Figure(
        bare.meshes,
        bare.skeleton,
        correctives=Correctives.from_sculpted(bare, [1, 3], key, thick[None], skinning=skinning),
    )
    np.testing.assert_allclose(fixed.posed(0, pose, skinning)[0], thick, atol=1e-6)
    pictures = []
    for figure, as_mesh in ((fixed, False), (fixed, True), (bare, True)):
        pl = plotter()
        if as_mesh:
            pl.add_mesh(figure.mesh(pose=pose, skinning=skinning), color='tan')
        else:
            pl.ibr.add_animated(figure, color='tan', skinning=skinning).pose = pose
        pictures.append(shot(pl))
        pl.close()
    assert differing(*pictures[:2]) <= 2
    assert differing(*pictures[1:]) > 200


def test_an_order_without_a_fade_is_seen_at_once():
    figure = worm()
    here, there = bend(figure, 0.0), bend(figure, 0.5)
    graph = StateGraph({'here': PoseSource(here), 'there': PoseSource(there)}, fade=0.0)
    pl = plotter()
    actor = pl.ibr.add_animated(figure)
    for driver in (graph, Mixer(graph)):
        actor.driver = driver
        graph.go('there' if graph.state(0.0) == 'here' else 'here', at=0.0)
        expected = there if graph.state(0.0) == 'there' else here
        np.testing.assert_allclose(actor.pose.rotation, expected.rotation)
    pl.close()
