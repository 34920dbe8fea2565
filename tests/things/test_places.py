"""The place of a whole thing: set as that of any actor, and drawn, picked and baked there."""

from __future__ import annotations

import numpy as np
import pytest
import pyvista as pv
from pyvista import examples
from scipy.spatial.transform import Rotation

import pvibr
from pvibr.animation import FigureMesh, Skeleton
from tests.pictures import uncut

pytestmark = pytest.mark.sampled

SIZE = (150, 110)
EYE, FOCUS, UP = np.array([(3.0, -9.0, 5.0), (0.0, 0.0, 0.0), (0.0, 0.0, 1.0)])
RNG = np.random.default_rng(11)
PLACES = RNG.uniform(-1.5, 1.5, (9, 3))
RADII = RNG.uniform(0.15, 0.5, (9, 3))
TURNS = Rotation.random(9, random_state=7).as_matrix()
SIGN = RNG.integers(0, 256, (12, 16, 3), np.uint8)
VIEWS = [RNG.integers(0, 256, (8, 8, 3), np.uint8) for _ in range(8)]
WEDGE = pv.Cone(resolution=5, direction=(0.3, 0.2, 1.0)).triangulate()


def wheel():
    mesh = pv.Cube(x_length=0.9, y_length=1.7, z_length=0.7)
    mesh.point_data.clear()
    return pvibr.Figure([FigureMesh(mesh, node=0)], Skeleton([-1], [np.eye(4)]))


BELOW = pvibr.Pinhole(
    [[700, 0, 1023.5], [0, 700, 511.5], [0, 0, 1]], np.eye(3), (0.0, 0.0, 6.0), (2048, 1024)
)
PHOTO = pvibr.Photo('earth', BELOW, examples.mapfile)
CARDS = {'axis': (0.2, 0.1, 1.0), 'size': 0.6, 'cutout': 0.5}
VIEWED = CARDS | {'facing': 'cylindrical', 'views': 8, 'yaw': 0.3}
KINDS = {
    'points': lambda ibr: ibr.add_instances(WEDGE, PLACES, cache=False),
    'matrices': lambda ibr: ibr.add_instances(WEDGE, PLACES, orient=TURNS, cache=False),
    'cards': lambda ibr: ibr.add_instances(WEDGE, PLACES, orient=TURNS, force_level='flat'),
    'crowd': lambda ibr: ibr.add_animated(wheel(), PLACES, show_scalar_bar=False),
    'figure': lambda ibr: ibr.add_animated(wheel(), show_scalar_bar=False),
    'photos': lambda ibr: ibr.add_photos(plain_of('points'), PHOTO),
    'spheres': lambda ibr: ibr.add_spheres(PLACES, RADII[:, 0]),
    'cylinders': lambda ibr: ibr.add_cylinders(PLACES, PLACES[::-1], 0.2),
    'capsules': lambda ibr: ibr.add_cylinders(PLACES, PLACES[::-1], 0.2, caps='round'),
    'ellipsoids': lambda ibr: ibr.add_ellipsoids(PLACES, RADII, TURNS),
    'signs': lambda ibr: ibr.add_billboards(PLACES, SIGN, size=0.6),
    'pixels': lambda ibr: ibr.add_billboards(PLACES, SIGN, size=9, size_unit='pixel'),
    'upright': lambda ibr: ibr.add_billboards(PLACES, SIGN, facing='cylindrical', **CARDS),
    'views': lambda ibr: ibr.add_billboards(PLACES, VIEWS, **VIEWED),
    'fixed': lambda ibr: ibr.add_billboards(
        PLACES, SIGN, size=0.9, facing='world', orientation=(0.5, 0.3, -0.7, 0.2)
    ),
}
#: By which the sizes of cards in pixels do not grow.
NOT_SCALED = 'pixels'
STRETCHED = 'points', 'matrices', 'photos', 'spheres', 'ellipsoids', 'figure', 'crowd', 'cards'


def similarity(seed, scale=1.0, far=0.0):
    rng = np.random.default_rng(seed)
    matrix = np.eye(4)
    matrix[:3, :3] = scale * Rotation.random(random_state=seed).as_matrix()
    matrix[:3, 3] = rng.uniform(-3, 3, 3) + far
    return matrix


def stretched(seed):
    matrix = similarity(seed)
    matrix[:3, :3] = matrix[:3, :3] @ np.diag([0.7, 1.6, 1.1])
    return matrix


def stage(matrix=None):
    """A plotter whose camera and light are moved by a matrix."""
    matrix = np.eye(4) if matrix is None else matrix
    pl = pv.Plotter(off_screen=True, window_size=SIZE, lighting='none')
    pl.add_light(pv.Light(light_type='headlight'))
    eye, focus = (matrix[:3, :3] @ p + matrix[:3, 3] for p in (EYE, FOCUS))
    pl.camera_position = [eye, focus, matrix[:3, :3] @ UP]
    return pl


