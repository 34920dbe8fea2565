import json

import numpy as np
import pytest
import pyvista as pv

from pvibr.bench import main, peers, single
from pvibr.bench.plot import plot
from pvibr.bench.rows import Results, Row
from pvibr.capture.offscreen import Stage, mesh_actors
from pvibr.meshes.parts import as_parts


def test_rows_pass_their_bar_or_not():
    assert Row('a', 1.0, bar=1.0).ok
    assert not Row('a', 1.1, bar=1.0).ok
    assert Row('a', 200, bar=200, at_least=True).ok
    assert Row('a', 3).ok is None
    assert (Row('a', 3, bar=2).asked, Row('a', 3, bar=2, at_least=True).asked) == ('<= 2', '>= 2')


def test_results_are_json_and_a_plot(tmp_path):
    curve = [(1.0, {'ms': 10.0, 'flip': 0.02})]
    points = {'pvibr': curve, 'single': {'knot': {16: {'1.0': (0.9, 1.0)}}}}
    points |= {'glyphs': {'ms': 9e3, 'flip': 0.03}, 'glyphs, culling + LOD': {'ms': 900.0}}
    results = Results('a driver', {'quick': True}, [Row('bake', np.float32(2), 's', 3)], points)
    found = json.loads(results.to_json())
    assert found['driver'] == 'a driver'
    assert found['rows'][0]['ok'] is True
    assert results.table().row_count == 1
    plot(results, tmp_path / 'a.png')
    assert (tmp_path / 'a.png').stat().st_size > 1000


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


@pytest.mark.parametrize('name', single.MESHES)
def test_single_meshes_are_triangles(name):
    parts = as_parts(single.MESHES[name]())
    assert sum(part.mesh.n_cells for part in parts) > 2000


@pytest.mark.slow
@pytest.mark.bench
def test_quick_bench_runs(tmp_path):
    rows = main('instances', out=tmp_path, quick=True)
    assert len(rows) > 15
    assert {file.suffix for file in tmp_path.iterdir()} == {'.json', '.png'}
