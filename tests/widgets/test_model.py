"""The model of a panel: it follows the plotter, and the plotter follows it."""

import gc
import weakref

import numpy as np
import pytest
import pyvista as pv

import pvibr
from pvibr.core import _vtk
from pvibr.core.errors import PvibrWarning
from pvibr_widgets.model import Model


def titles(model):
    return [group.title for group in model.groups]


def row_of(model, group, name):
    found = next(g for g in model.groups if g.name == group)
    return next(r for r in found.rows if r.name == name)


def test_everything_in_every_subplot_is_there():
    pl = pv.Plotter(shape=(1, 2), window_size=(64, 32))
    ball = pl.add_mesh(pv.Sphere())
    pl.ibr.add(pvibr.Shadows())
    pl.ibr.add_spheres(np.eye(3), name='atoms')
    pl.ibr.add_billboards(np.eye(3), np.ones((4, 4)))
    pl.ibr.add_instances(pv.Cube(), np.eye(3))
    pl.ibr.add_impostor(ball)
    pl.subplot(0, 1)
    pl.ibr.add(pvibr.Outline())
    pl.ibr.add(pvibr.Outline(width=3.0))
    model = Model(pl)
    assert sorted(titles(model)) == sorted(
        [
            '0, 0: Shadows',
            '0, 0: atoms',
            '0, 0: Billboards',
            '0, 0: Instances',
            '0, 0: Impostor',
            '0, 1: Outline',
            '0, 1: Outline 2',
        ]
    )
    assert [r.name for r in model.groups[-1].rows][:2] == ['width', 'color']


def test_what_a_row_does_is_in_the_picture(pl):
    model = Model(pl)
    before = pl.screenshot(return_img=True)
    row = row_of(model, 'Bloom', 'intensity')
    model.do(row.move, row.scale.last)
    after = pl.screenshot(return_img=True)
    assert np.abs(after.astype(int) - before).max() > 10
    model.do(row.reset)
    np.testing.assert_array_equal(pl.screenshot(return_img=True), before)


def test_code_that_changes_the_plotter_is_seen_with_the_next_frame(pl):
    model, told = Model(pl), []
    model.listen(told.append)
    pl.render()
    assert told == []
    pl.ibr.effects[0].intensity = 0.3
    assert told == []
    pl.render()
    assert told == [False]
    vignette = pl.ibr.add(pvibr.Vignette())
    pl.render()
    assert titles(model) == ['Bloom', 'Vignette']
    pl.ibr.remove(vignette)
    pl.render()
    assert titles(model) == ['Bloom']
    assert told == [False, True, True]
    pl.ibr.effects[0].enabled = False
    model.refresh()
    assert not model.groups[0].enabled
    assert len(told) == 4


def test_off_on_and_removed(pl):
    model = Model(pl)
    on = pl.screenshot(return_img=True)
    model.do(model.groups[0].switch, False)
    assert pl.ibr.report().rows[0].state == 'off'
    assert not np.array_equal(pl.screenshot(return_img=True), on)
    model.do(model.groups[0].switch, True)
    np.testing.assert_array_equal(pl.screenshot(return_img=True), on)
    group = model.groups[0]
    model.do(group.remove)
    assert pl.ibr.effects == ()
    assert model.groups == []
    model.do(group.remove)  # a second click
    assert model.message == ''


def test_a_bad_value_is_said_and_told(pl):
    model, told = Model(pl), []
    model.listen(told.append)
    row = row_of(model, 'Bloom', 'spread')
    model.do(row.write, '7')
    assert 'Bloom.spread must be a float in [0, 1], got 7.0' in row.error
    assert (row.text, told) == ('0.5', [False])
    model.do(row.write, '0.5')
    assert (row.error, told) == ('', [False, False])


def test_why_an_effect_went_off_is_there(pl):
    class Broken(pvibr.Effect):
        def prepare(self, frame):
            raise ZeroDivisionError('by a shader')

    model = Model(pl)
    pl.ibr.add(Broken())
    with pytest.warns(PvibrWarning, match='Broken is off'):
        pl.render()
    group = next(g for g in model.groups if g.name == 'Broken')
    assert group.why == 'ZeroDivisionError: by a shader'
    model.do(group.switch, True)
    assert 'by a shader' in model.message


