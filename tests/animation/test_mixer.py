"""Movements that are put together: functions of the time alone."""

import numpy as np
import pytest
import pyvista as pv
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import quad

from pvibr.animation.blending import joint_mask
from pvibr.animation.clip import Clip, Track
from pvibr.animation.curves import Curve
from pvibr.animation.figure import Figure
from pvibr.animation.figure_mesh import FigureMesh
from pvibr.animation.mixer import AnimationLayer, ClipSource, Mixer, PoseSource, SyncedClips
from pvibr.animation.pose import Pose
from pvibr.animation.skeleton import Skeleton
from pvibr.maths import quaternions
from tests.animation.conftest import refused

REST = Pose(np.array([[0.0, 0, 0], [0, 0, 1], [0, 0, 1]]))


def swing(name, seconds, degrees, joint=0):
    """Return a clip that turns a joint to and fro about x, and starts forward."""
    phase = np.linspace(0, 1, 9)
    angles = np.radians(degrees) * np.cos(2 * np.pi * phase)
    turns = quaternions.from_axis_angle([1, 0, 0], angles)
    return Clip(name, [Track(joint, 'rotation', phase * seconds, turns)])


def figure():
    clips = [swing('walk', 1.0, 30), swing('run', 0.6, 60), swing('fire', 0.5, 45, joint=1)]
    return Figure(
        [FigureMesh(pv.Cube())], Skeleton([-1, 0, 1], REST, ['hip', 'spine', 'head']), clips
    )


def turned(pose, joint):
    """Return the angle of a joint about x in degrees."""
    return np.degrees(quaternions.log(pose.rotation)[..., joint, 0])


def test_playing_is_sampling_at_another_time():
    fox = figure()
    play = ClipSource(fox, 'run', speed=2.0, offset=0.1)
    np.testing.assert_allclose(
        play.sample([0.0, 0.2]).rotation, fox.sample([0.1, 0.5], 'run').rotation
    )
    assert play.duration == pytest.approx(0.3)
    once = ClipSource(fox, 'run', loop=False).sample(99.0)
    np.testing.assert_allclose(once.rotation, fox.sample(0.6, 'run', loop=False).rotation)
    assert ClipSource(figure(), 'walk', speed=0.0).duration == np.inf


@pytest.mark.parametrize('speed', [1.0, -2.0])
def test_a_root_gets_somewhere(speed):
    fox = figure()
    step = Clip('step', [Track(0, 'translation', [0, 1, 2], [[1, 0, 0], [2, 0, 1], [5, 0, 0]])])
    fox = Figure(fox.meshes, fox.skeleton, [step])
    walk = ClipSource(fox, 'step', speed=speed, root='hip')
    times = np.linspace(-5, 5, 1001)
    places = walk.sample(times).translation[:, 0]
    steps = np.diff(places[:, 0]) / (0.01 * speed)
    assert steps.min() > 0.99  # 1 m/s at first, then 3, and never back
    assert steps.max() < 3.01
    np.testing.assert_allclose(places[600] - places[200], [8 * speed, 0, 0], atol=1e-9)
    stays = ClipSource(fox, 'step', speed=speed).sample(times).translation[:, 0]
    np.testing.assert_allclose(places[:, 1:], stays[:, 1:])
    assert stays[:, 0].max() <= 5


def test_run_and_fire_and_look_up():
    fox = figure()
    upper = joint_mask(fox.skeleton, ['spine'])
    up = Pose(
        REST.translation,
        quaternions.from_axis_angle([1, 0, 0], np.radians([[0], [0], [20]]))[:, 0],
    )
    mixer = Mixer(
        ClipSource(fox, 'run'),
        AnimationLayer(ClipSource(fox, 'fire'), Curve([0.0, 1.0], [1.0, 2.0]), upper),
        AnimationLayer(PoseSource(up), 0.5, reference=REST),
    )
    times = np.linspace(0, 4, 41)
    pose = mixer.sample(times)
    np.testing.assert_allclose(turned(pose, 0), turned(fox.sample(times, 'run'), 0), atol=1e-9)
    np.testing.assert_allclose(turned(pose, 1)[:11], 0, atol=1e-9)
    fire = turned(fox.sample(times, 'fire'), 1)
    np.testing.assert_allclose(turned(pose, 1)[20:], fire[20:], atol=1e-9)
    np.testing.assert_allclose(turned(pose, 1)[15], fire[15] / 2, atol=1)
    np.testing.assert_allclose(turned(pose, 2), 10, atol=1e-9)