def unlike(one, other):
    """Share of pixels that differ by more than edges do."""
    return (np.abs(one - other).max(2) > 24).mean()


def shown(image):
    return (image != image[0, 0]).any(2).mean()


def bound(pl, kind):
    pl.camera_set = True
    thing = KINDS[kind](pl.ibr)
    pl.camera_set = True
    return thing


@pytest.mark.parametrize('kind', KINDS)
@pytest.mark.parametrize(('scale', 'far'), [(1.0, 0.0), (1.7, 2e5)])
def test_what_moves_with_the_camera_looks_the_same(kind, scale, far):
    scale = 1.0 if kind == NOT_SCALED else scale
    pl = stage()
    thing = bound(pl, kind)
    before, bounds = uncut(pl), thing.bounds
    matrix = similarity(5, scale, far)
    other = stage(matrix)
    moved = bound(other, kind)
    moved.user_matrix = matrix
    after = uncut(other)
    assert shown(before) > 0.02
    assert unlike(before, after) < 0.01
    assert moved.bounds != pytest.approx(bounds, abs=0.1)
    moved.user_matrix = np.eye(4)
    assert moved.bounds == pytest.approx(bounds)
    thing.user_matrix = matrix  # seen from where it was
    if far:
        assert shown(uncut(pl)) == 0


def plain_of(kind):
    """The mesh that a thing shows, in its own space."""
    if kind == 'figure':
        return wheel().mesh().extract_surface(algorithm=None)
    if kind == 'ellipsoids':
        ball = pv.Sphere(radius=1.0, theta_resolution=40, phi_resolution=40)
        return merged(ball, [TURNS[i] * RADII[i] for i in range(9)])
    if kind == 'spheres':
        ball = pv.Sphere(radius=1.0, theta_resolution=40, phi_resolution=40)
        return merged(ball, [np.eye(3) * RADII[i, 0] for i in range(9)])
    if kind == 'crowd':
        return merged(wheel().mesh().extract_surface(algorithm=None), [np.eye(3)] * 9)
    return merged(WEDGE, [np.eye(3)] * 9 if kind in ('points', 'photos') else TURNS)


def merged(mesh, axes):
    meshes = []
    for place, linear in zip(PLACES, axes, strict=True):
        matrix = np.eye(4)
        matrix[:3, :3], matrix[:3, 3] = linear, place
        meshes.append(mesh.transform(matrix, inplace=False))
    return pv.merge(meshes, merge_points=False)


def put(actor, matrix):
    actor.SetPosition(0.2, -0.3, 0.1)
    actor.rotate_x(20)
    actor.RotateWXYZ(30, 0.2, 0.5, 0.4)
    actor.origin = (0.3, 0.1, -0.2)
    actor.scale = (1.3, 0.8, 1.1)
    actor.AddPosition(0.1, 0.0, 0.2)
    actor.user_matrix = matrix


@pytest.mark.parametrize('kind', STRETCHED)
def test_moved_as_a_plain_actor_is(kind):
    matrix = stretched(21)
    plain, pl = stage(), stage()
    actor = plain.add_mesh(plain_of(kind), color='lightblue', reset_camera=False)
    thing = bound(pl, kind)
    put(actor, matrix)
    put(thing, matrix)
    np.testing.assert_allclose(thing.GetMatrix().GetData(), actor.GetMatrix().GetData())
    wanted, found = uncut(plain), uncut(pl)
    shape = (wanted != wanted[0, 0]).any(2), (found != found[0, 0]).any(2)
    assert shape[0].mean() > 0.02
    assert (shape[0] != shape[1]).mean() < (0.02 if kind == 'cards' else 0.006)
    if kind != 'crowd':  # spheres in which they move
        length = np.linalg.norm(np.ptp(np.reshape(actor.bounds, (3, 2)), axis=1))
        assert thing.bounds == pytest.approx(actor.bounds, abs=0.02 * length)


@pytest.mark.parametrize('kind', ['matrices', 'spheres', 'cylinders', 'ellipsoids', 'signs'])
def test_items_set_later_are_placed_by_it(kind):
    matrix = similarity(9, 1.2)
    pl, other = stage(), stage()
    one, two = bound(pl, kind), bound(other, kind)
    one.user_matrix = matrix
    uncut(pl)
    for thing in (one, two):
        if kind == 'matrices':
            thing.update([2, 3], poses=[[0.1, 0.2, 0.3], [-1.0, 0.5, 0.4]])
        elif kind == 'cylinders':
            thing.points_a = PLACES + 0.4
            thing.radius = 0.1
        else:
            thing.points = PLACES[::-1] * 0.7
            if kind == 'signs':
                thing.size = 0.4
            elif kind == 'spheres':
                thing.radius = RADII[:, 1]
    two.user_matrix = matrix
    np.testing.assert_array_equal(uncut(pl), uncut(other))
    assert one.bounds == pytest.approx(two.bounds)
    name = {'matrices': 'poses', 'cylinders': 'points_a'}.get(kind, 'points')
    np.testing.assert_array_equal(getattr(one, name), getattr(two, name))


