"""Costs of settings: found, named, and everything is as it was afterwards."""

import time

import numpy as np
import pytest
import pyvista as pv

import pvibr
from tests.refusals import refused


class Sleepy(pvibr.Effect):
    """An effect that takes a while."""

    seconds = pvibr.Param(0.05, 'Time that it takes.', range='[0, 1]')

    def prepare(self, frame):
        """Sleep."""
        time.sleep(self.seconds)


def stage(**settings):
    pl = pv.Plotter(off_screen=True, window_size=(120, 90), **settings)
    pl.add_mesh(pv.Sphere(), color='tan')
    pl.enable_anti_aliasing('msaa', multi_samples=4)
    return pl


def test_what_takes_longest_is_found_and_advised():
    pl = stage()
    pl.ibr.add(Sleepy())
    pl.ibr.add(Sleepy(seconds=0.2)).name = 'slower'
    balls = pl.ibr.add_spheres([[2, 0, 0]])
    pl.show(auto_close=False)
    costs = pl.ibr.costs()
    parts = {part.name: part for part in costs.parts}
    assert {'4 samples a pixel', 'Sleepy', 'slower', balls.name} <= set(parts)
    assert parts['Sleepy'].ms == pytest.approx(50, abs=30)
    assert parts['slower'].ms == pytest.approx(200, abs=50)
    assert costs.frame_ms > 240
    assert costs.advice.startswith("pl.ibr['slower'].enabled = False")
    assert not parts[balls.name].remedy
    assert 'most helpful' in str(pl.ibr.report())
    assert 'most helpful' in pl.ibr.report().as_dict()['costs']
    pl.close()
    assert 'most helpful' in str(pl.ibr.report())


@pytest.mark.parametrize('effects', [(pvibr.Fog, pvibr.Shadows), (pvibr.Fog,)])
def test_everything_is_as_it_was(effects):
    pl = stage()
    for effect in effects:
        pl.ibr.add(effect())
    hidden = pl.ibr.add_spheres([[2, 0, 0]])
    hidden.visibility = False
    if pvibr.Shadows not in effects:
        pl.enable_depth_peeling()
    pl.show(auto_close=False)
    before = pl.screenshot()
    switches = [light.GetSwitch() for light in pl.renderer.lights]
    position = pl.camera.position
    pl.ibr.costs(frames=1)
    assert pl.render_window.GetMultiSamples() == 4
    assert pl.renderer.GetUseDepthPeeling() == (pvibr.Shadows not in effects)
    assert [light.GetSwitch() for light in pl.renderer.lights] == switches
    assert pl.camera.position == position
    assert not hidden.visibility
    assert all(effect.enabled for effect in pl.ibr.effects)
    difference = np.abs(pl.screenshot().astype(int) - before)
    assert difference.max() <= 1  # shadow maps are drawn anew
    pl.close()


def test_errors_leave_nothing_off(monkeypatch):
    pl = stage()
    fog = pl.ibr.add(pvibr.Fog(visibility=20.0))
    pl.show(auto_close=False)

    def interrupted(*_):
        if not fog.enabled:
            raise KeyboardInterrupt
        return 1.0

    monkeypatch.setattr('pvibr.api.setting_costs._frame_ms', interrupted)
    with pytest.raises(KeyboardInterrupt):
        pl.ibr.costs()
    assert fog.enabled
    assert pl.render_window.GetMultiSamples() == 4
    pl.close()


def test_what_is_bare_costs_nothing_that_can_be_spared():
    pl = pv.Plotter(off_screen=True, lighting='none')
    pl.add_mesh(pv.Sphere())
    pl.disable_anti_aliasing()
    assert not pl.ibr.costs().advice
    assert 'pl.ibr.costs() measures' not in str(pl.ibr.report())
    for frames in (0, -1, float('nan'), 'many'):
        refused('frames must be', pl.ibr.costs, frames, kind=(TypeError, ValueError))
    pl.close()
    with pytest.raises(pvibr.ClosedError):
        pl.ibr.costs()
