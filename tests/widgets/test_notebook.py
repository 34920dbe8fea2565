"""The panel of notebooks, by the values that its widgets get from the page."""

from __future__ import annotations

import asyncio
import io
import sys
import threading

import numpy as np
import pytest
import pyvista as pv

import pvibr

W = pytest.importorskip('ipywidgets', reason="needs pip install 'pvibr[jupyter]'")


@pytest.fixture
def panel(pl):
    from pvibr_widgets.notebook import notebook_panel

    panel = notebook_panel(pl)
    yield panel
    panel.close()


def controls(panel, name, group='Bloom'):
    return panel.group(group).row(name).controls


def sent(widget, value):
    """Let a widget have a value from the page."""
    widget.set_state({'index' if isinstance(widget, W.Dropdown) else 'value': value})


def everything(widget):
    yield widget
    for child in getattr(widget, 'children', ()):
        yield from everything(child)


def click(panel, text, tooltip=''):
    found = [
        w
        for w in everything(panel)
        if isinstance(w, W.Button) and w.description == text and tooltip in (w.tooltip or '')
    ]
    assert found, text
    found[0].click()


def said(panel):
    return ' '.join(w.value for w in everything(panel) if isinstance(w, W.HTML))


def test_a_slider_moved_is_in_the_picture(panel, pl):
    before = pl.screenshot(return_img=True)
    sent(controls(panel, 'intensity')['slider'], 150)
    assert pl.ibr.effects[0].intensity == 3.0
    assert controls(panel, 'intensity')['text'].value == '3'
    assert np.abs(pl.screenshot(return_img=True).astype(int) - before).max() > 10


def test_a_text_is_taken_or_said_and_put_back(panel, pl):
    bloom, text = pl.ibr.effects[0], controls(panel, 'threshold')['text']
    sent(text, '7.5')
    assert (bloom.threshold, controls(panel, 'threshold')['slider'].value) == (7.5, 200)
    sent(text, 'much')
    assert (bloom.threshold, text.value) == (7.5, '7.5')
    assert 'Bloom.threshold = &#x27;much&#x27;: must be a float' in said(panel)
    sent(text, '0.5')
    assert 'must be' not in said(panel)


def test_switches_choices_colours_and_ticks(panel, pl):
    bloom, vignette = pl.ibr.effects[0], pl.ibr.add(pvibr.Vignette())
    pl.render()
    sent(controls(panel, 'background')['switch'], True)
    sent(controls(panel, 'blend')['choice'], 1)
    sent(controls(panel, 'kernel')['choice'], 3)
    sent(controls(panel, 'color', 'Vignette')['color'], '#ff0000')
    assert (bloom.background, bloom.blend, bloom.kernel) == (True, 'screen', 9)
    assert vignette.color == (1.0, 0.0, 0.0)
    levels = controls(panel, 'levels')
    assert levels['derived'].value
    sent(levels['derived'], False)
    assert bloom.levels == int(levels['text'].value)
    levels['reset'].click()
    assert bloom.levels is None
    assert levels['derived'].value
    sent(panel.group('Vignette').enabled, False)
    assert not vignette.enabled
    sent(controls(panel, 'center', 'Vignette')['text'], '0.25, 0.75')
    assert vignette.center == (0.25, 0.75)


def test_settings_of_the_plotter_itself(panel, pl):
    sent(panel.rows[0].controls['text'], '50')
    assert pl.ibr.interactive_frame_ms == 50.0
    click(panel, 'Reset all')
    assert panel.rows[0].controls['text'].value == '100'


def test_the_panel_follows_code(panel, pl):
    pl.ibr.effects[0].spread = 0.125
    pl.render()
    assert controls(panel, 'spread')['text'].value == '0.125'
    pl.ibr.add(pvibr.Vignette()).enabled = False
    pl.render()
    assert [box.group.title for box in panel.groups] == ['Bloom', 'Vignette']
    assert not panel.group('Vignette').enabled.value
    click(panel, 'Remove', 'remove Bloom')
    assert [box.group.title for box in panel.groups] == ['Vignette']
    pl.close()
    assert panel.groups == []
    assert 'the plotter is closed' in said(panel)


def test_presets(panel, pl):
    bloom, box = pl.ibr.effects[0], panel.group('Bloom')
    sent(box.name, 'mine')
    click(panel, 'Keep')
    box.preset.value = 'strong'
    click(panel, 'Apply')
    assert (bloom.intensity, box.preset.value) == (2.0, 'strong')
    box.preset.value = 'mine'
    click(panel, 'Apply')
    assert (bloom.intensity, bloom.threshold) == (1.0, 0.5)
    click(panel, 'Forget')
    assert 'mine' not in box.preset.options
    sent(box.name, 'strong')
    click(panel, 'Keep')
    assert 'must be a new one' in said(panel)
    click(panel, 'Reset all')
    assert bloom.threshold == 1.0


