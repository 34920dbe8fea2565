import json
from dataclasses import asdict
from types import SimpleNamespace

import numpy as np
import pytest

from pvibr.bench import SURVEYS, main
from pvibr.bench.common.harness import Results
from pvibr.bench.instances import survey
from pvibr.bench.instances.unseen_meshes import KINDS, unseen
from pvibr.meshes.parts import are_parts


def points_of(parts):
    return np.concatenate([np.asarray(part.mesh.points) for part in parts])


def test_meshes_are_those_of_their_seed():
    few = (2_000, 4_000)
    first, same, other = ({n: points_of(m()) for n, m in unseen(s, few)} for s in (1, 1, 2))
    assert list(first) == list(KINDS)
    assert all(np.array_equal(first[n], same[n]) for n in KINDS)
    assert not any(np.array_equal(first[n], other[n]) for n in KINDS)
    assert all(np.isfinite(points).all() for points in first.values())


@pytest.mark.parametrize('name', KINDS)
def test_meshes_have_about_the_triangles_asked_for(name):
    parts = dict(unseen(3, (20_000, 20_001)))[name]()
    assert are_parts(parts)
    assert 10_000 <= sum(part.mesh.n_cells for part in parts) <= 40_000


def test_fields_are_those_of_their_seed_and_overlap():
    make = dict(unseen(1, (2_000, 3_000)))['soup']
    scenes = [survey.field_of('soup', make, 100, seed) for seed in (1, 1, 2)]
    assert np.array_equal(scenes[0].poses, scenes[1].poses)
    assert scenes[0].cameras == scenes[1].cameras
    assert not np.array_equal(scenes[0].poses, scenes[2].poses)
    for eye, elevation in zip(scenes[0].cameras, survey.ELEVATIONS, strict=True):
        assert np.isclose(np.degrees(np.arcsin(eye[0][2] / np.linalg.norm(eye[0]))), elevation)


def found(name, ours, flip):
    ms = {f'{way}, {n}': ours for way in ('ours', 'coarse', 'cards') for n in (0, 8)}
    flips = {f'{way}, {n}': [0.5, flip] for way in ('ours', 'coarse', 'cards') for n in (0, 8)}
    return survey.Found(name, 9, [1.0, 0.1], ms={**ms, 'peer, 0': 100.0}, flip=flips)


def test_the_worst_mesh_comes_first(tmp_path):
    bench = survey.survey(5)
    points = [asdict(f) for f in (found('bad', 50.0, 0.9), found('good', 1.0, 0.9))]
    results = Results('a driver', {'quick': True}, points={'survey': points})
    results.rows.extend(survey.rows([survey.Found(**f) for f in points]))
    rows = {row.name: row.value for row in results.rows}
    assert np.isclose(rows['over VTK, geometric mean'], np.sqrt(2 * 100))
    assert rows['over VTK, least'] == 2
    assert rows["FLIP over the meshes', 0 samples per pixel, worst"] == 0.9
    bench.write('survey', results, tmp_path)
    text = (tmp_path / 'bench_survey.txt').read_text(encoding='utf-8')
    assert text.index('bad') < text.index('good')
    kept = json.loads((tmp_path / 'bench_survey.json').read_text(encoding='utf-8'))
    assert kept['points']['survey'][0]['name'] == 'bad'


def test_what_cannot_be_measured_is_a_row_and_the_others_are_measured(monkeypatch, capsys):
    def measured(name, make, settings, seed):
        if name == 'gear, split edges':
            survey.spheres([make()], np.eye(4), [0])  # poses are (n, 4, 4)
        return found(name, 2.0, 0.9)

    monkeypatch.setattr(survey, 'measured', measured)
    bench = survey.survey(5)
    results = Results('a driver', {'quick': True})
    rows = {row.name: row for row in bench.parts['survey'](bench.extent(quick=True), results)}
    assert not rows['meshes that could not be measured'].ok
    assert rows['over VTK, least'].value == 50
    first, *others = results.points['survey']
    assert (first['name'], len(others)) == ('gear, split edges', 2)
    assert 'IndexError: too many indices' in first['error']
    assert 'offscreen.py' in first['error']
    assert not any(f['error'] for f in others)
    told = capsys.readouterr().err
    assert all(f['name'] in told for f in results.points['survey'])


def test_a_bench_without_a_survey_says_so():
    assert SURVEYS == ('instances',)
    with pytest.raises(ValueError, match='instances'):
        main('moving', survey=1)


@pytest.mark.bench
def test_a_small_survey_runs():
    settings = SimpleNamespace(instances=20, frames=1, peer_frames=1)
    make = dict(unseen(1, (2_000, 2_500)))['textured']
    found = survey.measured('textured', make, settings, 1)
    assert len(found.flip['ours, 0']) == len(survey.ELEVATIONS)
    assert found.speed > 0
