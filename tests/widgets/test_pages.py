"""The panel of pages without a browser: what pages send is done once, or refused."""

import asyncio
import itertools
import json
import re

import numpy as np
import pytest
import pyvista as pv
from PIL import Image

import pvibr
from tests.refusals import refused

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


def test_the_page_has_one_variable_and_one_element(panel, server):
    assert server.state[panel.name] == panel.shown == json.loads(json.dumps(panel.shown))
    assert panel.html.count('<pvibr-panel ') == 1
    assert f':data.prop="{panel.name}"' in panel.html


def test_what_pages_ask_for_is_done(panel, pl, server):
    bloom, at = pl.ibr.effects[0], bloom_of(panel)
    assert panel.act('move', at, 'intensity', '150')['text'] == '3'
    assert panel.act('write', at, 'threshold', '0.25')['text'] == '0.25'
    assert panel.act('choose', at, 'blend', '1')['text'] == 'screen'
    assert panel.act('set', at, 'background', True)['text'] == 'True'
    assert panel.act('derive', at, 'levels', False)['text'] != ''
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
    assert 'pvibr.Bloom' in panel.act('code')['text']
    panel.act('remove', at)
    assert pl.ibr.effects == ()
    assert server.state[panel.name]['groups'] == []


def test_settings_of_the_plotter_itself(panel, pl):
    assert panel.act('write', '', 'interactive_frame_ms', '50')['text'] == '50'
    assert pl.ibr.interactive_frame_ms == 50.0
    row = panel.shown['own']['rows'][0]
    assert (row['text'], row['unit']) == ('50', 'ms')
    assert row['low'] <= 50 <= row['high']
    assert panel.act('remove', '') == panel.act('write', '', 'time', '3')
    assert panel.act('remove', '')['text'] == ''


def test_states_go_out_and_come_in(panel, pl):
    bloom = pl.ibr.effects[0]
    text = panel.act('save')['text']
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
    assert panel.act('move', at, 'spread', 1)['text'] == ''


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
    refused('no page, Qt window or notebook', pvibr_widgets.panel, pl, kind=RuntimeError)


@pytest.mark.parametrize('kind', ['Projector', 'Photo mesh'])
def test_the_slider_of_a_photograph_seen_from_its_camera(server, tmp_path, kind):
    """From nothing to the photograph itself, in equal steps."""
    picture = np.indices((48, 64))[1] // 8 % 2 * 200 + 20
    picture = np.repeat(picture[..., None], 3, 2).astype(np.uint8)
    Image.fromarray(picture).save(tmp_path / '0.png')
    K = [[60.0, 0, 33.5], [0, 60.0, 22.5], [0, 0, 1]]
    camera = pvibr.Pinhole(K, np.diag([1.0, -1.0, -1.0]), [0.1, 0.0, 3.0], (64, 48))
    photo = pvibr.Photo('0.png', camera, tmp_path / '0.png')
    pl = pv.Plotter(window_size=(64, 48), lighting='none')
    plane = pv.Plane(i_size=9, j_size=9, i_resolution=20, j_resolution=20)
    if kind == 'Projector':
        pl.add_mesh(plane, color='magenta')
        pl.ibr.add(pvibr.Projector(photo))
    else:
        pl.ibr.add_photos(plane, photo, color='magenta')
    pl.ibr.fly_to(photo, frames=1)
    pl.show(auto_close=False)
    with VAppLayout(server):
        panel = trame_panel(pl, server)
    at = next(g['id'] for g in panel.shown['groups'] if 'pacity' in str(g['rows']))
    seen = []
    for place in ('0', '100', '200'):
        panel.act('move', at, 'opacity', place)
        pl.render()
        seen.append(pl.screenshot(return_img=True).astype(int))
    panel.close()
    assert (seen[0] == [255, 0, 255]).all()
    assert np.abs(seen[2] - picture).max(2)[:, 2:-2].mean() < 12
    assert np.abs(seen[1] - (seen[0] + seen[2]) / 2).max() <= 2
