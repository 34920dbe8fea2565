"""What a browser shows by itself, and the one warning that says so."""

import sys
import warnings
from types import SimpleNamespace

import numpy as np
import pytest
import pyvista as pv

import pvibr
from pvibr.export.web_report import PICTURES, WebReport
from tests.refusals import refused

STATES = ('shown', 'baked', 'lost')


@pytest.fixture
def plotter():
    pl = pv.Plotter(off_screen=True, window_size=(64, 48), shape=(1, 2))
    ball = pl.add_mesh(pv.Sphere())
    pl.ibr.add_impostor(ball)
    pl.ibr.add(pvibr.Bloom())
    pl.subplot(0, 1)
    pl.ibr.add_spheres([[0, 0, 0]])
    yield pl
    pl.close()


def effects():
    found = [getattr(pvibr, name) for name in pvibr.__all__]
    return [c for c in found if isinstance(c, type) and issubclass(c, pvibr.Effect)]


@pytest.mark.parametrize('kind', effects(), ids=lambda c: c.__name__)
def test_every_class_says_what_becomes_of_it(kind):
    state, what = kind.web
    assert state in STATES
    assert what
    if state == 'baked':
        assert kind.bake_into is not pvibr.Effect.bake_into


def test_rows_of_all_subplots(plotter):
    report = plotter.ibr.web_report('html')
    assert [(r.effect, r.state, r.subplot) for r in report.rows] == [
        ('Impostor', 'shown', 0),
        ('Bloom', 'lost', 0),
        ('Spheres', 'baked', 1),
    ]
    assert [r.effect for r in report.missing] == ['Bloom', 'Spheres']
    assert report.as_dict()['backend'] == 'html'
    last = {'effect': 'Spheres', 'state': 'baked', 'what': 'meshes', 'subplot': 1}
    assert report.as_dict()['rows'][2] == last
    assert '1: Spheres' in str(report)


@pytest.mark.parametrize('backend', PICTURES)
def test_pictures_show_everything(plotter, backend):
    assert not plotter.ibr.web_report(backend).missing


def test_what_is_off_is_not_missing(plotter):
    plotter.subplot(0, 0)
    plotter.ibr.effects[1].enabled = False
    states = {r.effect: r.state for r in plotter.ibr.web_report().rows}
    assert states['Bloom'] == 'off'
    assert [r.effect for r in plotter.ibr.web_report().missing] == ['Spheres']


def test_what_is_neutral_is_not_missing(tmp_path):
    pl = pv.Plotter(off_screen=True, window_size=(64, 48))
    pl.add_mesh(pv.Cube())
    kinds = [getattr(pvibr, name) for name in pvibr.EFFECTS]
    added = [pl.ibr.add(kind.sample([])) for kind in kinds if kind.neutral]
    assert len(added) > 14
    missing = {row.effect for row in pl.ibr.web_report().missing}
    assert {'Bloom', 'Fog', 'Outline'} <= missing
    for effect in added:
        setattr(effect, *effect.neutral)
    assert {row.state for row in pl.ibr.web_report().rows} == {'off'}
    pl.render()
    exports(pl, tmp_path)  # a warning would fail
    pl.ibr.to_plain_plotter().close()


def test_bad_input(plotter):
    refused(r"backend must be one of 'static'.* got 'firefox'", plotter.ibr.web_report, 'firefox')
    plotter.close()
    with pytest.raises(pvibr.ClosedError):
        plotter.ibr.web_report()


def test_an_empty_report_is_a_table():
    assert str(WebReport('html', [])) == "effect  with 'html'  as what, or why not"


def exports(pl, folder):
    pv.Plotter.export_obj(pl, folder / 'scene.obj')  # as a program does that reads the scene


def test_exporters_of_pyvista_write_the_plain_plotter(tmp_path):
    places = np.random.default_rng(7).uniform(0, 9, (6, 3))
    pl = pv.Plotter(off_screen=True, window_size=(64, 48))
    pl.add_mesh(pv.Cube(center=(0, 0, -4)), color='gold')
    pl.ibr.add_instances(pv.Cube(), places, color='red')
    for ending in ('gltf', 'obj', 'vrml'):
        path = tmp_path / f'scene.{ending}'
        getattr(pl, f'export_{ending}')(path)
        if ending == 'gltf':
            blocks = pv.read(path).recursive_iterator()
            points = np.vstack([b.points for b in blocks if b.n_points])
            assert len(points) == 7 * pv.Cube().n_points
            across = np.ptp([*places[:, 0], 0]) + 1
            np.testing.assert_allclose(np.ptp(points, axis=0)[2], across, rtol=1e-3)
        assert path.stat().st_size > 3000
    plain = pl.ibr.to_plain_plotter()
    assert all(actor.mapper.dataset.n_cells for actor in plain.actors.values())
    plain.close()
    pl.close()
    with pytest.raises(RuntimeError, match='This plotter has been closed'):  # as PyVista says
        pl.export_gltf(tmp_path / 'scene.gltf')
    with pytest.raises(pvibr.ClosedError):
        pl.ibr.to_plain_plotter()


