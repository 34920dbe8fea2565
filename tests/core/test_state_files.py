"""States in files: whole or not at all, and what is not understood is named."""

import errno
import json
import os

import pytest
import pyvista as pv
from hypothesis import given
from hypothesis import strategies as st

import pvibr
from pvibr.core import state_files
from pvibr.core.errors import PvibrWarning
from tests.makers import full_disk
from tests.refusals import refused


@pytest.fixture
def pl():
    pl = pv.Plotter(shape=(1, 2), window_size=(64, 32))
    pl.ibr.add(pvibr.Bloom(threshold=0.5))
    pl.subplot(0, 1)
    pl.ibr.add(pvibr.Vignette(color=(1, 0, 0))).enabled = False
    pl.ibr.time, pl.ibr.interactive_frame_ms = 1.5, 50
    return pl


def changed(pl):
    """Change everything; return the bloom and the vignette."""
    bloom, vignette = pl.ibr.contents['0']['Bloom'], pl.ibr.contents['1']['Vignette']
    bloom.threshold, bloom.enabled = 0.9, False
    vignette.color, vignette.enabled = (0, 0, 0), True
    pl.ibr.time, pl.ibr.interactive_frame_ms = 0, 80
    return bloom, vignette


def test_a_file_brings_everything_back(pl, tmp_path):
    before = pl.ibr.state()
    path = tmp_path / 'look.json'
    pl.ibr.save_state(path)
    bloom, vignette = changed(pl)
    pl.ibr.load_state(path)
    assert pl.ibr.state() == before
    assert (bloom.threshold, bloom.enabled, vignette.enabled) == (0.5, True, False)
    assert vignette.color == (1.0, 0.0, 0.0)
    assert json.loads(path.read_text())['version'] == state_files.VERSION
    assert os.listdir(tmp_path) == ['look.json']


def test_a_file_of_another_version_is_applied_as_far_as_it_is_known(pl, tmp_path):
    path = tmp_path / 'look.json'
    pl.ibr.save_state(path)
    values = json.loads(path.read_text())
    values['version'] = 99
    values['moon'] = 'full'
    values['interactive_frame_ms'] = 'swift'
    values['subplots']['0']['Bloom'] |= {'hue': 3, 'blend': 'multiply', 'intensity': 0.25}
    values['subplots']['0']['Ripples'] = {}
    path.write_text(json.dumps(values))
    bloom, _ = changed(pl)
    with pytest.warns(PvibrWarning) as caught:
        pl.ibr.load_state(path)
    changed(pl)
    with pytest.warns(PvibrWarning) as again:
        pl.ibr.load_state_text(path.read_text())
    assert len(caught) == len(again) == 1
    assert str(caught[0].message) == str(again[0].message)
    assert caught[0].filename == again[0].filename == __file__
    names = 'moon', 'plotter.interactive_frame_ms', 'Bloom.hue', "Bloom.blend = 'multiply'"
    for name in (*names, 'subplot 0: Ripples'):
        assert name in str(caught[0].message)
    assert (bloom.threshold, bloom.intensity, bloom.blend) == (0.5, 0.25, 'add')
    assert bloom.enabled


@pytest.mark.parametrize(
    'change',
    [
        {'subplots': {'0': {'Bloom': {'threshold': 0.1}}, '1': {'Vignette': {'radius': 99}}}},
        {'subplots': {'0': {'Bloom': {'threshold': 0.1, 'enabled': 'no'}}}},
        {'subplots': {'0': {'Bloom': {'threshold': 10**400}}}},
        {'subplots': {'0': {'Bloom': ['threshold']}}},
        {'subplots': {'0': 'Bloom'}},
        {'subplots': [1]},
        {'time': 'noon'},
        {'interactive_frame_ms': -1, 'subplots': {'0': {'Bloom': {'threshold': 0.1}}}},
        {'time': 3.0, 'interactive_frame_ms': None},
        {'time': 10**400},
        {'time': None, 'subplots': {'0': {'Bloom': {'threshold': 0.1}}}},
    ],
)
def test_a_wrong_value_changes_nothing(pl, change):
    before = pl.ibr.state()
    text = json.dumps({'pvibr': 'state', 'version': 1} | change)
    refused(r'must be|not JSON', pl.ibr.load_state_text, text, kind=(TypeError, ValueError))
    assert pl.ibr.state() == before


