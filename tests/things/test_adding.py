"""Adding a thing adds all of it or nothing, and what is added again replaces what was there."""

from __future__ import annotations

import numpy as np
import pytest
import pyvista as pv

from tests.things.test_things import THINGS, Scene

pytestmark = pytest.mark.sampled

BAD = [
    {'scalar_bar_args': {'titel': 'x'}},
    {'scalar_bar_args': {'title': 3}},
    {'scalar_bar_args': {'color': 'no color'}},
    {'scalar_bar_args': {'title': 'x', 'n_labels': 'many'}},
    {'scalar_bar_args': 'title'},
    {'scalar_bar_args': 3},
    {'show_scalar_bar': 'no'},
    {'show_scalar_bar': np.array([1, 0])},
    {'reset_camera': 'no'},
    {'reset_camera': np.array([True, False])},
    {'render': 'no'},
    {'render': [0]},
    {'name': 3},
    {'name': ['it']},
    {'pickable': 'no'},
    {'opacity': 'thick'},
    {'no_such': 1},
    {'scalars': [1.0, 2.0, 3.0, 4.0, 5.0]},
]
every = pytest.mark.parametrize('kind', THINGS)


@pytest.fixture
def scene():
    return Scene()


def held(scene):
    pl = scene.plotter
    titles = {k: len(v) for k, v in pl.scalar_bars._scalar_bar_mappers.items()}
    camera = pl.camera_position.to_list()
    return list(scene.effects), list(pl.actors.items()), props(pl), titles, camera


def props(pl):
    return [prop for prop in pl.renderer.GetViewProps() if not prop.IsA('vtkLightActor')]


@every
@pytest.mark.parametrize('named', [False, True])
def test_a_failed_add_leaves_nothing_behind(scene, kind, named):
    if named:
        scene.add(kind, name='it')
    picture = scene.picture()
    before = held(scene)
    for bad in BAD:
        wrong = bad | ({'name': 'it'} if named and 'name' not in bad else {})
        with pytest.raises((TypeError, ValueError, KeyError, AttributeError)):
            scene.add(kind, **wrong)
        assert held(scene) == before, bad
    assert (scene.picture() == picture).all()


def test_more_bars_than_places_leave_nothing_behind(scene):
    for k in range(10):
        scene.plotter.add_mesh(pv.Sphere(), show_scalar_bar=False, name=str(k))
        scene.plotter.add_scalar_bar(title=str(k), cmap='viridis', clim=(0, k + 1))
    before = held(scene)
    with pytest.raises(RuntimeError, match='color bars'):
        scene.add_spheres([[0, 0, 0]], scalars=[1.0], scalar_bar_args={'title': 'one more'})
    assert held(scene) == before
    scene.add_spheres([[0, 0, 0]], scalars=[1.0], scalar_bar_args={'title': '3'})


def test_ones_and_zeros_and_numpy_bools_are_flags(scene):
    scene.add('Spheres', reset_camera=0, render=1, show_scalar_bar=np.False_)
    scene.add('Spheres', reset_camera=None, render=np.True_, show_scalar_bar=None)
    assert len(scene.effects) == 2
