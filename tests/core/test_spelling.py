"""What is misspelt is an error that names what was meant."""

import inspect

import pytest
import pyvista as pv

import pvibr
from pvibr.effects import ORDER


@pytest.fixture
def pl():
    plotter = pv.Plotter(off_screen=True, window_size=(60, 40))
    yield plotter
    plotter.close()


def test_settings_of_effects(pl):
    bloom = pvibr.Bloom()
    with pytest.raises(AttributeError, match=r"Bloom has no attribute 'treshold'.*'threshold'"):
        bloom.treshold = 0.5
    pl.ibr.add(bloom)
    bloom.threshold = 0.25
    bloom.name = 'bright'
    assert bloom.threshold == 0.25
    assert 'treshold' not in vars(bloom)


def test_attributes_of_the_plotters_component(pl):
    with pytest.raises(AttributeError, match=r"no attribute 'tyme'.*'time'"):
        pl.ibr.tyme = 3.0
    pl.ibr.time = 3.0
    with pytest.raises(AttributeError, match='see dir'):
        pl.ibr.qqqqqqqqqqq = 3.0


def test_effects_of_users_set_what_they_like(pl):
    class Own(pvibr.Effect):
        level = pvibr.Param(1.0, 'Level.')

        def __init__(self, **settings):
            super().__init__(**settings)
            self.made = 1

        def prepare(self, frame):
            self.counted = self.made = 2

    own = pl.ibr.add(Own(level=2.0))
    pl.add_mesh(pv.Sphere())
    pl.show(auto_close=False)
    assert own.enabled
    assert (own.counted, own.made) == (2, 2)


def test_all_effects_are_checked():
    classes = [getattr(pvibr, n) for n in ORDER if inspect.isclass(getattr(pvibr, n, None))]
    assert len(classes) > 5
    for cls in classes:
        assert cls.__setattr__ is not object.__setattr__
