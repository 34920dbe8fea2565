"""Presets of the tests' own, and plotters with things in them."""

import pytest
import pyvista as pv

import pvibr


@pytest.fixture(autouse=True)
def _own_presets(monkeypatch, tmp_path):
    monkeypatch.setenv('PVIBR_CONFIG', str(tmp_path / 'config'))


@pytest.fixture
def pl():
    """A ball with a bloom, drawn."""
    pl = pv.Plotter(window_size=(96, 64))
    pl.add_mesh(pv.Sphere(), color='white')
    pl.ibr.add(pvibr.Bloom(threshold=0.5))
    pl.show(auto_close=False)
    return pl


class Hand:
    """Mouse and keys of a plotter, as its interactor hears of them."""

    def __init__(self, plotter):
        self._interactor = plotter.iren.interactor

    def _event(self, name, pixel, *, shift=False, key=''):
        x, y = (round(float(v)) for v in pixel)
        self._interactor.SetEventInformation(x, y, 0, int(shift), '\0', 0, key)
        getattr(self._interactor, name)()

    def press(self, pixel):
        self._event('MouseMoveEvent', pixel)
        self._event('LeftButtonPressEvent', pixel)

    def move(self, pixel):
        self._event('MouseMoveEvent', pixel)

    def release(self, pixel):
        self._event('LeftButtonReleaseEvent', pixel)

    def drag(self, start, *stops):
        self.press(start)
        for stop in stops:
            self.move(stop)
        self.release(stops[-1] if stops else start)

    def keys(self, *names, shift=False):
        for name in names:
            self._event('KeyPressEvent', (1, 1), key=name, shift=shift)
            self._event('KeyReleaseEvent', (1, 1), key=name, shift=shift)


def colour(pl, pixel):
    """Return the colour at a pixel, counted from below, of a new frame."""
    pl.render()
    x, y = (round(float(v)) for v in pixel)
    return pl.screenshot()[pl.window_size[1] - 1 - y, x].tolist()


@pytest.fixture
def hand():
    return Hand
