import json

import numpy as np
import pytest

from benchmarks.common import comparison
from benchmarks.common.comparison import compare, is_no_worse, read_run, table
from benchmarks.common.harness import Results, Row


def run(seed, slower=1.0, *, error=0.02, sharpness=0.97, pairs=15, **settings):
    """Return a run of noisy frames, at a pace of its own, as its file holds it."""
    rng = np.random.default_rng(seed)
    pace = rng.uniform(0.5, 2)  # of the machine that day
    without = pace * 0.1 * np.exp(rng.normal(0, 0.1, (pairs, 1))) * [2, 1]
    noise = np.exp(rng.normal(0, 0.03, (pairs, 2)))
    times = {'without': without.tolist(), 'with': (0.7 * slower * without * noise).tolist()}
    rows = [
        Row('FLIP', error, '', 0.1),
        Row('sharpness', sharpness, '', 0.9, at_least=True),
        Row('a frame', pace, 'ms', 1e3),
        Row('frames that are late', 2 * pace, '%', 2, follows_times=True),
        Row('triangles', 100 * pace),
    ]
    results = Results('llvmpipe', {'quick': False, **settings}, rows, {}, {'trees': {8: times}})
    return json.loads(results.to_json())


def test_results_are_compared_as_their_file_is():
    frames = {'trees': {8: {'with': [(2.0, 1.0)] * 3, 'without': [(1.0, 1.0)] * 3}}}
    settings = {'quick': True, 'size': (160, 90)}
    results = Results('llvmpipe', settings, [Row('FLIP', 0.03, '', 0.1)], {}, frames)
    assert is_no_worse(json.loads(results.to_json()), results.as_dict())
    assert len(compare(json.loads(results.to_json()), results.as_dict())) == 3


def verdicts(*runs):
    return {change.name: change.verdict for change in compare(*runs)}


@pytest.mark.parametrize('seed', range(20))
def test_two_runs_of_the_same_are_the_same(seed):
    assert {*verdicts(run(seed), run(seed + 100)).values()} == {'same'}


@pytest.mark.parametrize('seed', range(20))
def test_a_planted_slowdown_is_found(seed):
    found = verdicts(run(seed), run(seed + 100, slower=1.2))
    assert {name for name, verdict in found.items() if verdict == 'worse'} == {
        'trees, 8 samples, CPU',
        'trees, 8 samples, wall',
    }


@pytest.mark.parametrize(('error', 'sharpness'), [(0.024, 0.97), (0.02, 0.97 / 1.2)])
def test_a_planted_error_is_found(error, sharpness):
    found = verdicts(run(1), run(2, error=error, sharpness=sharpness))
    assert [*found.values()].count('worse') == 1
    assert not is_no_worse(run(1), run(2, error=error, sharpness=sharpness))
    assert is_no_worse(run(2, error=error, sharpness=sharpness), run(1))


def test_what_got_better_is_shown():
    changes = compare(run(1, slower=1.5), run(2))
    assert [change.verdict for change in changes] == ['better', 'better', 'same', 'same']
    assert table(changes).row_count == 2


def test_other_settings_are_refused():
    with pytest.raises(ValueError, match='compare must be a run with frames=30, got 60'):
        compare(run(1, frames=60), run(2, frames=30))


@pytest.mark.parametrize('text', ['', '{}', '[1]', '{"rows": []}'])
def test_other_files_are_refused(text, tmp_path):
    path = tmp_path / 'bench.json'
    path.write_text(text)
    with pytest.raises(ValueError, match='compare must be a file that a bench has written'):
        read_run(path)
    with pytest.raises(ValueError, match='compare must be a file'):
        read_run(tmp_path / 'missing.json')


def test_errors_of_quick_runs_are_kept_and_compared(tmp_path, monkeypatch):
    monkeypatch.setattr(comparison, '_KEPT', tmp_path / 'kept.json')
    (tmp_path / 'bench_trees.json').write_text(json.dumps(run(1)))
    assert comparison.main(tmp_path, keep=True)
    assert [
        row['name'] for row in json.loads((tmp_path / 'kept.json').read_text())['bench_trees']
    ] == [
        'FLIP',
        'sharpness',
    ]
    assert comparison.main(tmp_path)
    (tmp_path / 'bench_trees.json').write_text(json.dumps(run(1, error=0.024)))
    assert not comparison.main(tmp_path)
