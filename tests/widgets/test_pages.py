"""The panel of pages without a browser: what pages send is done once, or refused."""

from __future__ import annotations

import asyncio
import itertools
import json
import re

import pytest
import pyvista as pv

import pvibr

pytest.importorskip('trame_pyvista', reason="needs trame: pip install 'pvibr[jupyter]'")
from trame.app import get_server
from trame.ui.vuetify3 import VAppLayout

from pvibr_widgets.pages import menu_item, trame_panel

_numbers = itertools.count()


@pytest.fixture
def server():
    return get_server(f'pvibr-panels-{next(_numbers)}', client_type='vue3')


@pytest.fixture
def panel(pl, server):
    with VAppLayout(server) as layout:
        panel = trame_panel(pl, server)
    panel.html = layout.html
    yield panel
    panel.close()


def bloom_of(panel):
    return next(g for g in panel.shown['groups'] if g['title'] == 'Bloom')['id']


def shown(panel, name):
    group = next(g for g in panel.shown['groups'] if g['title'] == 'Bloom')
    return next(r for r in group['rows'] if r['name'] == name)


def test_the_page_has_one_variable_and_each_control_a_label(panel, server):
    assert server.state[panel.name] == panel.shown == json.loads(json.dumps(panel.shown))
    assert not re.search(r'\b(PANEL|ACT|SAVE|ROWS)', panel.html)
    assert panel.name in panel.html
    for control in re.findall(r'<(?:input|select|textarea)\b[^>]*>', panel.html):
        assert re.search(r'\bid=|aria-label=|type="(?:file|checkbox)"', control), control
    for name in re.findall(r':for=\"([^\"]*)\"', panel.html):
        assert f':id="{name}"' in panel.html


def test_what_pages_ask_for_is_done(panel, pl, server):
    bloom, at = pl.ibr.effects[0], bloom_of(panel)
    assert panel.act('move', at, 'intensity', '150') == '3'
    assert panel.act('write', at, 'threshold', '0.25') == '0.25'
    assert panel.act('choose', at, 'blend', '1') == 'screen'
    assert panel.act('set', at, 'background', True) == 'True'
    assert panel.act('derive', at, 'levels', False) != ''
    assert (bloom.intensity, bloom.threshold, bloom.blend) == (3.0, 0.25, 'screen')
    assert bloom.background
    assert bloom.levels is not None
    assert server.state[panel.name]['groups'][0]['rows'][0]['stop'] == 150
    panel.act('reset', at, 'levels')
    assert bloom.levels is None
    panel.act('apply', at, 'strong')
    assert bloom.intensity == 2.0
    panel.act('switch', at, False)
    assert not bloom.enabled
    panel.act('reset_all')
    assert bloom.threshold == 1.0
    panel.act('code')
    assert 'bloom' not in panel.shown['code']
    assert 'pvibr.Bloom' in panel.shown['code']
    panel.act('remove', at)
    assert pl.ibr.effects == ()
    assert server.state[panel.name]['groups'] == []


def test_settings_of_the_plotter_itself(panel, pl):
    assert panel.act('write', '', 'interactive_frame_ms', '50') == '50'
    assert pl.ibr.interactive_frame_ms == 50.0
    assert panel.shown['own']['rows'][0]['text'] == '50'
    assert panel.act('remove', '') == panel.act('write', '', 'time', '3') == ''


def test_states_go_out_and_come_in(panel, pl):
    bloom = pl.ibr.effects[0]
    text = panel.state_text()
    bloom.threshold = 0.9
    panel.act('load', text)
    assert bloom.threshold == 0.5
    panel.act('load', '{"time": NaN}')
    assert 'not JSON' in panel.shown['message']


