"""Exceptions in code of users: the picture goes on, and the error is told once."""

from __future__ import annotations

import warnings

import numpy as np
import pytest
import pyvista as pv

import pvibr
from tests.pictures import plotter, shot

#: What a pipeline asks of an effect before, in and after a frame.
HOOKS = [
    *('as_sampled', 'needed', 'is_prepared', 'prepare', 'finish', 'render', 'deactivate'),
    *('lens_of', 'reach', 'expose', 'horizon_color', 'content_key', 'report', 'pick'),
    *('triangles_of', 'bake_into', 'is_gone'),
]
#: Those that are properties.
VALUES = ['surfaces', 'lives', 'one_sample', 'rests', 'unfinished', 'pending', 'metered', 'props']
#: What only a call of a user asks, which raises.
ASKED = {'report', 'pick', 'bake_into'}


def effect_that_fails_in(hook):
    """Return an image effect of which one hook raises an error."""

    def fails(self, *_):
        raise ZeroDivisionError(hook)

    def render(self, frame, picture):
        return None

    member = property(fails) if hook in VALUES else fails
    return type('Broken', (pvibr.Effect,), {'render': render, hook: member})()


@pytest.mark.parametrize('hook', [*HOOKS, *VALUES])
def test_error_in_a_hook(hook):
    pl = plotter((40, 30))
    pl.add_mesh(pv.Cone())
    pl.show(auto_close=False)
    before = shot(pl)
    try:
        effect = pl.ibr.add(effect_that_fails_in(hook))
    except ZeroDivisionError:
        assert not pl.ibr.effects
        np.testing.assert_array_equal(shot(pl), before)
        return
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter('always')
        for k in range(3):
            if hook == 'deactivate' and k == 1:
                effect.enabled = False
            np.testing.assert_array_equal(shot(pl), before)
    said = [str(w.message) for w in caught]
    assert len(said) <= 1
    assert all(
        f'Broken is off, the picture is drawn without it: ZeroDivisionError: {hook}' in s
        for s in said
    )
    if hook not in ASKED:
        assert pl.ibr.report().rows[0].state == ('off' if said or hook == 'deactivate' else 'ran')
    effect.remove()
    assert not pl.ibr.effects
    np.testing.assert_array_equal(shot(pl), before)


@pytest.mark.parametrize('hook', ['release', 'detach'])
def test_error_as_it_leaves(hook):
    """The user who removes it is told; it is gone."""
    pl = plotter((40, 30))
    pl.add_mesh(pv.Cone())
    pl.show(auto_close=False)
    before = shot(pl)
    effect = pl.ibr.add(effect_that_fails_in(hook))
    with pytest.raises(ZeroDivisionError, match=hook):
        effect.remove()
    assert not pl.ibr.effects
    np.testing.assert_array_equal(shot(pl), before)


def fails(*_):
    raise ZeroDivisionError('mine')


def test_error_of_a_movie(tmp_path):
    pl = plotter((40, 30))
    pl.add_mesh(pv.Cone())
    pl.ibr.time, position = 0.5, pl.camera.position
    with pytest.raises(ZeroDivisionError, match='mine'):
        pl.ibr.movie(tmp_path / 'a.gif', frames=2, each=fails, progress=False)
    assert (pl.ibr.time, pl.camera.position) == (0.5, position)
    assert not (tmp_path / 'a.gif').exists()
    pl.ibr.movie(tmp_path / 'a.gif', frames=2, progress=False)


def test_error_as_a_plotter_closes():
    """The other functions are called, and all is released."""
    pl, called = plotter((40, 30)), []
    pl.ibr.on_close(lambda: called.append(1))
    pl.ibr.on_close(fails)
    pl.ibr.on_close(lambda: called.append(2))
    effect = pl.ibr.add(pvibr.Bloom())
    with pytest.raises(ZeroDivisionError, match='mine'):
        pl.ibr.close()
    assert called == [2, 1]
    assert effect.pipeline is None
    pl.ibr.close()
    pl.close()


def test_error_of_an_effect_as_a_plotter_closes():
    pl = plotter((40, 30), shape=(1, 2))
    broken = pl.ibr.add(effect_that_fails_in('release'))
    bloom = pl.ibr.add(pvibr.Bloom())
    pl.subplot(0, 1)
    other = pl.ibr.add(pvibr.Bloom())
    pl.show(auto_close=False)
    with pytest.raises(ZeroDivisionError, match='release'):
        pl.ibr.close()
    assert [e.pipeline for e in (broken, bloom, other)] == [None] * 3
    pl.close()


def test_error_of_a_picker(monkeypatch):
    """It is printed, as all of VTK's observers are; frames go on."""
    import sys

    told = []
    monkeypatch.setattr(sys, 'excepthook', lambda kind, error, _: told.append(str(error)))
    pl = plotter((40, 30))
    pl.ibr.add_spheres([(0, 0, 0)], 5.0)
    pl.ibr.enable_picking(fails, show=False)
    pl.show(auto_close=False)
    before = shot(pl)
    pl.iren._mouse_left_button_click(20, 15)
    np.testing.assert_array_equal(shot(pl), before)
    assert told == ['mine']
