"""The panel of notebooks, by the messages that it gets from the page."""

import asyncio
import sys
import threading

import numpy as np
import pytest
import pyvista as pv
from imageio.v3 import imread

import pvibr
from tests.refusals import refused

pytest.importorskip('anywidget', reason="needs pip install 'pvibr[jupyter]'")


@pytest.fixture
def panel(pl):
    from pvibr_widgets.notebook import notebook_panel

    panel = notebook_panel(pl)
    yield panel
    panel.close()


def sent(panel, *args):
    """Let the page ask for something; return what it is answered."""
    answers, panel.widget.send = [], lambda content, buffers=None: answers.append(content)
    panel.widget._handle_custom_msg({'id': 'a', 'args': list(args)}, [])
    del panel.widget.send
    return answers[-1] if answers else None


def row(panel, name):
    return next(r for r in panel.widget.shown['groups'][0]['rows'] if r['name'] == name)


def bloom_of(panel):
    return panel.widget.shown['groups'][0]['id']


def seen(panel):
    return imread(panel.widget.picture).astype(float)


def test_a_slider_moved_is_answered_shown_and_in_the_picture(panel, pl):
    before = seen(panel)
    assert np.abs(before - pl.screenshot(return_img=True)).mean() < 1
    answer = sent(panel, 'move', bloom_of(panel), 'intensity', 150)
    assert (answer['id'], answer['text']) == ('a', '3')
    assert pl.ibr.effects[0].intensity == 3.0
    assert (row(panel, 'intensity')['text'], panel.widget.shown['done']) == ('3', answer['turn'])
    assert np.abs(seen(panel) - before).max() > 10
    assert np.abs(seen(panel) - pl.screenshot(return_img=True)).mean() < 1


def test_a_text_is_taken_or_said(panel, pl):
    at = bloom_of(panel)
    assert sent(panel, 'write', at, 'threshold', 'much')['text'] == '0.5'
    assert 'Bloom.threshold must be a float' in row(panel, 'threshold')['error']
    sent(panel, 'write', at, 'threshold', '7.5')
    assert (row(panel, 'threshold')['text'], row(panel, 'threshold')['error']) == ('7.5', '')
    assert row(panel, 'threshold')['high'] == 7.5


def test_the_panel_follows_code(panel, pl):
    pl.ibr.effects[0].spread = 0.125
    pl.render()
    assert row(panel, 'spread')['text'] == '0.125'
    pl.ibr.add(pvibr.Vignette())
    pl.render()
    assert [g['title'] for g in panel.widget.shown['groups']] == ['Bloom', 'Vignette']
    pl.close()
    assert panel.widget.shown['groups'] == []
    assert panel.widget.shown['message'] == 'the plotter is closed'
    assert sent(panel, 'point', 'in', 0.5, 0.5)['text'] == ''


def test_mouse_wheel_and_keys_turn_the_view(panel, pl):
    def turns(*points):
        before, camera = seen(panel), pl.camera.position
        for action, *place in points:
            sent(panel, 'point', action, *place)
        assert pl.camera.position != camera
        assert not np.array_equal(seen(panel), before)

    pl.add_mesh(pv.Cube())
    turns(('press', 0.5, 0.5), ('move', 0.7, 0.6), ('release', 0.7, 0.6))
    turns(('in', 0.5, 0.5))
    turns(('left', 0.5, 0.5))
    for nonsense in ((), ('press',), ('press', 'x', 0), ('delete', 0, 0), ('in', None, 1)):
        sent(panel, 'point', *nonsense)


def test_cells_that_draw_nothing_are_followed_in_ipython(pl, monkeypatch):
    import IPython
    from IPython.core.events import EventManager

    import pvibr_widgets

    class Shell:
        kernel, events = None, EventManager(None, {'post_run_cell': None})

    monkeypatch.setattr(IPython, 'get_ipython', lambda: Shell)
    panel = pvibr_widgets.panel(pl, picture=False)
    assert (panel.widget.picture, panel.widget.size) == (b'', [])
    assert 'application/vnd.jupyter.widget-view+json' in panel._repr_mimebundle_()[0]
    pl.ibr.effects[0].spread = 0.375
    assert row(panel, 'spread')['text'] == '0.5'
    Shell.events.trigger('post_run_cell', None)
    assert row(panel, 'spread')['text'] == '0.375'
    panel.close()
    panel.close()
    assert Shell.events.callbacks['post_run_cell'] == []
    pl.render()


def test_without_anywidget_the_error_names_the_extra(pl, monkeypatch):
    from pvibr_widgets import notebook

    notebook._widget_class.cache_clear()
    monkeypatch.setitem(sys.modules, 'anywidget', None)
    refused(r"pip install 'pvibr\[jupyter\]'", notebook.notebook_panel, pl, kind=ImportError)


def test_messages_in_other_threads_are_answered_where_the_window_is(pl):
    """As JupyterLab sends them, beside the cells; all that came meanwhile is one picture."""
    from pvibr_widgets.notebook import notebook_panel

    drawn = []
    pl.render_window.AddObserver('EndEvent', lambda *_: drawn.append(threading.get_ident()))

    async def cell():
        panel = notebook_panel(pl)
        drawn.clear()

        def drag():
            for stop in range(0, 200, 10):
                args = ['move', bloom_of(panel), 'intensity', stop]
                panel.widget._handle_custom_msg({'id': stop, 'args': args}, [])

        thread = threading.Thread(target=drag)
        thread.start()
        thread.join()  # a cell that is busy
        assert pl.ibr.effects[0].intensity == 1.0
        assert drawn == []
        await asyncio.sleep(0.3)
        assert pl.ibr.effects[0].intensity == 3.8
        assert (row(panel, 'intensity')['stop'], row(panel, 'intensity')['text']) == (190, '3.8')
        before = panel.widget.picture
        pl.ibr.effects[0].intensity = 0.0  # as an animation would, with a frame of its own
        pl.render()
        await asyncio.sleep(0)
        await asyncio.sleep(0)
        assert panel.widget.picture != before
        panel.close()

    asyncio.run(cell())
    assert drawn == [threading.get_ident()] * 2


def test_time_goes_on_in_the_picture(pl):
    """Where no other view of the plotter is."""
    from pvibr_widgets.notebook import notebook_panel

    pl.add_mesh(pv.Cube(), color='tomato')
    begin = pl.ibr.time

    async def cell():
        panel = notebook_panel(pl)
        before = panel.widget.frame
        pl.ibr.play()
        while panel.widget.frame < before + 3:
            await asyncio.sleep(0.02)
        pl.ibr.stop()
        panel.close()

    asyncio.run(asyncio.wait_for(cell(), 60))
    assert pl.ibr.time > begin
