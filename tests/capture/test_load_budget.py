"""Where triangles are known before a frame is drawn, its quality follows from them."""

import itertools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pvibr.capture.load_budget import LEVELS, LoadBudget

MS = 50.0


def triangles(count):
    """Return the triangles of a mesh by quality, full of detail at 1."""
    return lambda quality: count * (8 if quality == 1 else quality**2)


def drive(budget, count, frames, *, fixed=15.0, each=2e-4):
    """Draw moving frames that cost something each, and for triangles; return qualities, times."""
    seen = []
    for _ in range(frames):
        quality = budget.choose(MS, triangles(count))
        seen.append((quality, fixed + each * triangles(count)(quality)))
        budget.drawn(seen[-1][1])
    return np.transpose(seen)


@given(st.floats(1e4, 3e6), st.floats(0, 30), st.floats(2e-6, 3e-4))
def test_it_meets_the_time_with_the_least_error(count, fixed, each):
    budget = LoadBudget()
    budget.rested(2 * fixed + 3 * each * triangles(count)(1), triangles(count))
    qualities, times = drive(budget, count, 100, fixed=fixed, each=each)
    assert np.ptp(qualities[60:]) == 0  # it does not swing
    assert np.mean(times > 1.5 * MS) <= 0.05
    level = LEVELS.index(qualities[-1])
    if level > 1:
        finer = fixed + each * triangles(count)(LEVELS[level - 1])
        assert finer > 0.8 * MS


def test_one_slow_frame_changes_little():
    budget = LoadBudget()
    budget.rested(400.0, triangles(4e5))
    qualities, _ = drive(budget, 4e5, 40)
    budget.choose(MS, triangles(4e5))
    budget.drawn(100 * MS)
    after, _ = drive(budget, 4e5, 40)
    assert after.min() > 0.8 * qualities[-1]
    assert after[-1] == qualities[-1]


def test_a_first_frame_that_compiles_lowers_nothing():
    budget = LoadBudget()
    budget.rested(400.0, triangles(4e5))
    quality = budget.choose(MS, triangles(4e5))
    budget.drawn(1.2 * MS)
    assert budget.choose(MS, triangles(4e5)) == quality


def test_what_comes_near_is_met_before_it_is_drawn():
    budget = LoadBudget()
    budget.rested(400.0, triangles(2e5))
    drive(budget, 2e5, 20)
    assert max(drive(budget, 2e6, 1)[1]) < 1.5 * MS


def test_where_less_is_no_faster_it_is_not_coarse():
    budget = LoadBudget()
    budget.rested(400.0, triangles(1e4))
    qualities, _ = drive(budget, 1e4, 200, fixed=200.0, each=1e-6)
    assert np.mean(qualities > 0.8) > 0.7


def test_at_rest_it_is_finer_step_by_step():
    budget = LoadBudget()
    budget.rested(400.0, triangles(5e5))
    seen = [drive(budget, 5e5, 10)[0][-1]]
    while seen[-1] < 1:
        seen.append(budget.finer(triangles(5e5)))
        budget.drawn(100.0)
    counts = [triangles(5e5)(quality) for quality in seen[:-1]]
    assert seen == sorted(seen)
    assert 3 < len(seen) < len(LEVELS)
    assert all(b <= 2.9 * a for a, b in itertools.pairwise(counts))


@pytest.mark.parametrize('level', range(len(LEVELS) - 1))
def test_levels_are_sorted(level):
    assert LEVELS[level] > LEVELS[level + 1]
