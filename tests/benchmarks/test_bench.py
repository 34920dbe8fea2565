import json
import runpy
from importlib import import_module

import numpy as np
import pytest
import pyvista as pv

from benchmarks import BENCHES, instances, main
from benchmarks.common import whole_frames
from benchmarks.common.harness import Results, Row
from benchmarks.common.meshes import MESHES
from benchmarks.scaling import exponents
from benchmarks.tradeoffs import knee
from pvibr.cli import peers
from pvibr.meshes.parts import as_parts
from pvibr.scenes.stage import Stage, mesh_actors


def test_rows_pass_their_bar_or_not():
    assert Row('a', 1.0, bar=1.0).ok
    assert not Row('a', 1.1, bar=1.0).ok
    assert Row('a', 200, bar=200, at_least=True).ok
    assert Row('a', 3).ok is None
    assert (Row('a', 3, bar=2).asked, Row('a', 3, bar=2, at_least=True).asked) == ('<= 2', '>= 2')


def test_results_are_json_and_a_plot(tmp_path):
    walk = {'pvibr': [(1.0, {'CPU': 10.0, 'wall': 6.0, 'flip': 0.02})]}
    walk['peers'] = {name: {'CPU': 9e3, 'wall': 5e3} for name in ('glyphs', 'with levels')}
    points = {'walk': {'8': walk, 'meshes': 0.03}}
    points['single'] = {'knot': {16: {'1.0': {'flip, 8': 0.9, 'moved': 1.0}}}}
    results = Results('a driver', {'quick': True}, [Row('bake', np.float32(2), 's', 3)], points)
    found = json.loads(results.to_json())
    assert found['driver'] == 'a driver'
    assert found['rows'][0]['ok'] is True
    assert results.table().row_count == 1
    instances.BENCH.write('instances', results, tmp_path)
    assert (tmp_path / 'bench_instances.png').stat().st_size > 1000


@pytest.mark.parametrize('name', BENCHES)
def test_every_bench_is_declared(name):
    bench = import_module(f'benchmarks.{name}').BENCH
    assert {len(pair) for pair in bench.settings.values()} == {2}
    assert bench.outside or name in (
        'cluster',
        'sort_last',
        'scaling',
        'tradeoffs',
    )  # of frames themselves
    assert BENCHES[name].startswith('Measure ')


def test_continuous_integration_runs_every_bench(capfd):
    runpy.run_module('benchmarks', run_name='__main__')
    assert capfd.readouterr().out.split() == list(BENCHES)


def test_exponents_of_powers():
    counts = np.array([10, 100, 1000])
    assert np.allclose(exponents(counts, 3 * counts**0.5), 0.5)
    assert np.allclose(exponents(counts, [1, 1, 10]), (0.5, 1))


def test_the_knee_of_a_trade_off():
    assert knee([1, 2, 10, 100], [100, 3, 2, 1]) == 1


def test_whole_frames_are_drawn_by_turns():
    drawn = []

    def make(settings, size, on):
        pl = whole_frames.real_plotter(size)
        pl.add_mesh(pv.Cone())
        draw = whole_frames.turning(pl)

        def noted(k):
            drawn.append((k, on, pl.render_window.GetMultiSamples() > 0))
            draw(k)

        return pl, noted

    found = whole_frames.measured(make, None, (40, 30), 2)
    assert drawn == [
        (k, on, many) for many in (True, False) for k in range(-2, 2) for on in (True, False)
    ]
    assert [np.shape(found[n][way]) for n in (8, 0) for way in ('with', 'without')] == [(2, 2)] * 4
    times = {'with': [(2, 1), (4, 1), (9, 1)], 'without': [(1, 1), (2, 1), (3, 1)]}
    told = {what: value for what, value, _ in whole_frames.told(times)}
    assert told['with over without, CPU'] == 2
    assert told['with over without, wall'] == 1
    assert (told['with, CPU'], told['without, CPU']) == (4e3, 2e3)
    assert told['interquartile range of that, CPU'] == 0.5


def test_an_unknown_bench_is_named():
    with pytest.raises(ValueError, match='instances'):
        main('shadow')


@pytest.mark.parametrize('lod', [False, True])
def test_glyphs_stand_where_the_meshes_do(lod):
    rng = np.random.default_rng(1)
    poses = np.tile(np.eye(4), (6, 1, 1))
    poses[:, :3, :3] = pv.core.utilities.transformations.axis_angle_rotation((1, 2, 3), 40)[:3, :3]
    poses[:, :3, :3] *= rng.uniform(0.5, 1.5, 6)[:, None, None]
    poses[:, :3, 3] = rng.uniform(-2, 2, (6, 3))
    meshes, index = [as_parts(pv.Cone(resolution=40), color='red')], np.zeros(6, int)
    pictures = []
    glyphs = peers.glyph_actors(meshes, poses, index, lod=lod)
    for actors in (mesh_actors(meshes, poses, index), glyphs):
        with Stage((90, 60)) as stage:
            stage.add(actors)
            stage.look([(0, -14, 2), (0, 0, 0), (0, 0, 1)])
            pictures.append(stage.picture())
            for actor in actors:
                actor.ReleaseGraphicsResources(stage.window)
    assert np.abs(pictures[0] - pictures[1]).mean() < (0.02 if lod else 0.002)
    assert np.ptp(pictures[0]) > 0.3


@pytest.mark.parametrize('name', MESHES)
def test_single_meshes_are_triangles(name):
    parts = as_parts(MESHES[name]())
    assert sum(part.mesh.n_cells for part in parts) > 2000


@pytest.mark.bench
def test_quick_bench_runs(tmp_path):
    rows = main('instances', out=tmp_path, quick=True).rows
    assert len(rows) > 15
    assert {file.suffix for file in tmp_path.iterdir()} == {'.json', '.png', '.txt'}
