"""States of key-framed meshes: ways from what is shown to the first frame of the next."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pvibr.animation.vertex_animation import VertexAnimation
from pvibr.animation.vertex_animation_states import FrameRange, VertexAnimationStates
from tests.animation.conftest import refused

orders = st.lists(
    st.tuples(st.floats(0, 6), st.sampled_from(['stand', 'run', 'fall']), st.floats(0.2, 2)),
    max_size=6,
)


def soldier(**options):
    ranges = {
        'stand': FrameRange(0, 9, fps=10.0),
        'run': FrameRange(10, 15, fps=6.0),
        'fall': FrameRange(16, 20, fps=4.0, loop=False),
    }
    return VertexAnimationStates(ranges, **{'fade': 1.0, **options})


def shown(states, times, values=None):
    """Return the weighted sum of the frames' values: by default their numbers."""
    indices, weights = states.at(times)
    values = np.arange(21.0) if values is None else values
    return (values[indices] * weights).sum(-1)


def test_frames_are_blended_from_what_is_shown_to_the_first_of_the_next():
    states = soldier()
    states.go('run', at=0.45)  # half way from frame 4 to frame 5
    w = np.linspace(0, 1, 11)
    np.testing.assert_allclose(shown(states, 0.45 + w), (1 - w) * 4.5 + w * 10)
    # There it begins with its first frame.
    np.testing.assert_allclose(shown(states, 1.45 + 0.25), 11.5)
    np.testing.assert_allclose(shown(soldier(), [-0.05, 0.95]), [4.5, 4.5])  # from 9 back to 0


def test_a_way_that_is_cut_short_stays_as_it_is_below_the_next():
    states = soldier()
    states.go('run', at=0.45)
    states.go('fall', at=0.95)
    at_the_order = 0.5 * 4.5 + 0.5 * 10
    w = np.linspace(0, 1, 11)
    np.testing.assert_allclose(shown(states, 0.95 + w), (1 - w) * at_the_order + w * 16)
    assert states.at(1.0)[0].shape == (6,)
    assert states.at(5.0)[0].shape == (2,)


@given(orders, st.sampled_from(['linear', 'quadratic', 'cubic']))
def test_frames_do_not_jump(given_orders, interpolation):
    states = soldier(then={'fall': 'stand'}, interpolation=interpolation)
    for at, state, fade in given_orders:
        states.go(state, at, fade)
    values = np.random.default_rng(4).uniform(size=21)
    times = np.linspace(-1, 10, 11001)
    assert np.abs(np.diff(shown(states, times, values))).max() < 0.03
    np.testing.assert_allclose(states.at(times)[1].sum(-1), 1)


def test_frames_of_a_state_that_ends_lead_on():
    states = soldier(then={'fall': 'stand'}, start='fall')
    np.testing.assert_allclose(shown(states, [0.5, 1.0, 1.5, 2.0]), [18, 20, 10, 0])
    assert states.last == 20
    assert FrameRange(3, 3).at(0.7)[0].tolist() == [3, 3]


def test_frames_of_a_mesh_are_chosen_by_states():
    positions = np.arange(21.0)[:, None, None] * np.ones((21, 2, 3))
    states = soldier()
    frames = VertexAnimation(np.arange(21), positions, states=states)
    states.go('run', at=0.45)
    points, _ = frames.sample([0.45, 0.95])
    np.testing.assert_allclose(points[..., 0], [[4.5, 4.5], [7.25, 7.25]])
    with pytest.raises(ValueError, match='states must use frames below 20, got 20'):
        VertexAnimation(np.arange(20), positions[:20], states=states)


def test_bad_input_is_named():
    refused('first must be from 0 to last, 4, got 5', FrameRange, 5, 4)
    refused(r'fps must .*got 0', FrameRange, 0, 4, fps=0)
    refused(r"interpolation must .*got 'septic'", soldier, interpolation='septic')