def test_settings_of_the_plotter_itself(pl):
    model, told = Model(pl), []
    model.listen(told.append)
    assert [row.name for row in model.own] == ['interactive_frame_ms']
    model.do(model.own[0].write, '50')
    assert (pl.ibr.interactive_frame_ms, told) == (50.0, [False])
    assert model.code().endswith('pl.ibr.interactive_frame_ms = 50.0')
    pl.ibr.interactive_frame_ms = 80
    pl.render()
    assert (model.own[0].text, told) == ('80', [False, False])
    model.do(model.reset)
    assert pl.ibr.interactive_frame_ms == 100.0


def test_presets_of_a_group(pl):
    model = Model(pl)
    group = model.groups[0]
    model.do(group.keep, 'mine')
    model.do(group.apply, 'strong')
    assert pl.ibr.effects[0].intensity == 2.0
    model.do(group.apply, 'mine')
    assert (pl.ibr.effects[0].intensity, pl.ibr.effects[0].threshold) == (1.0, 0.5)
    model.do(group.keep, 'strong')
    assert 'must be a new one' in model.message
    model.do(group.forget, 'mine')
    assert group.presets == ['defaults', 'subtle', 'strong']
    model.do(model.reset)
    assert pl.ibr.effects[0].state() == pvibr.Bloom().state()


def test_states_are_saved_and_loaded(pl, tmp_path):
    model = Model(pl)
    path = str(tmp_path / 'a.json')
    model.do(model.save, path)
    assert model.message == f'saved to {path}'
    pl.ibr.effects[0].threshold = 0.9
    model.do(model.load, path)
    assert (pl.ibr.effects[0].threshold, model.message) == (0.5, '')
    pl.ibr.clear()
    model.do(model.load, path)
    assert 'unknown names were not restored: subplot 0: Bloom' in model.message
    for wrong in ('', str(tmp_path), str(tmp_path / 'none')):
        model.do(model.load, wrong)
        assert model.message
    (tmp_path / 'b.json').write_text('{"time": NaN}')
    model.do(model.load, str(tmp_path / 'b.json'))
    assert 'not JSON' in model.message


def test_a_closed_plotter_leaves_an_empty_panel(pl):
    model, told = Model(pl), []
    row = row_of(model, 'Bloom', 'spread')
    model.listen(told.append)
    pl.close()
    assert (model.groups, model.message, told) == ([], 'the plotter is closed', [True])
    model.do(row.write, '0.25')
    model.do(model.save, 'nowhere')
    assert 'the plotter is closed' in model.message


def test_nothing_is_followed_after_close(pl):
    model, told = Model(pl), []
    model.listen(told.append)
    model.close()
    model.close()
    pl.ibr.effects[0].intensity = 0.1
    pl.render()
    assert told == []


def test_a_panel_that_nobody_holds_goes(pl):
    gone = weakref.ref(Model(pl))
    gc.collect()
    assert gone() is None
    pl.render()


def test_two_panels_of_one_plotter_agree(pl):
    one, two = Model(pl), Model(pl)
    one.do(row_of(one, 'Bloom', 'spread').write, '0.25')
    assert row_of(two, 'Bloom', 'spread').text == '0.25'


def test_a_plain_renderer_will_do():
    window, renderer = _vtk.vtkRenderWindow(), _vtk.vtkRenderer()
    window.SetOffScreenRendering(True)
    window.AddRenderer(renderer)
    with pvibr.attach(renderer) as ibr:
        flash = ibr.add(pvibr.Flash())
        model = Model(renderer)
        model.do(row_of(model, 'Flash', 'at').write, '2')
        assert flash.at == 2.0
        assert 'pvibr.Flash(at=2.0)' in model.code()
    assert model.groups == []
    window.Finalize()


def test_sliders_of_lengths_know_the_size_of_the_scene():
    pl = pv.Plotter(window_size=(32, 32))
    pl.add_mesh(pv.Cube(x_length=1e6, y_length=1e6, z_length=1e6))
    pl.ibr.add(pvibr.DepthOfField())
    scale = row_of(Model(pl), 'DepthOfField', 'distance').scale
    assert scale.low < 1e4 < 1e6 < scale.high
    empty = pv.Plotter(window_size=(32, 32))
    empty.ibr.add(pvibr.DepthOfField())
    assert row_of(Model(empty), 'DepthOfField', 'distance').scale.low < 1