@pytest.mark.filterwarnings('ignore::pyvista.PyVistaDeprecationWarning')
def test_one_warning_where_the_scene_is_handed_over(plotter, tmp_path):
    plotter.show(auto_close=False)
    plotter.screenshot()
    assert plotter.bounds is not None
    plotter.reset_camera()
    with pytest.warns(
        pvibr.PvibrWarning, match=r'to_plain_plotter\(\) .* has Spheres.*Not available: Bloom'
    ):
        exports(plotter, tmp_path)
    exports(plotter, tmp_path)  # said once
    plotter.subplot(0, 0)
    plotter.ibr.add(pvibr.Vignette())
    plotter.render()
    with pytest.warns(pvibr.PvibrWarning, match='Not available: Bloom .*; Vignette'):
        exports(plotter, tmp_path)  # something else is missing now


def test_pages_of_trame_and_html(plotter):
    pytest.importorskip('trame_pyvista')
    pytest.importorskip('nest_asyncio2')
    plotter.show(auto_close=False)
    with pytest.warns(pvibr.PvibrWarning, match='Bloom'):
        assert plotter.trame.export_html(None).getvalue()
    with pytest.warns(pvibr.PvibrWarning, match='Bloom'):
        plain = plotter.ibr.to_plain_plotter()
    with pytest.warns(pvibr.PvibrWarning, match='Bloom'):
        sizes = [len(pl.trame.export_vtksz(None)) for pl in (plotter, plain)]
    assert sizes[0] == pytest.approx(sizes[1], rel=0.01)


def test_no_warning_without_effects_or_where_all_is_shown(tmp_path):
    pl = pv.Plotter(off_screen=True)
    ball = pl.add_mesh(pv.Sphere())
    before = pl.renderer.GetViewProps().GetNumberOfItems()
    impostor = pl.ibr.add_impostor(ball)
    pl.show(auto_close=False)
    exports(pl, tmp_path)
    pl.ibr.remove(impostor)
    assert pl.renderer.GetViewProps().GetNumberOfItems() == before
    exports(pl, tmp_path)


@pytest.mark.parametrize('what', ['enable_shadows', 'enable_ssao', 'enable_depth_peeling'])
def test_frames_of_passes_hand_nothing_over(what):
    pl = pv.Plotter(off_screen=True, window_size=(64, 48))
    pl.add_mesh(pv.Sphere())
    pl.ibr.add(pvibr.Vignette())
    getattr(pl, what)()
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter('always', pvibr.PvibrWarning)
        pl.show(auto_close=False)
        pl.render()
    assert not [w for w in said if w.category is pvibr.PvibrWarning]


def test_the_watch_does_not_show(plotter):
    plotter.show(auto_close=False)
    with_watch = plotter.screenshot()
    for pipeline in plotter.ibr._pipelines:
        pipeline.watch.set(False)
    assert np.array_equal(plotter.screenshot(), with_watch)
    plotter.subplot(0, 0)
    assert plotter.ibr.buffer('id').max() == 0  # the ball, and nothing else


def test_a_page_that_shows_pictures_is_told_when_it_is_switched(plotter, monkeypatch, tmp_path):
    class State(dict):
        told = ()

        def change(self, key):
            assert key == 'pictures'
            return lambda call: setattr(self, 'told', (*self.told, call))

    state = State(pictures=True)
    viewer = SimpleNamespace(SERVER_RENDERING='pictures', server=SimpleNamespace(state=state))
    ui = SimpleNamespace(_VIEWERS={plotter._id_name: viewer})
    monkeypatch.setitem(sys.modules, 'trame_pyvista.ui', ui)
    plotter.show(auto_close=False)
    for _ in range(3):
        plotter.render()
        exports(plotter, tmp_path)
    assert len(state.told) == 1
    state['pictures'] = False
    with pytest.warns(pvibr.PvibrWarning, match='Bloom'):
        state.told[0](pictures=False)


def test_who_asks_for_bounds_is_told_nothing():
    pl = pv.Plotter(off_screen=True)
    pl.add_mesh(pv.Sphere())
    pl.ibr.add(pvibr.Shadows())
    pl.show(auto_close=False)
    assert pl.bounds.x_max < 1
    for actor in pl.renderer.GetActors():
        actor.GetBounds()
