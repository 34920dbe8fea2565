"""``plotter.ibr``, the same for a plain renderer, and ``mesh.ibr``."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import pyvista as pv

import pvibr
from pvibr.api.plotter_component import IBRComponent
from pvibr.core import _vtk
from pvibr.core.effect import Effect
from pvibr.core.errors import ClosedError, PvibrWarning
from pvibr.core.params import Param
from pvibr.gl import Texture


class Fade(Effect):
    amount = Param(0.5, 'How much.', range='[0, 1]')
    color = Param((0.0, 0.0, 0.0), 'Of what.', range='[0, 1]')
    length = Param(None, 'How far.', range='(0, inf)', unit='world', kind=float)


class Holder(Effect):
    """Holds a texture from its first frame until it is released."""

    texture = None
    released = 0

    def prepare(self, frame):
        if self.texture is None:
            self.texture = Texture(frame.window).upload(np.zeros((8, 8, 4), np.uint8))

    def report(self):
        return {'bytes': self.texture.nbytes if self.texture else 0, 'level': 'near'}

    def release(self):
        if self.texture is not None:
            self.released += 1
            self.texture.release()
            self.texture = None


class Pickable(Effect):
    def __init__(self, hit):
        super().__init__()
        self.hit = hit

    def pick(self, x, y):
        return self.hit


@pytest.fixture
def pl():
    pl = pv.Plotter(window_size=(64, 48))
    pl.add_mesh(pv.Sphere())
    return pl


def plain_window():
    window, renderer = _vtk.vtkRenderWindow(), _vtk.vtkRenderer()
    window.SetOffScreenRendering(True)
    window.SetSize(64, 48)
    window.AddRenderer(renderer)
    source, mapper, actor = _vtk.vtkSphereSource(), _vtk.vtkPolyDataMapper(), _vtk.vtkActor()
    mapper.SetInputConnection(source.GetOutputPort())
    actor.SetMapper(mapper)
    renderer.AddActor(actor)
    return window, renderer


def test_one_component_for_a_plotter(pl):
    assert isinstance(pl.ibr, IBRComponent)
    assert pl.ibr is pl.ibr


def test_looking_changes_nothing(pl):
    pl.ibr.report()
    assert pl.ibr.effects == ()
    assert pl.ibr.pick(3, 3) is None
    assert not pl.renderer.HasObserver('EndEvent')


def test_released_once_while_the_context_lives(pl):
    holder = pl.ibr.add(Holder())
    pl.show(auto_close=False)
    assert holder.texture is not None
    pl.close()
    assert holder.released == 1


def test_closed_by_show(pl):
    holder = pl.ibr.add(Holder())
    pl.show()
    assert holder.released == 1
    ibr = pl.ibr
    for use in (
        lambda: ibr.add(Fade()),
        ibr.clear,
        ibr.state,
        lambda: ibr.restore({}),
        lambda: ibr.effects,
        lambda: ibr.add_instances(pv.Sphere(), np.zeros((1, 3))),
    ):
        with pytest.raises(ClosedError, match='the plotter is closed; create a new one'):
            use()


def test_the_report_after_show_is_of_the_last_frame(pl):
    pl.ibr.add(Holder())
    pl.show()
    assert [(row.effect, row.state) for row in pl.ibr.report().rows] == [('Holder', 'ran')]


def test_closed_without_having_drawn(pl):
    pl.ibr.add(Holder())
    pl.close()
    assert pl.ibr._pipelines == []


def test_released_effect_can_be_added_to_another_plotter(pl):
    holder = pl.ibr.add(Holder())
    pl.show()
    other = pv.Plotter(window_size=(32, 32))
    other.ibr.add(holder)
    other.show(auto_close=False)
    assert other.ibr.report().rows[0].bytes == 256


def test_two_plotters(pl):
    other = pv.Plotter(window_size=(32, 32))
    one, two = pl.ibr.add(Holder()), other.ibr.add(Holder())
    pl.show(auto_close=False)
    other.show(auto_close=False)
    pl.close()
    assert (one.released, two.released) == (1, 0)
    other.render()
    assert other.ibr.report().rows[0].state == 'ran'


def test_remove_and_clear_release(pl):
    pl.show(auto_close=False)
    for take in (pl.ibr.remove, lambda _: pl.ibr.clear()):
        holder = pl.ibr.add(Holder())
        pl.render()
        pl.render_window.Render()
        take(holder)
        assert holder.released == 1
        assert holder.pipeline is None
    with pytest.raises(ValueError, match='is not in this subplot; here are: none'):
        pl.ibr.remove(holder)


def test_active_subplot_is_meant():
    pl = pv.Plotter(shape=(1, 2), window_size=(64, 32))
    left = [pl.subplot(0, 0), pl.ibr.add(Fade())][1]
    right = [pl.subplot(0, 1), pl.ibr.add(Fade(amount=0.25))][1]
    assert pl.ibr.effects == (right,)
    pl.ibr.remove(left)  # wherever it is
    pl.subplot(0, 0)
    assert pl.ibr.effects == ()


def test_state_goes_through_json_and_comes_back():
    pl = pv.Plotter(shape=(1, 2), window_size=(64, 32))
    one, two = pl.ibr.add(Fade(amount=0.1)), pl.ibr.add(Fade(amount=0.2, length=3))
    pl.subplot(0, 1)
    three = pl.ibr.add(Fade(color=(1, 0, 0)))
    pl.ibr.time = 2.5
    state = json.loads(json.dumps(pl.ibr.state()))
    fade = {'amount': 0.2, 'color': [0, 0, 0], 'length': 3, 'enabled': True}
    assert state['subplots']['0']['Fade 2'] == fade
    for effect in (one, two, three):
        effect.amount, effect.color, effect.length = 0.9, (0, 1, 0), 7
    pl.ibr.time = 0
    pl.ibr.restore(state)
    assert pl.ibr.state() == state
    assert (one.amount, two.length, one.length, pl.ibr.time) == (0.1, 3.0, None, 2.5)


def test_unknown_names_are_in_one_warning(pl):
    pl.ibr.add(Fade())
    fade = {'amount': 0.75, 'shape': 3}
    state = {'subplots': {'0': {'Fade': fade, 'Bloom': {}}, '7': {'Fade': {}}}, 'color': 1}
    with pytest.warns(PvibrWarning) as caught:
        pl.ibr.restore(state)
    assert len(caught) == 1
    for name in ('color', 'Fade.shape', 'subplot 0: Bloom', 'subplot 7: Fade'):
        assert name in str(caught[0].message)
    assert pl.ibr.effects[0].amount == 0.75


@pytest.mark.parametrize('time', [np.nan, np.inf])
def test_time_is_finite(pl, time):
    with pytest.raises(ValueError, match=r'time must be a finite number of seconds'):
        pl.ibr.time = time


def test_report_has_what_effects_say(pl):
    pl.ibr.add(Holder())
    pl.show(auto_close=False)
    report = pl.ibr.report()
    assert report.rows[0].bytes == 256
    assert 'Holder.level: near' in str(report)
    json.dumps(report.as_dict())


def test_pick_is_the_first_hit(pl):
    for hit in (None, 7, 8):
        pl.ibr.add(Pickable(hit))
    assert pl.ibr.pick(1, 2) == 7


def test_screenshots_and_movies_go_on(pl, tmp_path):
    pl.ibr.add(Holder())
    pl.show(auto_close=False)
    assert pl.screenshot(tmp_path / 'a.png').shape == (48, 64, 3)


# ---------------------------------------------------------------- plain renderers


def test_attach_to_a_plain_renderer():
    window, renderer = plain_window()
    ibr = pvibr.attach(renderer)
    assert pvibr.attach(renderer) is ibr
    holder = ibr.add(Holder())
    window.Render()
    assert ibr.report().rows[0].state == 'ran'
    subplots = {'0': {'Holder': {'enabled': True}}}
    assert ibr.state() == {'time': 0.0, 'interactive_frame_ms': 100.0, 'subplots': subplots}
    ibr.close()
    assert holder.released == 1
    assert not renderer.HasObserver('EndEvent')
    with pytest.raises(ClosedError):
        ibr.add(Fade())
    with pvibr.attach(renderer) as again:
        assert again is not ibr
        again.add(Fade())
        window.Render()
    window.Finalize()


def test_attached_draws_by_what_shows_it():
    renderer, drawn = _vtk.vtkRenderer(), []
    with pytest.raises(TypeError, match='such as view'):
        pvibr.attach(renderer, draw=3)
    with pvibr.attach(renderer) as ibr:
        assert pvibr.attach(renderer, draw=lambda: drawn.append(1)) is ibr
        ibr._plotter.render()
        assert drawn == [1]


def test_attached_is_closed_at_the_end_of_the_program():
    code = (
        'from tests.api.test_plotter_component import *; window, renderer = plain_window();'
        'holder = pvibr.attach(renderer).add(Holder()); window.Render();'
        'import atexit; atexit._run_exitfuncs(); print(holder.released)'
    )
    root = Path(__file__).parents[2]
    done = subprocess.run(
        [sys.executable, '-c', code], cwd=root, capture_output=True, text=True, check=False
    )
    assert (done.returncode, done.stdout.strip()) == (0, '1'), done.stderr
    assert 'ERR' not in done.stderr


def test_attached_lives_as_long_as_its_renderer():
    window, renderer = plain_window()
    pvibr.attach(renderer).add(Fade())
    window.Render()
    assert len(pvibr.attach(renderer).effects) == 1
    pvibr.attach(renderer).close()
    window.Finalize()


def test_attach_to_something_else(pl):
    with pytest.raises(TypeError, match='must be a vtkRenderer'):
        pvibr.attach(pl)


def test_repr_says_what_there_is(pl):
    pl.ibr.add(Fade())
    pl.ibr.add_spheres([[0, 0, 0]])
    pl.ibr.time = 0.5
    assert repr(pl.ibr) == '<plotter.ibr: 1 subplot, 1 thing, 1 effect, time 0.5 s>'
    pl.ibr.play()
    assert repr(pl.ibr).endswith('time 0.5 s, playing>')
    pl.close()
    assert repr(pl.ibr) == '<plotter.ibr: closed>'


def test_a_cell_run_twice_replaces_what_it_added():
    """By its name, or by its kind where a picture has one of it."""
    pl = pv.Plotter(off_screen=True)

    def cell():
        pl.ibr.add(pvibr.Bloom())
        pl.ibr.add(pvibr.Fog(2.0))
        pl.ibr.add(pvibr.Shadows())
        effect = pvibr.ShaderEffect('vec4 effect(vec2 uv) { return color_at(uv); }')
        effect.name = 'same'
        pl.ibr.add(effect)
        pl.ibr.add(pvibr.Spheres([[0.0, 0, 0]], name='balls'))
        pl.ibr.add_spheres([[1.0, 0, 0]], name='more')
        return set(pl.ibr)

    first, second = cell(), cell()
    assert len(pl.ibr) == len(second) == 6
    assert not first & second
    assert all(effect.pipeline is None for effect in first)
    with pytest.raises(ValueError, match='in this subplot already'):
        pl.ibr.add(pl.ibr['Bloom'])
    assert len(pl.ibr) == 6
    pl.ibr.add(pvibr.Outline(width=1))
    pl.ibr.add(pvibr.Outline(width=3))
    assert len(pl.ibr) == 8
    pl.close()


def test_a_cell_run_twice_replaces_what_it_made_of_the_same():
    pl = pv.Plotter(off_screen=True)
    ball = pl.add_mesh(pv.Sphere())
    code = 'vec4 effect(vec2 uv) { return color_at(uv) * k; }'

    def cell():
        pl.ibr.add(pvibr.Outline(color='red'))
        pl.ibr.add(pvibr.Outline([ball], width=3))
        pl.ibr.add(pvibr.Glow([ball]))
        pl.ibr.add(pvibr.ShaderEffect(code, k=0.5))
        pl.ibr.add(pvibr.ImageOverlay(np.full((4, 4, 4), 9, np.uint8), place=(0, 0, 0.1, 0.1)))
        pl.ibr.add(pvibr.Flash(at=1.0))

    cell()
    first = pl.ibr.effects
    cell()
    assert not set(first) & set(pl.ibr.effects)
    assert len(pl.ibr) == len(first) == 6
    for width in (1, 2):  # made alike, then set: both stay
        pl.ibr.add(pvibr.Outline()).width = width
    assert len(pl.ibr) == 8
    pl.close()
