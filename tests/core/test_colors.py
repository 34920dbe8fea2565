"""Colours of settings and of items are whatever PyVista takes as one."""

import numpy as np
import pytest
import pyvista as pv

import pvibr
from pvibr.core.colors import Color
from pvibr.core.effect import Effect
from pvibr.core.params import params_of
from tests.refusals import refused
from tests.things.test_keywords import OF_ITEMS

EFFECTS = [getattr(pvibr, name) for name in pvibr.EFFECTS]
SETTINGS = [
    pytest.param(kind, name, id=f'{kind.__name__}.{name}')
    for kind in EFFECTS
    if isinstance(kind, type) and issubclass(kind, Effect)
    for name, param in params_of(kind).items()
    if isinstance(param, Color)
]
SAME = ['tomato', '#ff6347', 'ff6347', (255, 99, 71), np.array([255, 99, 71], np.uint8)]
SAME += [pv.Color('tomato'), (1.0, 99 / 255, 71 / 255), [255, 99, 71, 255]]
BAD = ['no color', (1.0, 2.5), 3, None, [-1, 0, 0], ('r', 'g', 'b'), {}, (np.nan, 0.0, 0.0)]


@pytest.mark.parametrize(('kind', 'name'), SETTINGS)
def test_settings_take_what_pyvista_takes(kind, name):
    effect = kind.__new__(kind)
    for color in SAME:
        setattr(effect, name, color)
        assert getattr(effect, name) == pytest.approx(pv.Color('tomato').float_rgb)
    optional = params_of(kind)[name].default is None
    for color in (color for color in BAD if not (optional and color is None)):
        with pytest.raises((TypeError, ValueError), match=rf'{kind.__name__}\.{name} must be'):
            setattr(effect, name, color)
    assert getattr(effect, name) == pytest.approx(pv.Color('tomato').float_rgb)
    setattr(effect, name, (0, 0, 1))  # whole numbers up to 1 are fractions, as ever
    assert getattr(effect, name) == (0.0, 0.0, 1.0)


def test_all_settings_that_are_colours_are_such():
    found = {p.id for p in SETTINGS}
    assert {'Outline.color', 'Sky.top', 'Vignette.color', 'Iris.color', 'Flash.color'} <= found
    others = [
        f'{kind.__name__}.{name}'
        for kind in EFFECTS
        for name, param in params_of(kind).items()
        if not isinstance(param, Color) and 'color' in name
    ]
    assert not others


@pytest.mark.parametrize('kind', OF_ITEMS)
def test_colours_of_items_are_names_too(kind):
    pl = pv.Plotter(off_screen=True)
    wanted = [[255, 0, 0], [0, 0, 255], [1, 2, 3]]
    for colors in (['r', 'blue', '#010203'], np.array(['red', 'b', '#010203'])):
        assert OF_ITEMS[kind](pl.ibr, colors=colors).colors.tolist() == wanted
    thing = OF_ITEMS[kind](pl.ibr, colors=[pv.Color(c) for c in ('r', 'b', '#010203')])
    assert thing.colors.tolist() == wanted
    thing.colors = 'lime'
    assert thing.colors.tolist() == [[0, 255, 0]] * 3
    if hasattr(thing, 'update'):
        thing.update([1, 2], colors=['r', 'b'])
        assert thing.colors.tolist() == [[0, 255, 0], [255, 0, 0], [0, 0, 255]]
    before = list(pl.actors.items())
    for bad in (['r', 'b'], ['r', 'b', 'no'], 'no', 3, [['r', 'g', 'b']]):
        refused('colors', OF_ITEMS[kind], pl.ibr, kind=(TypeError, ValueError), colors=bad)
    assert list(pl.actors.items()) == before
