import json
from dataclasses import asdict, replace
from types import SimpleNamespace

import numpy as np
import pytest

from benchmarks import SURVEYS, main
from benchmarks.common.harness import Results
from benchmarks.instances import survey
from benchmarks.instances.unseen_meshes import HEAVY_KINDS, KINDS, unseen
from pvibr.meshes.parts import are_parts
from pvibr.scenes.stage import MULTI_SAMPLES


def points_of(parts):
    return np.concatenate([np.asarray(part.mesh.points) for part in parts])


@pytest.mark.parametrize('kinds', [KINDS, HEAVY_KINDS], ids=['all', 'heavy'])
def test_meshes_are_those_of_their_seed(kinds):
    few = (2_000, 4_000)
    first, same, other = (
        {name: points_of(make()) for name, make in unseen(seed, few, kinds)} for seed in (1, 1, 2)
    )
    assert list(first) == list(kinds)
    assert all(np.array_equal(first[n], same[n]) for n in kinds)
    assert not any(np.array_equal(first[n], other[n]) for n in kinds)
    assert all(np.isfinite(points).all() for points in first.values())


@pytest.mark.parametrize('name', KINDS)
def test_meshes_have_about_the_triangles_asked_for(name):
    parts = dict(unseen(3, (20_000, 20_001)))[name]()
    assert are_parts(parts)
    assert 10_000 <= sum(part.mesh.n_cells for part in parts) <= 40_000


@pytest.mark.parametrize('name', HEAVY_KINDS)
def test_heavier_meshes_have_the_triangles_asked_for(name):
    parts = dict(unseen(3, (60_000, 60_001), HEAVY_KINDS))[name]()
    assert are_parts(parts)
    assert 50_000 <= sum(part.mesh.n_cells for part in parts) <= 70_000


def test_fields_are_those_of_their_seed_and_overlap():
    make = dict(unseen(1, (2_000, 3_000)))['soup']
    scenes = [survey.field_of('soup', make, 100, seed) for seed in (1, 1, 2)]
    assert np.array_equal(scenes[0].poses, scenes[1].poses)
    assert scenes[0].cameras == scenes[1].cameras
    assert not np.array_equal(scenes[0].poses, scenes[2].poses)
    for eye, elevation in zip(scenes[0].cameras, survey.ELEVATIONS, strict=True):
        assert np.isclose(np.degrees(np.arcsin(eye[0][2] / np.linalg.norm(eye[0]))), elevation)


def result(name, ours, flip, sharp=0.95, triangles=20_000):
    """Return what a survey may find: times in ms, and errors over those of the meshes."""
    keys = [f'{way}, {n}' for way in (*survey.WAYS, 'meshes') for n in MULTI_SAMPLES]
    ms = {key: {'CPU': ours, 'wall': ours / 2} for key in keys}
    ms |= {f'peer, {n}': {'CPU': 100.0 + n, 'wall': 100.0} for n in MULTI_SAMPLES}
    flips = {key: [0.5, 0.8 if key.startswith('meshes') else flip] for key in keys}
    sharps = {key: [1.0, sharp] for key in keys} | {'base': [0.8, 1.1]}
    return survey.MeshResult(name, triangles, True, [1.0, 0.1], 0, '', ms, flips, sharps)


def test_rows_are_of_defaults_first_and_the_bars_of_what_they_are_about():
    glass = replace(result('glass', 50.0, 0.9), opaque=False)
    small = result('small', 20.0, 1.2, sharp=0.7, triangles=9_000)
    found = list(survey.rows([glass, small, result('knot', 1.0, 0.9)], survey.SPEEDS))
    rows = {row.name: row for row in found}
    eight, none = (
        [row for row in found if row.name.startswith(f'{n} samples')] for n in MULTI_SAMPLES
    )
    assert found.index(eight[0]) < found.index(none[0])
    least = rows['8 samples: over VTK, least of the opaque over 10,000 triangles']
    assert (least.value, least.bar) == (108, survey.SPEED)
    assert rows['8 samples: over VTK, geometric mean'].bar == 20
    assert rows['0 samples: over VTK, geometric mean'].bar == 14.5
    assert np.isclose(rows['0 samples: over VTK, geometric mean'].value, (2 * 5 * 100) ** (1 / 3))
    assert rows['0 samples: over VTK on the wall, geometric mean'].value > 2 * 9
    for n in MULTI_SAMPLES:
        worst = rows[f"{n} samples: FLIP over the meshes' at one sample, worst"]
        assert (worst.value, worst.ok) == (1.2, False)
        sharp = rows[f'{n} samples: sharpness, worst']
        assert (sharp.value, sharp.ok) == (0.7, False)
        noise = rows[f"{n} samples: sharpness over the meshes' at one sample, greatest"]
        assert (noise.value, noise.ok) == (1.0 / 0.8, False)
    fine = rows["max_error=0.5: FLIP over the meshes', both at 8 samples, worst"]
    assert (fine.value, fine.bar) == (1.2 / 0.8, 1.15)


def test_the_worst_mesh_comes_first(tmp_path):
    bench = survey.survey(5)
    points = [asdict(r) for r in (result('bad', 50.0, 0.9), result('good', 1.0, 0.9))]
    results = Results('a driver', {'quick': True}, points={'survey': points})
    bench.write('survey', results, tmp_path)
    text = (tmp_path / 'bench_survey.txt').read_text(encoding='utf-8')
    assert text.index('bad') < text.index('good')
    assert text.index('8 samples') < text.index('0 samples')
    kept = json.loads((tmp_path / 'bench_survey.json').read_text(encoding='utf-8'))
    assert kept['points']['survey'][0]['name'] == 'bad'


def test_what_cannot_be_measured_is_a_row_and_the_others_are_measured(monkeypatch, capsys):
    def measured(name, make, settings, seed):
        if name == 'gear, split edges':
            survey.spheres([make()], np.eye(4), [0])  # poses are (n, 4, 4)
        return result(name, 2.0, 0.9)

    monkeypatch.setattr(survey, 'measured', measured)
    bench = survey.survey(5)
    results = Results('a driver', {'quick': True})
    rows = {row.name: row for row in bench.parts['survey'](bench.extent(quick=True), results)}
    assert not rows['meshes that could not be measured'].ok
    assert rows['0 samples: over VTK, least'].value == 50
    first, *others = results.points['survey']
    assert (first['name'], len(others)) == ('gear, split edges', 2)
    assert 'IndexError: too many indices' in first['error']
    assert 'stage.py' in first['error']
    assert not any(f['error'] for f in others)
    told = capsys.readouterr().err
    assert all(f['name'] in told for f in results.points['survey'])


def test_a_bench_without_a_survey_says_so():
    assert SURVEYS == ('instances',)
    with pytest.raises(ValueError, match='instances'):
        main('moving', survey=1)
    with pytest.raises(ValueError, match='heavy requires survey'):
        main('instances', heavy=True)


@pytest.mark.bench
def test_a_small_survey_runs():
    settings = SimpleNamespace(instances=20, frames=1, peer_frames=1)
    make = dict(unseen(1, (2_000, 2_500)))['textured']
    found = survey.measured('textured', make, settings, 1)
    assert len(found.flip['ours, 0']) == len(survey.ELEVATIONS)
    assert found.speed(8) > 0
    assert 0.8 < found.worst_sharpness(8) <= 1.1
