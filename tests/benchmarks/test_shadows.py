import json
from types import SimpleNamespace

import numpy as np
import pytest
import pyvista as pv

from benchmarks import main, shadows
from benchmarks.common.harness import Results
from benchmarks.common.light_scenes import SCENES, LightScene
from benchmarks.common.rays import Rays
from benchmarks.shadows import contact, errors, times

WINDOW = (120, 80)


@pytest.fixture(scope='module')
def scene():
    """A ball above a floor."""
    floor = pv.Plane(i_size=6, j_size=6).triangulate()
    ball = pv.Sphere(radius=0.8, center=(0, 0, 1.2))
    light = pv.Light(position=(-3, 0, 6), light_type='scene light')
    light.positional, light.cone_angle = True, 40.0
    return LightScene('ball', [floor, ball], {'spot': light}, ((0, -14, 8), (0, 0, 0), (0, 0, 1)))


@pytest.mark.parametrize('quick', [False, True])
def test_settings_name_scenes_and_lights(quick):
    settings = shadows.BENCH.extent(quick=quick)
    named = {*settings.scenes, *settings.soft, settings.extreme, settings.timed, settings.plotted}
    assert named <= set(SCENES)
    assert set(settings.lights) <= {'directional', 'spot', 'point'}


@pytest.mark.parametrize(('setting', 'most'), [({'method': 'hard'}, 0.2), ({}, 0.2)])
def test_few_pixels_are_wrong(scene, setting, most):
    with errors.sight(scene, Rays(scene.meshes), 'spot', WINDOW) as found:
        assert errors.wrong_share(found, setting) <= most
        assert (found.lit[~found.away] == 0).sum() > 50
        assert not found.stage.plotter.ibr.effects


def test_shadows_that_miss_a_caster_are_found_wrong(scene):
    with errors.sight(scene, Rays(scene.meshes), 'spot', WINDOW) as found:
        assert errors.wrong_share(found, {'casts': lambda actor: False}) > 1


def test_the_reference_is_unsure_at_edges_alone(scene):
    with errors.sight(scene, Rays(scene.meshes), 'spot', WINDOW) as found:
        every = np.isfinite(found.lit)
        assert not (found.unsure(every) & ~found.band).any()
        assert not found.unsure(np.zeros_like(every)).any()


def test_soft_errors_are_those_of_what_is_known():
    lit, nan = np.array([0.0, 0.5, 1.0, 1.0]), np.nan
    away = np.array([False, False, False, True])
    found = errors.Sight(None, None, lit, away, None, None)
    assert errors.light_error(found, np.array([0.1, 0.7, nan, 0.0])) == pytest.approx(0.15)


def test_a_gap_is_as_wide_as_it_is_made():
    narrow, wide = (contact.gap(0.0, 'spot', {'normal_bias': x}) for x in (0.0, 8.0))
    assert narrow < 1
    assert 5 < wide < 12


def test_acne_is_counted():
    assert contact.acne('spot', {}, 85.0) == 0
    assert contact.acne_on_ball('spot', {}) == 0


def test_times_are_those_of_both_moves(scene):
    settings = SimpleNamespace(screen=WINDOW, repeats=1, frames=1)
    found = times.extra_ms(scene, 'spot', {'pcf': {}}, settings)
    assert set(found['pcf']) == {'camera', 'light'}
    assert np.isfinite([found['pcf'][k]['cpu'] for k in ('camera', 'light')]).all()


def test_points_are_a_plot(tmp_path):
    points = [{'label': 'a', 'setting': '{}', 'ms': 1.0, 'error': 0.0}]
    both = [*points, {'label': 'b', 'setting': '{}', 'ms': 3.0, 'error': 0.1}]
    plotted = {'hard': {'pcf': both, "VTK's own pass": points}, 'soft': {'pcss': both}, 'rays': 2}
    results = Results('a driver', {}, points={'plot': plotted})
    shadows.BENCH.write('shadows', results, tmp_path)
    assert (tmp_path / 'bench_shadows.png').stat().st_size > 1000


@pytest.mark.bench
def test_quick_bench_runs(tmp_path):
    rows = main('shadows', out=tmp_path, quick=True).rows
    assert len(rows) > 50
    assert np.isfinite([row.value for row in rows]).all()
    assert json.loads((tmp_path / 'bench_shadows.json').read_text())['points']['plot']
    assert (tmp_path / 'bench_shadows.png').is_file()
