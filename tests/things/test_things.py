"""What every handle promises: it is the actor that the plotter lists."""

from __future__ import annotations

import gc
import weakref

import numpy as np
import pytest
import pyvista as pv

import pvibr
from pvibr.animation import FigureMesh, Skeleton

pytestmark = pytest.mark.sampled

SIZE = (120, 90)
GRAY = np.full((4, 4, 3), 0.4)
PLACES = [[-1.2, 0.0, 0.6], [1.2, 0.0, 0.6]]


def wheel():
    mesh = pv.Cube()
    mesh.point_data.clear()
    return pvibr.Figure([FigureMesh(mesh, node=0)], Skeleton([-1], [np.eye(4)]))


THINGS = {
    'Instances': lambda ibr, **how: ibr.add_instances(pv.Cone(), PLACES, max_error=8, **how),
    'Crowd': lambda ibr, **how: ibr.add_animated(wheel(), PLACES, max_error=8, **how),
    'AnimatedActor': lambda ibr, **how: ibr.add_animated(wheel(), **how),
    'Billboards': lambda ibr, **how: ibr.add_billboards(PLACES, GRAY, **how),
    'Spheres': lambda ibr, **how: ibr.add_spheres(PLACES, **how),
    'Cylinders': lambda ibr, **how: ibr.add_cylinders(PLACES[:1], PLACES[1:], 0.3, **how),
    'Ellipsoids': lambda ibr, **how: ibr.add_ellipsoids(PLACES, (0.5, 0.3, 0.4), **how),
    'LargeMesh': lambda ibr, **how: ibr.add_large_mesh(pv.Sphere(), **how),
    'Impostor': lambda ibr, **how: ibr.add_impostor(ibr.ball, **how),
    'ImageLayers': lambda ibr, **how: ibr.add_image_layers([ibr.ball], **how),
}
SUBSTITUTES = 'Impostor', 'ImageLayers'  # which may be as good as what they stand for
SHADED = 'Billboards', 'Spheres', 'Cylinders', 'Ellipsoids'
every = pytest.mark.parametrize('kind', THINGS)


class Scene:
    """A plotter with a ball, to which things are added."""

    def __init__(self):
        self.plotter = pl = pv.Plotter(off_screen=True, window_size=SIZE)
        pl.disable_anti_aliasing()
        ball = pv.Sphere(radius=0.4, theta_resolution=60, phi_resolution=60)
        self.ball = pl.add_mesh(ball, color='tan')
        pl.camera_position = [(1.0, -6.0, 2.0), (0.0, 0.0, 0.2), (0.0, 0.0, 1.0)]
        self.before = self.picture()

    def __getattr__(self, name):
        return getattr(self.plotter.ibr, name)

    def add(self, kind, **how):
        if kind not in SUBSTITUTES:
            how = {'reset_camera': False} | how
        if kind in ('AnimatedActor', 'Crowd'):
            how = {'show_scalar_bar': False} | how
        return THINGS[kind](self, **how)

    def picture(self):
        self.plotter.renderer.ResetCameraClippingRange()
        self.plotter.render()
        return self.plotter.screenshot(None, return_img=True)

    def shows(self, kind):
        """Whether it is seen; where it is as what it stands for, whether it ran."""
        picture = self.picture()
        if kind in SUBSTITUTES:
            return self.report().rows[0].state == 'ran'
        return (picture != self.before).any()


@pytest.fixture
def scene():
    return Scene()


@every
def test_a_handle_is_the_actor_that_the_plotter_lists(scene, kind):
    thing = scene.add(kind, name='it')
    assert isinstance(thing, pv.Actor)
    assert type(thing).__name__ == kind
    assert scene.plotter.actors['it'] is thing
    assert scene.shows(kind)
    thing.name = 'other'
    assert scene.plotter.actors['other'] is thing
    assert scene.report().rows[0].effect == 'other'


@pytest.mark.parametrize('kind', ['Spheres', 'AnimatedActor'])
def test_things_without_a_name_are_listed_one_by_one(scene, kind):
    first, second = scene.add(kind), scene.add(kind)
    assert (first.name, second.name) == (kind, f'{kind} 2')
    assert scene.plotter.actors[kind] is first
    assert scene.plotter.actors[f'{kind} 2'] is second
    first.remove()
    assert scene.add(kind).name == kind