def test_a_broken_file_of_presets_is_said(panel, pl, tmp_path):
    (tmp_path / 'config').mkdir()
    (tmp_path / 'config' / 'presets.json').write_text('{')
    pl.ibr.effects[0].spread = 0.75
    pl.render()
    assert 'presets.json is not JSON' in said(panel)
    assert controls(panel, 'spread')['text'].value == '0.75'


def test_python_and_files(panel, pl, tmp_path):
    click(panel, 'Copy as Python')
    assert 'pvibr.Bloom(threshold=0.5)' in panel.code.value
    assert panel.code.layout.display is None
    sent(panel.path, str(tmp_path / 'a.json'))
    click(panel, 'Save')
    pl.ibr.effects[0].threshold = 0.9
    click(panel, 'Load')
    assert pl.ibr.effects[0].threshold == 0.5


def test_each_control_has_a_label_and_its_help_is_shown_without_hovering(panel):
    row = panel.group('Bloom').row('spread')
    text = next(w for w in everything(row) if isinstance(w, W.HTML) and 'Weight of' in w.value)
    assert text.layout.display == 'none'
    sent(panel.help, True)
    assert text.layout.display is None
    for view in panel.group('Bloom').rows:
        assert next(iter(view.controls.values())).description == view.row.label
        assert all(control.tooltip for control in view.controls.values())


def test_groups_fold(panel):
    box = panel.group('Bloom')
    sent(box.title, False)
    assert box.rows[0] in everything(box)
    assert box.children[-1].layout.display == 'none'
    sent(box.title, True)
    assert box.children[-1].layout.display is None


def test_a_picture_of_its_own_follows(pl):
    from imageio.v3 import imread

    from pvibr_widgets.notebook import notebook_panel

    panel = notebook_panel(pl, picture=True)
    image = next(w for w in everything(panel) if isinstance(w, W.Image))
    np.testing.assert_array_equal(imread(io.BytesIO(image.value)), pl.screenshot(return_img=True))
    before = image.value
    sent(controls(panel, 'intensity')['slider'], 190)
    assert image.value != before
    panel.close()


def test_cells_that_draw_nothing_are_followed_in_ipython(pl, monkeypatch):
    from IPython.core.events import EventManager

    class Shell:
        events = EventManager(None, {'post_run_cell': None})

    import IPython

    monkeypatch.setattr(IPython, 'get_ipython', lambda: Shell)
    from pvibr_widgets.notebook import notebook_panel

    panel = notebook_panel(pl)
    pl.ibr.effects[0].spread = 0.375
    assert controls(panel, 'spread')['text'].value == '0.5'
    Shell.events.trigger('post_run_cell', None)
    assert controls(panel, 'spread')['text'].value == '0.375'
    panel.close()
    panel.close()
    assert Shell.events.callbacks['post_run_cell'] == []
    pl.render()


def test_closed_widgets_are_freed(panel, pl):
    from ipywidgets.widgets.widget import _instances

    def count():
        pl.render()
        return len(_instances)

    first = count()
    for _ in range(3):
        vignette = pl.ibr.add(pvibr.Vignette())
        pl.render()
        pl.ibr.remove(vignette)
        pl.render()
    assert count() == first


def test_without_ipywidgets_the_error_names_the_extra(monkeypatch):
    monkeypatch.setitem(sys.modules, 'ipywidgets', None)
    monkeypatch.delitem(sys.modules, 'pvibr_widgets.notebook', raising=False)
    with pytest.raises(ImportError, match=r"pip install 'pvibr\[jupyter\]'"):
        import pvibr_widgets.notebook  # noqa: F401
    assert pv.OFF_SCREEN


def test_messages_in_other_threads_are_answered_where_the_window_is(pl):
    """As JupyterLab sends them, beside the cells; all that came meanwhile is one picture."""
    from pvibr_widgets.notebook import notebook_panel

    drawn = []
    pl.render_window.AddObserver('EndEvent', lambda *_: drawn.append(threading.get_ident()))

    async def cell():
        panel = notebook_panel(pl)
        slider = controls(panel, 'intensity')['slider']

        def drag():
            for stop in range(0, 200, 10):
                sent(slider, stop)

        thread = threading.Thread(target=drag)
        thread.start()
        thread.join()  # a cell that is busy
        assert pl.ibr.effects[0].intensity == 1.0
        assert drawn == []
        await asyncio.sleep(0.05)
        assert pl.ibr.effects[0].intensity == 3.8
        assert (slider.value, controls(panel, 'intensity')['text'].value) == (190, '3.8')
        panel.close()

    asyncio.run(cell())
    assert drawn == [threading.get_ident()]
