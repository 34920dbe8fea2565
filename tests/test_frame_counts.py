"""What a frame asks of the GPU and of Python, beside what it asked when that was kept.

A number that rises is a cost that was added: find out for what. If it is worth it, or has fallen,
``python -m benchmarks.common.frame_counts`` keeps the new numbers; commit them.
"""

import pytest
import pyvista as pv

from benchmarks.common import frame_counts

pytestmark = pytest.mark.all_sizes  # levels as users have them

#: Versions of Python and PyVista call a few functions more or less.
_SLACK = 1.03


@pytest.mark.parametrize('name', frame_counts.SCENES)
def test_no_cost_has_risen(name):
    kept = frame_counts.kept()[name]
    for what, counts in frame_counts.counted(name).items():
        most = {key: kept[what][key] * (_SLACK if 'calls' in key else 1) for key in counts}
        risen = {key: (kept[what][key], now) for key, now in counts.items() if now > most[key]}
        assert not risen, (what, risen)


def test_waits_and_uploads():
    """No frame waits for a GPU, and nothing is uploaded while nothing moves."""
    for name, moves in frame_counts.kept().items():
        assert {counts['waits'] for counts in moves.values()} == {0}, name
        assert moves['nothing']['uploaded_bytes'] == 0, name


def test_the_scenes_that_are_kept_are_those_that_are_counted():
    assert list(frame_counts.kept()) == list(frame_counts.SCENES)


#: Most Python calls of a frame that pvibr promises.
PROMISED = {
    ('10 000 instances', 'camera'): 1_500,
    ('25 sets of 100', 'camera'): 8_000,
    ('crowd of 400', 'time'): 4_000,
    ('crowd of 400', 'camera'): 3_000,
}


@pytest.mark.parametrize(('name', 'what'), PROMISED)
def test_python_calls(name, what):
    assert frame_counts.kept()[name][what]['Python calls'] <= PROMISED[name, what]


def test_counts_are_those_of_the_last_frame():
    pl = pv.Plotter(off_screen=True, window_size=(300, 200))
    frame_counts.SCENES['5 000 spheres'](pl)
    pl.show(auto_close=False)
    for _ in range(2):
        pl.camera.Azimuth(1.0)
        pl.render()
        first, text = pl.ibr.report().counts, str(pl.ibr.report())
    assert first.draws >= 1
    assert f'last frame: {first.draws} draws' in text
    pl.camera.Azimuth(1.0)
    pl.render()
    assert pl.ibr.report().counts == first
    assert pl.ibr.report().as_dict()['counts'] == vars(first)


def test_a_cost_is_counted():
    """Drawing the same set twice doubles its draws."""
    counts = []
    for set_count in (1, 2):
        pl = pv.Plotter(off_screen=True, window_size=(300, 200))
        for k in range(set_count):
            pl.ibr.add_spheres([[0, 0, k], [1, 0, k]], 0.5)
        pl.show(auto_close=False)
        pl.camera.Azimuth(1.0)
        calls = frame_counts.calls_in(pl.render)
        counts.append((calls, pl.ibr.report().counts.draws))
    (calls, draws), (calls_of_two, draws_of_two) = counts
    assert draws_of_two == 2 * draws
    assert calls_of_two > calls