REMOVALS = {
    'handle': lambda pl, thing: pl.remove_actor(thing),
    'name': lambda pl, thing: pl.remove_actor('it'),
    'renderer': lambda pl, thing: pl.renderer.RemoveActor(thing),
    'ibr': lambda pl, thing: pl.ibr.remove(thing),
    'itself': lambda pl, thing: thing.remove(),
    'replaced': lambda pl, thing: pl.add_mesh(pv.PolyData([[0.0, 0, 0]]), name='it', opacity=0.0),
}


@every
@pytest.mark.parametrize('way', REMOVALS)
def test_all_of_it_goes(scene, kind, way):
    thing = scene.add(kind, name='it')
    scene.picture()
    REMOVALS[way](scene.plotter, thing)
    assert (scene.picture() == scene.before).all()
    assert not scene.effects
    assert 'it' not in scene.plotter.actors or way == 'replaced'
    assert thing.pipeline is None
    left = [p for p in scene.plotter.renderer.GetViewProps() if p is not scene.ball]
    assert len(left) == (way == 'replaced')


@every
@pytest.mark.parametrize('named', ['', 'it'])
def test_add_actor_adds_it_as_a_mesh_is_added(scene, kind, named):
    thing = scene.add(kind)
    first, name = scene.picture(), thing.name
    elsewhere = pv.Plotter(off_screen=True)
    with pytest.raises(ValueError, match='is in another subplot already'):
        elsewhere.add_actor(thing, name='one')
    assert (thing.name, thing.given_name, len(elsewhere.actors)) == (name, None, 0)
    for remove in (lambda: None, lambda: scene.plotter.remove_actor(thing), thing.remove):
        remove()
        actor, prop = scene.plotter.add_actor(thing, name=named or None, pickable=False)
        assert (actor, prop, thing.pickable) == (thing, thing.prop, False)
        assert list(scene.effects) == [thing]
        assert scene.plotter.actors[named or name] is thing
        assert (scene.picture() == first).all()
    if kind not in SUBSTITUTES:
        thing.remove()
        elsewhere.add_actor(thing, reset_camera=True)
        assert elsewhere.ibr.effects == (thing,)
    elsewhere.close()


@every
def test_clear_removes_it(scene, kind):
    thing = scene.add(kind)
    scene.picture()
    scene.plotter.clear()
    scene.picture()
    assert not scene.effects
    assert not scene.plotter.actors
    assert thing.pipeline is None


@every
def test_visibility_is_that_of_the_actor(scene, kind):
    thing = scene.add(kind)
    assert scene.shows(kind)
    for show in (
        thing.SetVisibility,
        lambda visible: setattr(thing, 'visibility', visible),
        lambda visible: thing.restore({'visibility': visible}),
    ):
        show(False)
        assert thing.visibility is False
        assert not thing.GetVisibility()
        assert thing.state()['visibility'] is False
        assert (scene.picture() == scene.before).all()
        row = scene.report().rows[0]
        assert (row.state, row.why) == ('skipped', 'not visible')
        show(True)
        assert thing.visibility is True
        assert scene.shows(kind)


@every
def test_bounds_are_those_of_the_actor(scene, kind):
    thing = scene.add(kind)
    scene.picture()
    assert thing.bounds == thing.GetBounds()
    low, high = np.reshape(thing.bounds, (3, 2)).T
    assert (low < high).all()
    assert thing.center == pytest.approx((low + high) / 2)
    every = np.reshape(scene.plotter.bounds, (3, 2)).T
    assert (every[0] <= low + 1e-6).all()
    assert (every[1] >= high - 1e-6).all()


