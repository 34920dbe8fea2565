"""Running means follow, and pauses grow and shrink."""

from pvibr.core.costs import Backoff, RunningMean


def test_a_running_mean_follows_values():
    mean = RunningMean(weight=0.5)
    assert mean.add(4.0) == 2.0
    assert mean.add(4.0) == 3.0
    assert mean.add(7.0, weight=1.0) == mean.value == 7.0


def test_a_pause_grows_with_each_trial_in_vain():
    pause = Backoff(4, 10)
    assert not pause.waits()
    for length in (4, 10, 10):
        pause.failed()
        assert [pause.waits() for _ in range(length + 1)] == [True] * length + [False]


def test_a_success_makes_the_next_pause_shorter():
    pause = Backoff(4, 64)
    pause.failed()
    for _ in range(3):
        pause.succeeded()
    pause.failed()
    assert pause.left == 6
    for _ in range(9):
        pause.succeeded()
    pause.failed()
    assert pause.left == 4