def test_a_text_must_be_text(pl):
    with pytest.raises(TypeError, match='text must be a str or bytes, got nan'):
        pl.ibr.load_state_text(float('nan'))


@pytest.mark.parametrize(
    'text',
    [
        *('', '[]', '3', 'null', '{', '{"version": 1}'),
        '{"pvibr": "presets", "version": 1}',
        '{"pvibr": "state", "version": true}',
        '{"pvibr": "state", "version": "1"}',
        '{"pvibr": "state", "version": 1, "time": NaN}',
        b'\xff\xfe\x00',
        '{"pvibr": "state", "version": 1, "time": -Infinity}',
        '[' * 100_000,
        '{"pvibr": "state", "version": 1, "time": ' + '9' * 10_000 + '}',
        b'\x80\x04K\x01.',
    ],
)
def test_what_is_no_state_is_refused(pl, text):
    before = pl.ibr.state()
    refused(r'the text is not JSON|the text is not a|must be', pl.ibr.load_state_text, text)
    assert pl.ibr.state() == before


SCALARS = st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=4)
NAMES = st.sampled_from(['time', 'subplots', '0', 'Flash', 'at', 'color', 'enabled'])


@given(
    st.recursive(
        SCALARS,
        lambda inner: st.lists(inner, max_size=3) | st.dictionaries(NAMES, inner, max_size=3),
        max_leaves=8,
    )
)
def test_any_values_are_restored_or_refused(state):
    flash = pvibr.Flash()
    contents = {'0': {'Flash': flash}}
    before = state_files.state_of(contents, {})
    try:
        state_files.restore(contents, state)
    except (TypeError, ValueError):
        assert state_files.state_of(contents, {}) == before
    else:
        state_files.to_text('state', state_files.state_of(contents, {}))


def test_a_byte_order_mark_is_no_trouble(pl):
    text = state_files.to_text('state', pl.ibr.state())
    changed(pl)
    pl.ibr.load_state_text(text.encode('utf-8-sig'))
    assert pl.ibr.time == 1.5


def test_a_point_in_focus_is_kept(tmp_path):
    pl = pv.Plotter(window_size=(32, 32))
    lens = pl.ibr.add(pvibr.DepthOfField((1, 2, 3)))
    pl.ibr.save_state(tmp_path / 'a')
    lens.target = None
    pl.ibr.load_state(tmp_path / 'a')
    assert lens.target == (1.0, 2.0, 3.0)


def test_a_full_disk_leaves_the_old_file(pl, tmp_path, monkeypatch):
    path = tmp_path / 'look.json'
    path.write_text('old')
    monkeypatch.setattr(os, 'fsync', full_disk)
    with pytest.raises(OSError, match=r'cannot write .*look\.json: the disk is full') as e:
        pl.ibr.save_state(path)
    assert e.value.errno == errno.ENOSPC
    assert path.read_text() == 'old'
    assert os.listdir(tmp_path) == ['look.json']


def test_folders_and_files_must_be_there(pl, tmp_path):
    with pytest.raises(FileNotFoundError, match='there is no folder'):
        pl.ibr.save_state(tmp_path / 'new' / 'a.json')
    assert not list(tmp_path.iterdir())
    with pytest.raises(FileNotFoundError):
        pl.ibr.load_state(tmp_path / 'none.json')


def test_a_huge_file_is_not_read(tmp_path, monkeypatch):
    monkeypatch.setattr(state_files, 'MOST_BYTES', 10)
    (tmp_path / 'a').write_bytes(b' ' * 11)
    refused('not a settings file', state_files.read, tmp_path / 'a')
