"""States and the ways between them: functions of the time, without jumps."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pvibr.animation.mixer import AnimationLayer, Mixer, PoseSource
from pvibr.animation.pose import Pose
from pvibr.animation.states import StateGraph, Visit
from tests.animation.conftest import refused


class Line:
    """A movement along x, from a place at a speed."""

    def __init__(self, place, speed=0.0, duration=np.inf):
        self.place, self.speed, self.duration = place, speed, duration

    def sample(self, times):
        times = np.asarray(times, dtype=float)
        x = self.place + self.speed * np.clip(times, -np.inf, self.duration)
        return Pose(np.stack([x, 0 * x, 0 * x], -1)[..., None, :])


def x(graph, times):
    return graph.sample(times).translation[..., 0, 0]


def graph(**options):
    states = {'stand': Line(0.0), 'run': Line(10.0, 1.0), 'jump': Line(5.0, -2.0, 1.0)}
    return StateGraph(states, **{'fade': 0.5, **options})


orders = st.lists(
    st.tuples(st.floats(0, 6), st.sampled_from(['stand', 'run', 'jump']), st.floats(0.2, 2)),
    max_size=6,
)


def test_a_fade_goes_from_one_to_the_other():
    walker = graph()
    walker.go('run', at=2.0)
    np.testing.assert_allclose(x(walker, [-1, 0, 2, 2.25, 2.5, 4]), [0, 0, 0, 5.125, 10.5, 12])
    assert [walker.state(t) for t in (-1, 1.9, 2.0, 9)] == ['stand', 'stand', 'run', 'run']
    assert walker.visits(1.0) == [Visit('stand', 0.0, 0.0)]


def test_fades_have_their_own_length_and_may_be_gentle():
    walker = graph(fades={('stand', 'run'): 2.0}, smooth=True)
    walker.go('run', at=0.0)
    walker.go('stand', at=8.0, fade=4.0)
    w = np.array([0.0, 0.25, 0.5, 1.0])
    gentle = w**2 * (3 - 2 * w)
    np.testing.assert_allclose(x(walker, 2 * w), gentle * (10 + 2 * w))
    np.testing.assert_allclose(x(walker, 8 + 4 * w), (1 - gentle) * (18 + 4 * w))


@given(orders)
def test_nothing_jumps(given_orders):
    walker = graph(then={'jump': 'stand'})
    for at, state, fade in given_orders:
        walker.go(state, at, fade)
    times = np.linspace(-1, 10, 11001)
    # 15 m in the shortest fade, and up to 2 m/s beside it.
    assert np.abs(np.diff(x(walker, times))).max() < 0.001 * (16 / 0.2 + 3) * 2


@given(orders, st.permutations(range(12)))
def test_only_the_time_matters(given_orders, permutation):
    walker, again = graph(then={'jump': 'run'}), graph(then={'jump': 'run'})
    for order in sorted(given_orders, key=lambda o: o[0]):
        walker.go(order[1], order[0], order[2])
    times = np.linspace(0, 9, 12)
    whole = x(walker, times)
    # Orders in the middle of play, and times in any order.
    for order in sorted(given_orders, key=lambda o: o[0]):
        x(again, order[0])
        again.go(order[1], order[0], order[2])
    np.testing.assert_array_equal([x(again, times[i]) for i in permutation], whole[permutation])


def test_a_fade_that_is_cut_short_goes_on_below_the_next():
    walker = graph(fade=1.0)
    walker.go('run', at=0.0)
    walker.go('jump', at=0.5)
    t = 0.75
    run = t * (10 + t)
    np.testing.assert_allclose(x(walker, t), 0.75 * run + 0.25 * (5 - 2 * 0.25))


def test_a_movement_that_ends_leads_on():
    walker = graph(then={'jump': 'stand'})
    walker.go('jump', at=1.0)
    assert [v[:2] for v in walker.visits(1.5)] == [('stand', 0), ('jump', 1)]
    assert [v[:2] for v in walker.visits(50)] == [('stand', 0), ('jump', 1), ('stand', 2)]
    np.testing.assert_allclose(x(walker, [2.0, 2.25, 3.0]), [3.0, 1.5, 0.0])


def test_states_may_follow_each_other_for_ever():
    walker = StateGraph(
        {'a': Line(0.0, duration=1.0), 'b': Line(1.0, duration=2.0)},
        fade=0,
        then={'a': 'b', 'b': 'a'},
    )
    np.testing.assert_allclose(x(walker, np.arange(0.5, 9)), [0, 1, 1] * 3)


def test_an_order_for_the_state_that_is_on_changes_nothing():
    walker = graph()
    walker.go('run', at=1.0)
    before = x(walker, np.linspace(0, 5, 50))
    walker.go('run', at=3.0)
    np.testing.assert_array_equal(x(walker, np.linspace(0, 5, 50)), before)


def test_an_order_without_a_time_is_given_now():
    walker = graph(fade=0.0)
    walker.sample([1.0, 3.0])
    walker.go('run')
    np.testing.assert_allclose(x(walker, [2.9, 3.0, 4.0]), [0, 10, 11])


def test_rules_decide_by_parameters():
    walker = graph(
        fade=0.0,
        parameters={'speed': 0.0, 'hurt': False},
        rules=[
            (None, 'stand', lambda p: p['hurt']),
            ('stand', 'run', lambda p: p['speed'] > 2 and not p['hurt']),
            ('run', 'stand', lambda p: p['speed'] < 1),
        ],
    )
    walker.set(at=1.0, speed=1.5)
    walker.set(at=2.0, speed=3.0)
    walker.set(at=3.0, speed=1.5)
    walker.set(at=4.0, speed=0.0)
    walker.set(at=5.0, speed=9.0)
    walker.set(at=6.0, hurt=True)
    seen = [walker.state(t + 0.5) for t in range(7)]
    assert seen == ['stand', 'stand', 'run', 'run', 'stand', 'run', 'stand']


def test_a_rule_holds_on_arrival():
    walker = graph(
        then={'jump': 'stand'},
        parameters={'fast': True},
        rules=[('stand', 'run', lambda p: p['fast'])],
    )
    assert walker.state(0.0) == 'run'
    walker.go('jump', at=1.0)
    assert [v.name for v in walker.visits(9)] == ['stand', 'run', 'jump', 'stand', 'run']
    # A state that is left at once is not seen on the way.
    np.testing.assert_allclose(x(walker, 2.25), (3.0 + 10.25) / 2)


def test_a_movement_may_start_anew_by_a_rule():
    walker = graph(then={'jump': 'stand'}, fade=0.0, rules=[('stand', 'jump', lambda p: True)])
    np.testing.assert_allclose(x(walker, [0.5, 1.5, 7.5]), 4.0)


def test_a_graph_is_a_source_of_poses():
    walker = graph()
    walker.go('run', at=0.0)
    rest = Pose([[0.0, 0.0, 0.0]])
    up = AnimationLayer(PoseSource(Pose([[0.0, 0.0, 1.0]])), reference=rest)
    np.testing.assert_allclose(Mixer(walker, up).sample(3.0).translation, [[13, 0, 1]])


def test_many_times_at_once():
    walker = graph(then={'jump': 'run'})
    walker.go('jump', at=2.0)
    times = np.random.default_rng(0).uniform(-1, 6, (50, 40))
    whole = x(walker, times)
    assert whole.shape == (50, 40)
    np.testing.assert_array_equal(whole[3, 4], x(walker, times[3, 4]))
    assert walker.sample(np.zeros((0, 3))).shape == (0, 3)


def test_bad_input_is_named():
    walker = graph()
    refused(r"state must be one of 'stand', 'run', 'jump', got 'fly'", walker.go, 'fly')
    refused(r'at must .*got nan', walker.go, 'run', at=np.nan)
    refused(r'fade must .*got -1', walker.go, 'run', fade=-1)
    refused(r'times\[0\] must .*got inf', walker.sample, np.inf)
    refused('states must hold at least one state', StateGraph, {})
    refused("state 'run' must be above 0 and finite", graph, then={'run': 'stand'})
    refused("got 'jump' after itself", graph, then={'jump': 'jump'})
    with pytest.raises(ValueError, match='rules must not form a cycle, got stand -> run -> stand'):
        graph(rules=[('stand', 'run', bool), ('run', 'stand', bool)], parameters={'a': 1}).state(0)
