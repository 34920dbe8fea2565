"""Settings: what is allowed is kept, what is not changes nothing."""

import json
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pvibr.core.effect import Effect
from pvibr.core.params import Interval, Param, params_of
from tests.refusals import refused


class Base(Effect):
    amount = Param(0.5, 'How much.', range='[0, 1]', unit='px')


class Lamp(Base):
    power = Param(None, 'How bright.', range='(0, inf)', unit='W', kind=float)
    count = Param(3, 'How many.', range='[1, 9]')
    on = Param(True, 'Whether.')
    mode = Param('soft', 'How.', choices=('soft', 'hard'))
    tint = Param((1.0, 0.5, 0.0), 'Colour.', range='[0, 1]')


GOOD = {'amount': 1, 'power': 2.5, 'count': np.int64(9), 'on': np.bool_(False), 'mode': 'hard'}
GOOD['tint'] = np.array([0, 1, 0.5], np.float32)
WRONG_TYPE = [('amount', 'x'), ('amount', True), ('amount', None), ('count', 2.0), ('on', 1)]
WRONG_TYPE += [('mode', 3), ('tint', 0.5), ('tint', ('a', 'b', 'c')), ('power', [1.0])]
WRONG_VALUE = [('amount', 1.01), ('amount', math.nan), ('amount', -math.inf), ('power', 0.0)]
WRONG_VALUE += [('power', math.inf), ('count', 0), ('mode', 'other'), ('tint', (0, 0, 2))]
WRONG_VALUE += [('tint', (0.0, 0.0)), ('tint', (0, 0, math.nan))]


def test_settings_are_listed_bases_first():
    assert list(params_of(Lamp)) == ['amount', 'power', 'count', 'on', 'mode', 'tint']


def test_good_values_are_kept_in_their_own_type():
    lamp = Lamp(**GOOD)
    kinds = {n: type(getattr(lamp, n)) for n in GOOD}
    assert kinds == {
        'amount': float,
        'power': float,
        'count': int,
        'on': bool,
        'mode': str,
        'tint': tuple,
    }


@pytest.mark.parametrize(
    ('error', 'name', 'value'),
    [(TypeError, *wrong) for wrong in WRONG_TYPE]
    + [(ValueError, *wrong) for wrong in WRONG_VALUE],
)
def test_wrong_values_raise_and_change_nothing(error, name, value):
    lamp = Lamp()
    refused(rf'Lamp\.{name} must be .*, got ', setattr, lamp, name, value, kind=error)
    assert lamp.state() == Lamp().state()
    assert lamp.revision == 0


def test_message_names_range_and_unit():
    refused(r'a float in \(0, inf\) W or None \(derived', Lamp, power=-1)


def test_revision_counts_changes_only():
    lamp = Lamp()
    lamp.amount = 0.5
    assert lamp.revision == 0
    lamp.amount = 0.25
    lamp.power = 3
    assert lamp.revision == 2
    assert Lamp().amount == 0.5


def test_unknown_setting():
    with pytest.raises(TypeError, match=r'Lamp has no setting brightness; it has: amount, power'):
        Lamp(brightness=1)


def test_state_survives_json():
    lamp = Lamp(**GOOD)
    other = Lamp()
    assert other.restore(json.loads(json.dumps(lamp.state()))) == []
    assert other.state() == lamp.state()
    assert Lamp().state()['power'] is None


def test_restore_is_all_or_nothing_and_names_the_unknown():
    lamp = Lamp()
    refused('count', lamp.restore, {'amount': 0.1, 'count': 99})
    assert lamp.amount == 0.5
    assert lamp.restore({'amount': 0.1, 'gone': 1}) == ['gone']
    assert lamp.amount == 0.1


def test_default_is_checked_too():
    error = RuntimeError if not hasattr(BaseException, 'add_note') else (RuntimeError, ValueError)
    with pytest.raises(error):
        type('Bad', (), {'x': Param(2.0, 'Too much.', range='[0, 1]')})


@pytest.mark.parametrize(
    'text', ['', '0, 1', '[1, 0]', '[a, 1]', '[0; 1]', '[0, 1, 2]', '[nan, 1]']
)
def test_broken_ranges(text):
    refused('two ordered bounds', Interval, text)


@given(st.floats(-10, 10), st.floats(0, 10), st.floats(allow_nan=True))
def test_interval_is_what_it_says(low, width, x):
    high = low + width
    closed, opened = Interval(f'[{low!r}, {high!r}]'), Interval(f'({low!r}, {high!r})')
    assert (x in closed) == (low <= x <= high)
    assert (x in opened) == (low < x < high)


@given(st.floats())
def test_any_float_is_kept_or_refused(x):
    lamp = Lamp()
    try:
        lamp.amount = x
    except ValueError:
        assert not 0 <= x <= 1
    else:
        assert lamp.amount == x


def test_docs_come_from_the_declaration():
    assert Lamp.count.__doc__ == 'How many. Default 3; an int in [1, 9].'
