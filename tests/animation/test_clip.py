"""Keys, what lies between them, and loops."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.interpolate import CubicHermiteSpline
from scipy.spatial.transform import Rotation, Slerp

from pvibr.animation import Clip, Pose, Track
from pvibr.maths import quaternions
from tests.animation.conftest import refused

SEEDS = st.integers(0, 2**32 - 1)
STILL = Pose(np.zeros((2, 3)), weights=[0.1, 0.2, 0.3])


def keys(rng, k=5):
    return np.cumsum(rng.uniform(0.1, 1.0, k))


@given(SEEDS)
def test_linear_tracks_are_numpys(seed):
    rng = np.random.default_rng(seed)
    times, values = keys(rng), rng.normal(size=(5, 3))
    at = rng.uniform(-1, 6, (4, 3))
    found = Track(0, 'translation', times, values).sample(at)
    expected = np.stack([np.interp(at, times, v) for v in values.T], -1)
    assert np.allclose(found, expected)


@given(SEEDS)
def test_rotations_are_scipys_slerp(seed):
    rng = np.random.default_rng(seed)
    times, values = keys(rng), rng.normal(size=(5, 4))
    at = rng.uniform(times[0], times[-1], 7)
    found = Track(0, 'rotation', times, values).sample(at)
    turns = Slerp(times, Rotation.from_quat(np.roll(values, -1, 1)))(at).as_matrix()
    assert np.allclose(quaternions.to_matrices(found), turns, atol=1e-7)


@given(SEEDS)
def test_cubic_tracks_are_scipys_hermite_spline(seed):
    """With one tangent per key; the two of a key may differ, see below."""
    rng = np.random.default_rng(seed)
    times, values, tangents = keys(rng), rng.normal(size=(5, 3)), rng.normal(size=(5, 3))
    at = rng.uniform(times[0], times[-1], 7)
    track = Track(0, 'scale', times, np.stack([tangents, values, tangents], 1), 'cubic')
    assert np.allclose(track.sample(at), CubicHermiteSpline(times, values, tangents)(at))


def test_the_two_tangents_of_a_key_are_in_and_out():
    values = np.zeros((2, 3, 1))
    values[0, 2], values[1, 0] = 1.0, 5.0  # leaves the first, reaches the second
    track = Track(0, 'weights', [0.0, 2.0], values, 'cubic')
    near = track.sample([1e-6, 2 - 1e-6])[:, 0]
    assert np.allclose(near, [1e-6, -5e-6], rtol=1e-4)


def test_cubic_rotations_have_length_one():
    rng = np.random.default_rng(0)
    track = Track(0, 'rotation', [0, 1, 2], rng.normal(size=(3, 3, 4)), 'cubic')
    assert np.allclose(np.linalg.norm(track.sample(np.linspace(0, 2, 9)), axis=1), 1)


def test_steps_hold_until_the_next_key():
    track = Track(0, 'weights', [1.0, 2.0], [[5.0], [6.0]], 'step')
    assert track.sample([0.0, 1.0, 1.999, 2.0, 9.0])[:, 0].tolist() == [5, 5, 5, 6, 6]


@pytest.mark.parametrize('how', ['step', 'linear', 'cubic'])
def test_one_key_is_held(how):
    value = np.full((1, 3, 3), 2.0) if how == 'cubic' else [[2.0] * 3]
    assert Track(0, 'scale', [1.0], value, how).sample([0, 1, 2]).tolist() == [[2.0] * 3] * 3


def test_many_times_give_many_poses():
    clip = Clip(
        'x',
        [
            Track(1, 'translation', [0, 1], [[0, 0, 0], [1, 0, 0]]),
            Track(1, 'weights', [0, 1], [[0, 0], [4, 8]]),
        ],
    )
    poses = clip.sample(np.array([[0.0, 0.25], [0.5, 0.75]]), STILL)
    assert poses.shape == (2, 2)
    assert poses.translation[1, 0].tolist() == [[0, 0, 0], [0.5, 0, 0]]
    assert poses.weights[0, 1].tolist() == [0.1, 1, 2]
    assert poses[1][0].weights.tolist() == [0.1, 2, 4]
    assert poses.time.tolist() == [[0.0, 0.25], [0.5, 0.75]]


@given(SEEDS)
def test_tracks_are_the_same_together_and_alone(seed):
    """A clip evaluates tracks with the same keys at once."""
    rng = np.random.default_rng(seed)
    widths = {'translation': 3, 'rotation': 4, 'scale': 3}
    times = [keys(rng), keys(rng)]
    tracks = []
    for _ in range(12):
        path, how = rng.choice(list(widths)), rng.choice(['step', 'linear', 'cubic'])
        shape = (5, 3, widths[path]) if how == 'cubic' else (5, widths[path])
        tracks.append(
            Track(rng.integers(3), path, times[rng.integers(2)], rng.normal(size=shape), how)
        )
    at = rng.uniform(0, 4, (2, 3))
    poses = Clip('x', tracks, 9.0).sample(at, Pose(np.zeros((3, 3))))
    for track in {(t.node, t.path): t for t in tracks}.values():
        found = getattr(poses, track.path)[..., track.node, :]
        assert np.allclose(found, track.sample(at), atol=1e-12)


def test_a_clip_loops_or_ends():
    clip = Clip('x', [Track(0, 'translation', [0, 2], [[0, 0, 0], [2, 0, 0]])])
    at = [-0.5, 0.5, 2.5]
    assert clip.sample(at, STILL).translation[:, 0, 0].tolist() == [1.5, 0.5, 0.5]
    assert clip.sample(at, STILL, loop=False).translation[:, 0, 0].tolist() == [0, 0.5, 2]
    assert Clip('x', clip.tracks, duration=3).sample(2.5, STILL).translation[0, 0] == 2


@pytest.mark.parametrize(
    ('arguments', 'words'),
    [
        (('turn', [0], [[0] * 3]), r"path must be one of 'translation'.*got 'turn'"),
        (('scale', [0], [[0] * 3], 'quad'), r"interpolation must .*got 'quad'"),
        (('scale', [], np.zeros((0, 3))), r'times must have shape'),
        (
            ('scale', [0, 2, 1], np.ones((3, 3))),
            r'times must increase, got 1.0 after 2.0 at times\[2\]',
        ),
        (('scale', [0, 0], np.ones((2, 3))), r'times must increase'),
        (('scale', [np.nan], np.ones((1, 3))), r'times\[0\] must .*got nan'),
        (('scale', [0], np.ones((1, 4))), r'must have shape \(1, 3\), got \(1, 4\)'),
        (('scale', [0], np.ones((1, 3)), 'cubic'), r'must have shape \(1, 3, 3\)'),
        (('scale', [0], [[1, np.inf, 1]]), r'values\[0, 1\].* finite'),
        (('rotation', [0, 1], [[1, 0, 0, 0], [0] * 4]), 'quaternion'),
    ],
)
def test_unusable_tracks_are_named(arguments, words):
    refused(words, Track, 0, *arguments)


def test_tracks_refuse_negative_nodes():
    refused('node must be 0 or more, got -1', Track, -1, 'scale', [0], [[1] * 3])


def test_clips_refuse_what_the_figure_lacks():
    with pytest.raises(ValueError, match="joints of clip 'x' must be below 2, got 2"):
        Clip('x', [Track(2, 'scale', [0], [[1] * 3])]).sample(0, STILL)
    with pytest.raises(ValueError, match="weights of clip 'x' must be below 3, got 3"):
        Clip('x', [Track(2, 'weights', [0], [[1, 1]])]).sample(0, STILL)
    refused('duration', Clip, 'x', [], -1)