@pytest.mark.parametrize(
    'asked',
    [
        (),
        ('move',),
        ('move', 'x', 'intensity', 1),
        ('move', 'BLOOM'),
        ('move', 'BLOOM', 'gone', 1),
        ('move', 'BLOOM', 'intensity'),
        ('move', 'BLOOM', 'intensity', None),
        ('move', 'BLOOM', 'intensity', 'NaN'),
        ('move', 'BLOOM', 'intensity', [1]),
        ('move', 'BLOOM', 'intensity', 1, 2),
        ('__init__', 'BLOOM', 'intensity', 1),
        ('set', 'BLOOM', '__class__', 1),
        ('close',),
        ('write', 'BLOOM', 'intensity', '-1'),
        ('paint', 'BLOOM', 'intensity', {}),
        ('choose', 'BLOOM', 'blend', 'add'),
        ('choose', 'BLOOM', 'blend', 99),
        ('load', 3),
        ('load', '[' * 10_000),
        ('keep', 'BLOOM', ''),
        ('apply', 'BLOOM', '../x'),
        ('set', 'BLOOM', ['intensity'], 1),
    ],
)
def test_what_is_not_understood_changes_nothing(panel, pl, asked):
    before = pl.ibr.state()
    at = bloom_of(panel)
    action, *rest = [at if a == 'BLOOM' else a for a in asked] or ['']
    panel.act(action, *rest)
    assert pl.ibr.state() == before
    assert bloom_of(panel) == at


def test_many_moves_are_one_picture(panel, pl, server):
    bloom, at, frames, pushed = pl.ibr.effects[0], bloom_of(panel), [], []
    pl.render_window.AddObserver('EndEvent', lambda *_: frames.append(bloom.intensity))
    server.state.change(panel.name)(lambda **_: pushed.append(1))

    async def drag():
        for stop in range(0, 200, 10):
            panel.act('move', at, 'intensity', stop)
        assert frames == []
        await asyncio.sleep(0.2)
        assert shown(panel, 'intensity')['stop'] == 190

    asyncio.run(drag())
    assert frames == [3.8]
    assert server.state[panel.name]['groups'][0]['rows'][0]['stop'] == 190


def test_pages_follow_code_and_closing(panel, pl, server):
    pl.ibr.effects[0].spread = 0.125
    pl.ibr.add(pvibr.Vignette())
    pl.render()
    assert [g['title'] for g in server.state[panel.name]['groups']] == ['Bloom', 'Vignette']
    assert shown(panel, 'spread')['text'] == '0.125'
    at = bloom_of(panel)
    pl.close()
    assert server.state[panel.name]['groups'] == []
    assert server.state[panel.name]['message'] == 'the plotter is closed'
    assert panel.act('move', at, 'spread', 1) == ''


def test_views_of_others_are_updated(pl, server):
    updates = []
    with VAppLayout(server):
        panel = trame_panel(pl, server, update=lambda: updates.append(1))
    panel.act('move', bloom_of(panel), 'spread', 10)
    assert updates == [1]
    panel.close()


def test_a_panel_in_the_menu_of_pyvista(pl, server):
    from trame_pyvista.ui import plotter_ui

    with VAppLayout(server) as layout:
        plotter_ui(pl, mode='server', server=server, add_menu_items=menu_item(pl))
    assert layout.html.count('class="pvibr-panel"') == 1
    drawer = re.search(r'v-show="(pvibr_drawer_\d+)"', layout.html)[1]
    assert server.state[drawer] is False
    assert f'@click="{drawer} = !{drawer}"' in layout.html


def test_panel_finds_where_it_is(pl, server, monkeypatch):
    import pvibr_widgets
    from pvibr_widgets.pages import PagePanel

    with VAppLayout(server):
        panel = pvibr_widgets.panel(pl, server=server)
    assert isinstance(panel, PagePanel)
    panel.close()
    with pytest.raises(RuntimeError, match='no page, Qt window or notebook'):
        pvibr_widgets.panel(pl)

    class Shell:
        kernel, events = None, None

    import IPython

    from pvibr_widgets.notebook import Panel

    Shell.events = IPython.core.events.EventManager(None, {'post_run_cell': None})
    monkeypatch.setattr(IPython, 'get_ipython', lambda: Shell)
    panel = pvibr_widgets.panel(pl)
    assert isinstance(panel, Panel)
    panel.close()
    assert isinstance(pl, pv.Plotter)
