"""Rows: what is allowed arrives in the setting, what is not is said and changes nothing."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

import pvibr
from pvibr.core.effect import Effect
from pvibr.core.params import Param, params_of
from pvibr_widgets.rows import Row, from_hex, text_of, to_hex


class Lamp(Effect):
    power = Param(None, 'How bright.', range='(0, inf)', unit='W', kind=float)
    count = Param(3, 'How many.', range='[1, 9]')
    on = Param(True, 'Whether.')
    mode = Param('soft', 'How.', choices=('soft', 'hard', ''))
    tint = Param((1.0, 0.5, 0.0), 'Colour.', range='[0, 1]')
    place = Param((0.0, 0.0), 'Where.')
    label = Param('lamp', 'What it is called.')
    back = Param(None, 'Background.', range='[0, 1]', kind=tuple)


@pytest.fixture
def lamp():
    return Lamp()


def row(lamp, name):
    return Row(lamp, params_of(Lamp)[name], size=10)


def test_each_has_its_control(lamp):
    kinds = {name: row(lamp, name).kind for name in params_of(Lamp)}
    assert kinds == {
        'power': 'number',
        'count': 'number',
        'on': 'switch',
        'mode': 'choice',
        'tint': 'color',
        'place': 'numbers',
        'label': 'text',
        'back': 'numbers',
    }


def test_label_help_and_choices_are_those_of_the_setting(lamp):
    assert row(lamp, 'power').label == 'power (W)'
    assert Row(pvibr.Impostor.__new__(pvibr.Impostor), pvibr.Impostor.budget_ms).label == (
        'budget (ms)'
    )
    assert row(lamp, 'count').help == 'How many. Default 3; an int in [1, 9].'
    assert row(lamp, 'mode').choices == ['soft', 'hard', 'none']


@pytest.mark.parametrize(
    ('name', 'text', 'value'),
    [
        ('power', ' 2.5 ', 2.5),
        ('count', '7', 7),
        ('place', '1, -2.5', (1.0, -2.5)),
        ('place', '(1, 2)', (1.0, 2.0)),
        ('label', ' new ', 'new'),
        ('power', '1e-7', 1e-7),
    ],
)
def test_texts_are_understood(lamp, name, text, value):
    assert row(lamp, name).write(text)
    assert getattr(lamp, name) == value


@pytest.mark.parametrize(
    ('name', 'text'),
    [
        ('power', '-1'),
        ('power', 'nan'),
        ('power', 'inf'),
        ('power', ''),
        ('count', '2.5'),
        ('count', '99'),
        ('place', '1'),
        ('place', '1, 2, 3'),
        ('place', '1; 2'),
        ('tint', 'red'),
    ],
)
def test_bad_texts_are_said_and_change_nothing(lamp, name, text):
    before = lamp.state()
    mine = row(lamp, name)
    assert not mine.write(text)
    assert mine.error.startswith(f'Lamp.{name} must be ')
    assert lamp.state() == before
    assert lamp.revision == 0


def test_an_error_goes_with_the_next_good_value_whoever_gives_it(lamp):
    mine = row(lamp, 'count')
    mine.write('x')
    assert mine.error
    lamp.count = 5
    assert not mine.error
    mine.write('x')
    mine.write('5')
    assert not mine.error


def test_a_slider_moves_the_value_and_follows_it(lamp):
    mine = row(lamp, 'count')
    assert (mine.stop, mine.scale.last) == (2, 8)
    assert mine.move(8)
    assert lamp.count == 9
    lamp.count = 1
    assert mine.stop == 0


def test_a_slider_that_was_not_moved_changes_nothing(lamp):
    lamp.power = 1.2345
    mine = row(lamp, 'power')
    mine.move(mine.stop)
    assert lamp.power == 1.2345


def test_a_slider_grows_with_values_and_does_not_shrink(lamp):
    mine = row(lamp, 'power')
    end = mine.scale.high
    lamp.power = 1e6
    assert mine.scale.high == 1e6 > end
    assert mine.stop == mine.scale.last
    lamp.power = 1
    assert mine.scale.high == 1e6


def test_derived_is_a_tick_of_its_own(lamp):
    mine = row(lamp, 'power')
    assert mine.optional
    assert mine.derived
    assert mine.text == ''
    assert mine.derive(False)
    assert lamp.power == mine.scale.at(mine.stop) > 0
    assert mine.derive(True)
    assert lamp.power is None
    back = row(lamp, 'back')
    back.derive(False)
    assert len(lamp.back) == 4
    assert not row(lamp, 'count').optional


def test_choices_and_colours(lamp):
    mode = row(lamp, 'mode')
    mode.choose(2)
    assert (lamp.mode, mode.choice) == ('', 2)
    for index in (-1, 3):
        assert not mode.choose(index)
    assert lamp.mode == ''
    tint = row(lamp, 'tint')
    tint.paint(tint.color)
    assert lamp.tint == (1.0, 0.5, 0.0)
    tint.paint('#ff0080')
    assert lamp.tint == pytest.approx((1, 0, 128 / 255), abs=1e-5)
    assert not tint.paint('#ff00')
    assert 'Lamp.tint' in tint.error


def test_reset_is_the_default(lamp):
    lamp.count, lamp.power = 8, 3
    assert row(lamp, 'count').reset()
    assert row(lamp, 'power').reset()
    assert (lamp.count, lamp.power) == (3, None)


@given(st.tuples(*[st.integers(0, 255)] * 3))
def test_colours_come_back(color):
    text = '#' + bytes(color).hex()
    assert to_hex(from_hex(text)) == text


@given(st.floats(allow_nan=False, allow_infinity=False))
def test_numbers_come_back(number):
    assert float(text_of(number)) == number


@given(st.text())
def test_any_text_is_taken_or_refused(text):
    lamp = Lamp()
    for param in params_of(Lamp).values():
        mine = Row(lamp, param)
        before = lamp.state()
        if not mine.write(text):
            assert mine.error
            assert lamp.state() == before


def test_every_setting_of_every_effect_has_a_row():
    for name in pvibr.__all__:
        kind = getattr(pvibr, name)
        if isinstance(kind, type) and issubclass(kind, Effect):
            for param in params_of(kind).values():
                thing = kind.__new__(kind)  # VTK makes its own objects
                mine = Row(thing, param)
                assert mine.help.startswith(param.doc)
                assert mine.kind in ('number', 'switch', 'choice', 'color', 'numbers', 'text')
