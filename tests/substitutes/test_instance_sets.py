"""Impostors of instances: blocks of them share images, and the set stays what it is."""

import numpy as np
import pytest
import pyvista as pv

import pvibr
from pvibr.substitutes import instance_sets as impostor_instances
from tests.pictures import shown
from tests.refusals import refused

MESH = pv.ParametricTorus(u_res=60, v_res=30).compute_normals()
TURN = np.array([[1, 0, 0, 0], [0, 0, -1, 0], [0, 1, 0, 0], [0, 0, 0, 1.0]])
FLIP = np.diag([-1.0, 1, 1, 1])
LIFT = np.array([[1, 0, 0, 0], [0, 1, 0, 0.3], [0, 0, 1, 0.3], [0, 0, 0, 1.0]])


def poses(n=12):
    found = np.tile(np.eye(4), (n, 1, 1))
    found[1::3], found[2::3] = TURN, FLIP
    found[:, :2, 3] = 3.2 * np.stack(np.divmod(np.arange(n), 4), 1)
    return found


COLORS = np.random.default_rng(3).integers(60, 255, (12, 3)).astype(np.uint8)


def make(*, images, extra=True, **settings):
    """Return a plotter, its instances (drawn as meshes, or almost) and their impostor."""
    pl = pv.Plotter(off_screen=True, window_size=(320, 240))
    rings = pl.ibr.add_instances(
        MESH,
        poses(),
        colors=COLORS,
        max_error=1e-6,
        smooth_shading=True,
        progress=False,
        bake=True,
    )
    things = [rings]
    if extra:
        ball = pv.Sphere(radius=1.5, center=(1.6, 1.6, 0))
        things.append(pl.add_mesh(ball, color='red', smooth_shading=True))
    pl.camera_position = [(3, -22, 14), (3, 5, 0), (0, 0, 1)]
    settings = {'hierarchical': True, 'only_if_faster': False} | settings
    return pl, rings, pl.ibr.add_impostor(things, **settings) if images else None


def alike(first, second):
    away = np.abs(first - second)
    return away.mean() < 1.5 and (away.max(-1) > 40).mean() < 0.02


@pytest.fixture
def pair():
    return make(images=False), make(images=True)


def test_they_look_as_their_meshes_do(pair):
    (plain, *_), (pl, rings, impostor) = pair
    before = shown(plain)
    assert (before < 200).any(-1).mean() > 0.05
    assert alike(before, shown(pl))
    told = impostor.report()
    assert told['meshes'] == {}
    assert 0 < told['shown'] <= 13
    drawn = [n for key, n in rings.report().items() if key.startswith('mesh ')]
    assert drawn
    assert sum(drawn) == 0
    for plotter in (plain, pl):
        plotter.camera.azimuth = 20
    assert alike(shown(plain), shown(pl))


@pytest.mark.parametrize(
    'change',
    [
        lambda rings: setattr(rings, 'colors', COLORS[::-1]),
        lambda rings: rings.update([0, 5], visible=False),
        lambda rings: setattr(rings, 'poses', LIFT @ poses()),
        lambda rings: setattr(rings, 'visibility', False),
    ],
)
def test_changes_are_seen_to(pair, change):
    (plain, other, _), (pl, rings, _) = pair
    before = shown(pl)
    shown(plain)
    for one in (other, rings):
        change(one)
    after = shown(pl)
    assert alike(shown(plain), after)
    assert np.abs(before - after).mean() > 0.1


def test_single_ones_are_picked_and_other_cameras_see_them_all(pair):
    (plain, other, _), (pl, rings, _) = pair
    lives = []
    for one in (plain, pl):
        lives.append(one.ibr.add(pvibr.LiveTexture(one.camera.copy(), size=(64, 48))))
        lives[-1].camera.position = (3, 25, 12)
        shown(one)
        shown(one)
    assert np.array_equal(lives[0].image(), lives[1].image())
    for x, y in ((160, 120), (100, 140), (215, 90)):
        first, second = other.pick(x, y), rings.pick(x, y)
        assert (first is None) == (second is None)
        assert first is None or first.index == second.index
    assert rings.visible.all()


def test_it_goes_and_they_are_drawn_as_before(pair):
    (plain, *_), (pl, rings, impostor) = pair
    before = shown(plain)
    images = shown(pl)
    impostor.enabled = False
    assert np.array_equal(shown(pl), before)
    impostor.enabled = True
    assert np.array_equal(shown(pl), images)
    impostor.remove()
    assert np.array_equal(shown(pl), before)
    pl.ibr.add(impostor)
    assert np.array_equal(shown(pl), images)
    rings.remove()
    shown(pl)
    assert len(impostor.props) == 1
    assert impostor.report()['shown'] == 1


def test_instances_that_go_take_the_impostor_along():
    pl, rings, _ = make(images=True, extra=False)
    shown(pl)
    pl.remove_actor(rings)
    empty = shown(pl)
    assert (empty == empty[0, 0]).all()
    assert pl.ibr.effects == ()


def test_thousands_are_blocks_of_several(monkeypatch):
    monkeypatch.setattr(impostor_instances, 'MOST', 5)
    plain, pl = (make(images=images)[0] for images in (False, True))
    pl, _, impostor = make(images=True)
    assert len(impostor._leaves) == 1 + 3
    assert alike(shown(plain), shown(pl))


def test_shadows_fall_from_all_of_them(pair):
    found = []
    for pl, *_ in pair:
        pl.add_mesh(pv.Plane(center=(3, 5, -1.5), i_size=30, j_size=30), color='white')
        pl.camera_position = [(3, -22, 14), (3, 5, 0), (0, 0, 1)]
        pl.ibr.add(pvibr.Shadows())
        found.append(shown(pl))
    assert alike(*found)


def test_bad_input_changes_nothing():
    pl, rings, _ = make(images=False)
    refused('hierarchical=True', pl.ibr.add_impostor, rings)
    refused('twice', pl.ibr.add_impostor, [rings, rings], hierarchical=True)
    refused('Instances', pl.ibr.add_impostor, pvibr.Shadows(), kind=TypeError, hierarchical=True)
    stranger = pvibr.Instances(MESH, [[0, 0, 0]], progress=False)
    refused('not in this subplot', pl.ibr.add_impostor, stranger, hierarchical=True)
    assert pl.ibr.effects == (rings,)
    none = pl.ibr.add_instances(MESH, np.zeros((0, 3)), progress=False)
    pl.ibr.add_impostor(none, hierarchical=True)
    shown(pl)
