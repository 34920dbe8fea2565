"""Sets of settings: all supplied ones are allowed; users' own are kept in one file."""

import os

import pytest

import pvibr
from pvibr.core.params import params_of
from pvibr_widgets.presets import Presets
from tests.refusals import refused


@pytest.fixture
def presets(tmp_path):
    return Presets(tmp_path / 'presets.json')


@pytest.mark.parametrize(
    'kind', [n for n in pvibr.__all__ if getattr(getattr(pvibr, n), 'presets', None)]
)
def test_supplied_sets_are_allowed_and_no_two_are_the_same(kind):
    params = params_of(getattr(pvibr, kind))
    looks = []
    for settings in getattr(pvibr, kind).presets.values():
        looks.append({n: params[n].check(v) for n, v in settings.items()})
        assert looks[-1] != {n: params[n].default for n in settings}
    assert all(looks.count(look) == 1 for look in looks)


def test_a_set_decides_every_setting(presets):
    bloom = pvibr.Bloom(firefly_reduction=1.0)
    presets.apply(bloom, 'strong')
    assert (bloom.intensity, bloom.firefly_reduction) == (2.0, 0.0)
    presets.apply(bloom, 'defaults')
    assert bloom.state() == pvibr.Bloom().state()


def test_kept_sets_come_back_in_another_session(presets):
    lens = pvibr.DepthOfField((0, 0, 1), f_number=1.4)
    presets.keep(lens, ' mine ')
    other = pvibr.DepthOfField()
    again = Presets(presets.path)
    assert again.names(other)[-1] == 'mine'
    again.apply(other, 'mine')
    assert (other.f_number, other.target) == (1.4, None)
    assert 'mine' not in again.names(pvibr.Bloom())
    again.forget(other, 'mine')
    assert 'mine' not in presets.names(other)


@pytest.mark.parametrize('name', ['', '  ', 'defaults', 'strong'])
def test_names_that_are_taken_are_refused(presets, name):
    refused('must be a new one', presets.keep, pvibr.Bloom(), name)
    assert not presets.path.exists()


def test_unknown_and_supplied_sets_cannot_be_applied_or_forgotten(presets):
    with pytest.raises(ValueError, match="no preset 'none'; it has: defaults, subtle, strong"):
        presets.apply(pvibr.Bloom(), 'none')
    refused('must be one that you kept', presets.forget, pvibr.Bloom(), 'strong')


@pytest.mark.parametrize(
    'text',
    [
        '',
        '{}',
        '{"pvibr": "presets", "version": 1}',
        '{"pvibr": "presets", "version": 1, "presets": {"Bloom": [1]}}',
        '{"pvibr": "presets", "version": 1, "presets": {"Bloom": {"a": 3}}}',
    ],
)
def test_a_broken_file_is_said_and_left(presets, text):
    presets.path.write_text(text)
    refused(r'presets\.json', presets.names, pvibr.Bloom())
    refused(r'presets\.json', presets.keep, pvibr.Bloom(), 'mine')
    assert presets.path.read_text() == text


def test_the_file_is_where_the_user_says(tmp_path):
    Presets().keep(pvibr.Bloom(), 'mine')
    assert os.listdir(tmp_path / 'config') == ['presets.json']