@pytest.mark.parametrize('kind', ['points', 'spheres', 'capsules', 'ellipsoids', 'signs', 'crowd'])
def test_picked_where_it_is(kind):
    pl = stage()
    thing = bound(pl, kind)
    matrix = similarity(13, 1.1)
    matrix[:3, 3] = 0.4, 0.2, -0.3
    thing.user_matrix = matrix
    seen = uncut(pl)
    ids = pl.ibr.buffer('id')
    middles = np.asarray(thing.dataset().points) if kind != 'points' else thing.item_spheres()[0]
    own = PLACES if kind != 'capsules' else (PLACES + PLACES[::-1]) / 2
    if kind != 'points':
        np.testing.assert_allclose(middles, own @ matrix[:3, :3].T + matrix[:3, 3], atol=1e-9)
    found = set()
    for y, x in np.argwhere((seen != seen[0, 0]).any(2))[::97]:
        hit = thing.pick(int(x), SIZE[1] - 1 - int(y))
        if hit is None:
            continue
        found.add(hit.index)
        pl.renderer.SetWorldPoint(*hit.point, 1.0)
        pl.renderer.WorldToDisplay()
        place = np.array(pl.renderer.GetDisplayPoint()[:2])
        assert np.abs(place - (x, SIZE[1] - 1 - y)).max() < 1
        away = np.linalg.norm(thing.item_spheres()[0][hit.index] - hit.point)
        assert away <= thing.item_spheres()[1][hit.index] * 1.01
    assert len(found) >= 3
    assert (np.isfinite(ids) & (ids >= 0)).any()


@pytest.mark.parametrize(
    'kind', ['points', 'crowd', 'photos', 'spheres', 'cylinders', 'ellipsoids', 'fixed']
)
def test_written_where_it_is(kind):
    pl = stage()
    thing = bound(pl, kind)
    thing.user_matrix = similarity(4, 1.2)
    thing.position = (0.3, 0.0, 0.2)
    plain = pl.ibr.to_plain_plotter()
    wanted, found = uncut(pl), uncut(plain)
    plain.close()
    assert shown(found) > 0.02
    assert ((wanted != wanted[0, 0]).any(2) != (found != found[0, 0]).any(2)).mean() < 0.02


def test_shadows_follow():
    def dark(moved):
        pl = pv.Plotter(off_screen=True, window_size=SIZE, lighting='none')
        pl.add_light(
            pv.Light(position=(2, 1, 12), focal_point=(0, 0, 0), light_type='scene light')
        )
        pl.add_mesh(pv.Plane(i_size=16, j_size=16, center=(0, 0, -3)))
        place = np.array([1.5, -1.0, 0.5])
        balls = pl.ibr.add_spheres(PLACES + (0 if moved else place), 0.4, reset_camera=False)
        pl.ibr.add(pvibr.Shadows(resolution=256))
        pl.camera_position = [(0, -12, 12), (0, 0, -2), UP]
        first = uncut(pl)
        if moved:
            balls.position = place
        return first, uncut(pl)

    np.testing.assert_array_equal(dark(True)[1], dark(False)[1])
    assert (dark(True)[0] != dark(False)[0]).any()


@pytest.mark.parametrize('kind', ['points', 'spheres', 'signs'])
def test_clipping_range_follows(kind):
    pl = stage()
    thing = bound(pl, kind)
    before = shown(uncut(pl))
    toward = (FOCUS - EYE) / np.linalg.norm(FOCUS - EYE)
    thing.SetPosition(*(8 * toward))
    pl.render()
    assert shown(pl.screenshot(None, return_img=True)) > 0.15 * before > 0


def test_a_matrix_changed_in_place_is_followed():
    pl, other = stage(), stage()
    balls, others = bound(pl, 'spheres'), bound(other, 'spheres')
    matrix = pv.vtkmatrix_from_array(np.eye(4))
    balls.SetUserMatrix(matrix)
    uncut(pl)
    matrix.SetElement(0, 3, 0.7)
    others.SetPosition(0.7, 0, 0)
    np.testing.assert_array_equal(uncut(pl), uncut(other))
    matrix.SetElement(0, 0, 3.0)
    others.SetScale(3.0, 1.0, 1.0)
    np.testing.assert_array_equal(uncut(pl), uncut(other))
    matrix.SetElement(0, 0, 0.0)
    with pytest.warns(pvibr.PvibrWarning, match='must be invertible'):
        uncut(pl)


