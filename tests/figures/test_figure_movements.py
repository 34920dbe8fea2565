"""Movements that are put together, in a scene: pictures beside those of posed meshes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import pyvista as pv

from pvibr import Figure
from pvibr.animation import (
    AnimationLayer,
    ClipSource,
    Correctives,
    FigureMesh,
    FrameRange,
    Mixer,
    PoseSource,
    Skeleton,
    StateGraph,
    VertexAnimationStates,
    joint_mask,
)
from pvibr.animation.pose import Pose
from tests.figures.makers import JOINTS, bend, bending, growing, worm
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


class _Matrices:
    """A simulator, which mirrors."""

    def sample(self, time):
        return np.tile(np.diag([-1.0, 1, 1, 1]), (JOINTS, 1, 1)) + time * np.eye(4, k=3)


class _Breaks:
    def sample(self, time):
        if time:
            raise RuntimeError
        return Pose(np.zeros((JOINTS, 3)))


def test_figures_posed_together_are_where_each_is_alone():
    """Unlike ones: skinned by both ways, rigid, morphed, of key frames, of matrices."""
    rng = np.random.default_rng(11)
    wheel = Skeleton([-1, 0], Pose([[0, 0, 1.0], [1, 0, 0]], scale=[[1, 1, 1], [1, -1, 1]]))
    figures = [worm(5.0 * i, clips=[bending(rng.uniform(1, 3))]) for i in range(3)]
    figures += [Figure([FigureMesh(pv.Disc(), node=1)], wheel, [bending()]), growing()]
    figures += [worm(n_morphs=2, clips=[bending()]), worm(clips=[bending()]), worm(), worm()]
    pl = pv.Plotter(off_screen=True)
    actors = [pl.ibr.add_animated(figure) for figure in figures]
    actors[1].skinning = 'dual'
    actors[6].play(loop='pingpong', speed=0.7)
    actors[7].driver, actors[8].driver = _Matrices(), _Breaks()
    for time in (0.4, 1.7):
        pl.ibr.time = time
        for figure, actor in zip(figures[:8], actors, strict=False):
            pose, shown = actor.driver.sample(time), actor._moment
            np.testing.assert_allclose(shown.world, figure.world(pose), atol=1e-12)
            np.testing.assert_array_equal(shown.signs, np.sign(np.linalg.det(shown.world)))
            bounds = figure.bounds(pose, actor.skinning)
            np.testing.assert_allclose(actor.bounds, bounds, atol=3e-5)
    pl.close()
