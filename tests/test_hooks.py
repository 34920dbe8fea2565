"""What pvibr replaces of PyVista's objects, and that it gives it back."""

import gc
import re

import pytest
import pyvista as pv

import pvibr
from pvibr.api.mesh_widgets import MESH_WIDGETS
from pvibr.api.waiting import PICTURES
from pvibr.core.hooks import Hooks, MethodHook
from pvibr.export.exporters import EXPORTERS
from tests.test_every_thing import EVERY

#: Effects that need no argument.
EFFECTS = sorted(
    set(pvibr.EFFECTS)
    - {'Projector', 'ShaderEffect', 'Backdrop', 'ImageOverlay', 'Outline', 'Glow', 'Afterglow'}
)
EVENT = re.compile(r'Event: \d+\s+EventName: (\w+)')


def state(plotter):
    """Return by name what a plotter and its renderers hold, and the events that are observed."""
    # Values that PyVista replaces as it draws are compared by their type.
    held = {}
    owners = {'plotter': plotter, 'window': plotter.render_window}
    owners |= {f'renderer {i}': r for i, r in enumerate(plotter.renderers)}
    for name, owner in owners.items():
        held |= {(name, key): type(value) for key, value in vars(owner).items()}
        held[name, 'events'] = sorted(EVENT.findall(str(owner))) if name != 'plotter' else []
    held['class'] = pv.Renderer.add_actor
    return held


def changes(before, after):
    """Return what differs of two states."""
    keys = before.keys() | after.keys()
    return {k: (before.get(k), after.get(k)) for k in keys if before.get(k) != after.get(k)}


@pytest.fixture
def plotter():
    pl = pv.Plotter(off_screen=True, window_size=(80, 60), shape=(1, 2))
    pl.add_mesh(pv.Sphere(), scalars=None, show_scalar_bar=False)
    pl.show(auto_close=False)
    for name in ('scalar_bars', 'widgets'):  # PyVista makes them when they are first asked for
        getattr(pl, name, None)
    yield pl
    pl.close()


def test_a_plotter_without_things_is_as_pyvista_made_it(plotter):
    gc.collect()
    before = state(plotter)
    assert len(plotter.ibr) == 0
    plotter.render()
    assert changes(before, state(plotter)).keys() <= {('plotter', 'ibr')}


@pytest.mark.parametrize('name', EVERY)
def test_the_last_thing_leaves_a_plotter_as_pyvista_made_it(plotter, name):
    _ = plotter.ibr.effects
    plotter.subplot(0, 1)
    gc.collect()
    before = state(plotter)
    thing = EVERY[name].add(plotter)
    plotter.render()
    plotter.ibr.pick(40, 30)
    assert all(method in vars(plotter) for method in (*MESH_WIDGETS, *EXPORTERS))
    assert plotter.renderer.add_actor.__wrapped__
    plotter.ibr.remove(thing)
    del thing
    plotter.render()
    gc.collect()
    left = changes(before, state(plotter))
    assert not {k: v for k, v in left.items() if k != ('plotter', 'mapper')}


@pytest.mark.parametrize('name', EFFECTS)
def test_the_last_effect_leaves_a_plotter_as_pyvista_made_it(plotter, name):
    _ = plotter.ibr.effects
    before = state(plotter)
    plotter.ibr.add(getattr(pvibr, name)())
    plotter.render()
    plotter.ibr.clear()
    assert not changes(before, state(plotter))


class Owner:
    """Something with a method."""

    def method(self):
        return 1


def test_what_others_have_replaced_since_stays():
    owner = Owner()
    hooks = Hooks(owner)
    assert not hooks
    owner.kept = 'before'
    hooks.put({'method': lambda: 2, 'kept': 'ours', 'more': 3})
    assert hooks
    assert (owner.method(), owner.kept) == (2, 'ours')
    owner.more = 'theirs'
    hooks.take_off()
    assert vars(owner) == {'kept': 'before', 'more': 'theirs'}
    assert owner.method() == 1
    hooks.take_off()
    assert not hooks


def test_a_method_is_replaced_while_there_are_instances():
    method = Owner.method
    hook = MethodHook(Owner, 'method', lambda inner: lambda self: 1 + inner(self))
    one, other = Owner(), Owner()
    for instance in (one, other):
        hook.need(instance)
    assert Owner().method() == 2
    del one, instance
    assert Owner().method() == 2
    del other
    assert Owner.method is method
    one = Owner()
    hook.need(one)
    ours = Owner.method
    Owner.method = lambda self: 10 + ours(self)
    del one
    one = Owner()
    hook.need(one)
    assert Owner().method() == 12  # not wrapped twice
    Owner.method = method


def test_methods_that_take_pictures_wait_while_something_is_baked(plotter, tmp_path):
    gc.collect()
    before = state(plotter)
    options = {'cache': tmp_path, 'bake': True, 'wait': False, 'progress': False}
    cones = plotter.ibr.add_instances(pv.Cone(), [[0, 0, 0], [2, 0, 0]], **options)
    assert {name for name in PICTURES if name in vars(plotter)} == set(PICTURES)
    plotter.ibr.remove(cones)
    del cones
    gc.collect()
    assert not changes(before, state(plotter)).keys() - {('plotter', 'ibr')}