REFUSED = {
    'cylinders': 'add_instances',
    'fixed': 'stay rectangles',
}


@pytest.mark.parametrize('kind', REFUSED)
def test_what_cannot_be_stretched_says_why(kind):
    pl = stage()
    thing = bound(pl, kind)
    thing.scale = 1.5
    before = uncut(pl), thing.bounds
    for change in ({'scale': (1, 2, 1)}, {'user_matrix': np.diag([1.0, 1.0, 3.0, 1.0])}):
        with pytest.raises(ValueError, match=f'must be uniform: .*{REFUSED[kind]}'):
            setattr(thing, *next(iter(change.items())))
    with pytest.raises(ValueError, match='must be invertible'):
        thing.SetScale(0.0, 0.0, 0.0)
    with pytest.raises(ValueError, match='scale or user_matrix'):
        thing.scale = 1e300
    np.testing.assert_array_equal(uncut(pl), before[0])
    assert thing.bounds == before[1]


def test_cards_are_not_mirrored_but_balls_are():
    pl = stage()
    signs, balls = bound(pl, 'signs'), bound(pl, 'spheres')
    with pytest.raises(ValueError, match='must not mirror'):
        signs.scale = (-1, 1, 1)
    balls.scale = (-1, 1, 1)
    low, high, *others = bound(stage(), 'spheres').bounds
    assert balls.bounds == pytest.approx((-high, -low, *others))


@pytest.mark.parametrize('kind', ['impostor', 'layers'])
def test_what_stands_for_actors_says_to_move_these(kind):
    pl = stage()
    ball = pl.add_mesh(pv.Sphere())
    add = pl.ibr.add_impostor if kind == 'impostor' else pl.ibr.add_image_layers
    thing = add([ball])
    for name, args in {'SetPosition': (1, 0, 0), 'RotateX': (3,), 'SetOrigin': (2, 1, 1)}.items():
        with pytest.raises(AttributeError, match=f'{name} has no effect: move its actors'):
            getattr(thing, name)(*args)
    with pytest.raises(AttributeError, match='scale cannot be set: move its actors'):
        thing.scale = 2.0


def test_scaled_by_the_plotter_as_meshes_are():
    def scaled(plain):
        pl = stage()
        pl.add_mesh(pv.Cube(center=(1, 1, 0)), color='tan', reset_camera=False)
        if plain:
            for kind in ('points', 'spheres'):
                pl.add_mesh(plain_of(kind), color='lightblue', reset_camera=False)
        else:
            things = [bound(pl, kind) for kind in ('points', 'spheres')]
            pl.ibr.add_impostor(next(iter(pl.actors.values())))
        uncut(pl)
        pl.set_scale(zscale=1.8, xscale=0.6, reset_camera=False)
        image = uncut(pl)
        if not plain:
            later = pl.ibr.add_spheres(PLACES, RADII[:, 0], reset_camera=False)
            assert later.bounds == pytest.approx(things[1].bounds)
        return image, pl.bounds

    (wanted, whole), (found, bounds) = scaled(True), scaled(False)
    shape = (wanted != wanted[0, 0]).any(2), (found != found[0, 0]).any(2)
    assert (shape[0] != shape[1]).mean() < 0.01
    assert bounds == pytest.approx(whole, abs=0.05)


def test_stretched_spheres_are_picked_written_and_spheres_again():
    pl = stage()
    thing = bound(pl, 'spheres')
    before = uncut(pl)
    thing.scale = (1.0, 1.0, 2.5)
    seen = uncut(pl)
    top = int(np.argmax(PLACES[:, 2]))
    away = PLACES[top] * (1, 1, 2.5) - EYE
    pl.renderer.SetWorldPoint(*(EYE + away), 1.0)
    pl.renderer.WorldToDisplay()
    hit = thing.pick(*pl.renderer.GetDisplayPoint()[:2])
    local = (np.array(hit.point) / (1, 1, 2.5) - PLACES[hit.index]) / RADII[hit.index, 0]
    assert np.linalg.norm(local) == pytest.approx(1.0, abs=1e-6)
    plain = pl.ibr.to_plain_plotter()
    written = uncut(plain)
    plain.close()
    assert ((seen != seen[0, 0]).any(2) != (written != written[0, 0]).any(2)).mean() < 0.01
    assert 'spheres' in thing.report()
    pl.ibr.remove(thing)
    pl.ibr.add(thing)
    np.testing.assert_array_equal(uncut(pl), seen)
    thing.scale = 1.0
    np.testing.assert_array_equal(uncut(pl), before)