@every
def test_all_but_what_stands_for_actors_can_be_moved(scene, kind):
    thing = scene.add(kind)
    before = thing.bounds
    if kind not in SUBSTITUTES:
        thing.position = (1.0, 0.0, 0.0)
        assert thing.bounds == pytest.approx(np.add(before, (1, 1, 0, 0, 0, 0)))
        assert scene.shows(kind)
        thing.SetPosition(0.0, 0.0, 2.0)
        scene.picture()
        if kind == 'AnimatedActor':
            assert thing.actors()[0].GetBounds() == pytest.approx(thing.bounds, abs=1e-5)
        assert thing.bounds == pytest.approx(np.add(before, (0, 0, 0, 0, 2, 2)))
        return
    for name, value in {'position': (1.0, 0, 0), 'scale': 2.0, 'user_matrix': np.eye(4)}.items():
        with pytest.raises(AttributeError, match=f'{kind}.{name} cannot be set: '):
            setattr(thing, name, value)
    assert thing.bounds == before


@pytest.mark.parametrize('kind', SHADED)
def test_its_material_is_the_actors(scene, kind):
    thing = scene.add(kind)
    plain = scene.picture()
    thing.prop.opacity = 0.4
    faint = scene.picture()
    assert (faint != plain).any()
    other = pv.Property(color='red', lighting=False)
    thing.prop = other
    assert thing.prop is other
    assert (scene.picture() != faint).any()


@every
def test_a_line_says_what_it_is(scene, kind):
    thing = scene.add(kind)
    assert repr(thing) == str(thing)
    assert '\n' not in repr(thing)
    assert repr(thing).startswith(f'<{kind}: ')
    assert repr(thing).endswith(', on>')
    assert any(c.isdigit() for c in repr(thing))
    thing.name, thing.visibility = 'it', False
    assert repr(thing).startswith(f"<{kind} 'it': ")
    assert repr(thing).endswith(', hidden, on>')
    thing.enabled = False
    assert repr(thing).endswith(', off>')
    thing.remove()
    assert repr(thing).endswith(', in no plotter>')


def test_a_line_says_what_is_in_a_subplot(scene):
    bloom = scene.plotter.ibr.add(pvibr.Bloom())
    assert repr(bloom) == '<Bloom: on>'
    scene.picture()
    assert repr(scene.pipeline) == '<Pipeline: Bloom, 1 frames>'


@every
def test_completion_shows_what_users_use(scene, kind):
    thing = scene.add(kind)
    shown = {name for name in dir(thing) if not name.startswith('_')}
    assert shown >= {'visibility', 'enabled', 'name', 'remove', 'report', 'prop', 'bounds'}
    assert shown >= set(thing.state())
    hooks = {'prepare', 'needed', 'attach', 'deactivate', 'render', 'content_key', 'drawn'}
    assert not shown & {*hooks, 'FOR_USERS', 'binder', 'textures'}


@every
def test_a_name_that_is_none_cannot_be_set(scene, kind):
    thing = scene.add(kind)
    with pytest.raises(AttributeError, match=rf"{kind} has no .* 'visiblity'.*'visibility'"):
        thing.visiblity = False
    assert thing.visibility
    with pytest.raises(TypeError, match='cannot be copied'):
        thing.copy()


@every
def test_nothing_outlives_its_plotter(kind):
    scene = Scene()
    thing = weakref.ref(scene.add(kind))
    scene.picture()
    plotter = weakref.ref(scene.plotter)
    scene.plotter.close()
    scene.plotter.deep_clean()
    del scene
    gc.collect()
    assert plotter() is None
    assert thing() is None


@pytest.mark.parametrize('kind', ['Instances', 'Crowd', 'AnimatedActor'])
def test_a_style_set_later_keeps_the_colour(kind):
    """PyVista gives wireframes the theme's colour where none was set."""
    pl = pv.Plotter(off_screen=True, window_size=SIZE)
    thing = THINGS[kind](pl.ibr, color='tomato')
    thing.prop.style = 'wireframe'
    assert thing.prop.color == 'tomato'
    pl.close()


def test_the_pipeline_is_set_by_adding_alone():
    spheres = pv.Plotter().ibr.add_spheres([[0.0, 0, 0]], 1.0)
    with pytest.raises(AttributeError):
        spheres.pipeline = None
    with pytest.raises(AttributeError):
        pvibr.Bloom().pipeline = None