@given(st.lists(st.floats(-5, 5), min_size=1, max_size=6))
def test_only_the_time_matters(times):
    fox = figure()
    mixer = Mixer(
        SyncedClips(fox, ['walk', 'run'], [[1, 0], [0, 1]], [0, 2]),
        AnimationLayer(ClipSource(fox, 'fire'), Curve([0, 1, 0.5], [0, 1, 2])),
    )
    whole = mixer.sample(times)
    for i in np.argsort(times)[::-1]:
        np.testing.assert_allclose(mixer.sample(times[i]).rotation, whole.rotation[i], atol=1e-12)


def test_movements_in_step_have_the_same_phase():
    fox = figure()
    gait = SyncedClips(fox, ['walk', 'run'], [0.5, 0.5])
    times = np.linspace(0, 3, 50)
    rounds = times * (1 / 1.0 + 1 / 0.6) / 2
    np.testing.assert_allclose(gait.phase(times), rounds)
    parts = [turned(fox.sample(rounds * s, c), 0) for c, s in (('walk', 1.0), ('run', 0.6))]
    np.testing.assert_allclose(turned(gait.sample(times), 0), np.mean(parts, axis=0), atol=1e-6)
    # Out of step the two would cancel each other at times; in step they reach 45 degrees.
    assert turned(gait.sample(np.linspace(0, 3, 999)), 0).max() > 44.9


@given(st.lists(st.floats(0, 1), min_size=2, max_size=5), st.floats(-2, 8))
def test_the_phase_is_the_integral_of_the_rate(shares, time):
    keys = np.arange(len(shares)) * 1.5
    gait = SyncedClips(
        figure(), ['walk', 'run'], np.column_stack([shares, 1 - np.array(shares)]), keys
    )
    rate = np.array(shares) + (1 - np.array(shares)) / 0.6
    exact = quad(lambda t: np.interp(t, keys, rate), 0, time, points=keys, limit=200)[0]
    assert gait.phase(time) == pytest.approx(exact, abs=1e-6)


def test_movements_stay_in_step_while_shares_change():
    fox = figure()
    gait = SyncedClips(fox, ['walk', 'run'], [1, 0])
    gait.go([0, 1], at=1.0, fade=0.5)
    gait.go([1, 1], at=1.25, fade=0.5)
    times = np.linspace(0, 4, 4001)
    angles = turned(gait.sample(times), 0)
    assert np.abs(np.diff(angles)).max() < 1.2  # 60 degrees to and fro in 0.6 s: 0.63 each
    assert np.abs(np.diff(gait.phase(times))).max() < 0.001 / 0.6 + 1e-9
    np.testing.assert_allclose(gait.phase(1.0), 1.0)
    np.testing.assert_allclose(gait.weights.at([0.5, 1.25, 9.0])[:, 1], [0, 0.5, 0.5])


def test_one_clip_alone_is_that_clip():
    fox = figure()
    times = np.linspace(0, 2, 30)
    alone = SyncedClips(fox, ['walk', 'run'], [0, 3]).sample(times)
    np.testing.assert_allclose(
        np.abs((alone.rotation * fox.sample(times, 'run').rotation).sum(-1)), 1, atol=1e-12
    )


def test_a_crowd_is_one_call():
    fox = figure()
    mixer = Mixer(ClipSource(fox, 'walk'), AnimationLayer(ClipSource(fox, 'fire'), 0.5, [0, 1, 1]))
    times = np.random.default_rng(0).uniform(0, 9, (100, 100))
    pose = mixer.sample(times)
    assert pose.shape == (100, 100)
    np.testing.assert_allclose(pose.rotation[7, 8], mixer.sample(times[7, 8]).rotation)


def test_bad_input_is_named():
    fox, rest = figure(), PoseSource(REST)
    refused(r"clip must .*'walk'.* got 'fly'", ClipSource, fox, 'fly')
    refused(r'weight must be from 0 to 1, got 2\.0', AnimationLayer, rest, 2.0)
    refused(r'values\[0\] must .*got nan', AnimationLayer, rest, np.nan)
    with pytest.raises(ValueError, match=r'values must be \(3, ...\), got \(1, 2\)'):
        SyncedClips(fox, ['walk', 'run'], [0.5, 0.5], [0, 1, 2])
    with pytest.raises(ValueError, match=r'weights must have shape \(..., 2\), got \(1, 1\)'):
        SyncedClips(fox, ['walk', 'run'], [0.5])
    with pytest.raises(ValueError, match=r'weights must have shape \(2,\), got \(3,\)'):
        SyncedClips(fox, ['walk', 'run'], [0.5, 0.5]).go([1, 1, 1], 2.0)
    still = Figure(fox.meshes, fox.skeleton, [Clip('still', [])])
    refused("'still' must have a duration above 0", SyncedClips, still, ['still'], [1.0])
