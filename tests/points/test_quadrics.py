"""Cylinders and ellipsoids are to the pixel what rays say; quadrics that blend are in order."""

from __future__ import annotations

from functools import partial

import numpy as np
import pytest
import pyvista as pv

import pvibr
from pvibr.maths import quaternions
from pvibr.points.cylinders import Cylinders
from pvibr.points.ellipsoids import Ellipsoids
from pvibr.points.quadric_rays import CAPS, cast, inner, meet_cylinders, meet_ellipsoids
from pvibr.things.frame import Frame
from tests.points.stage import PASSES, SIZE, aim, floor_and_lamp, pixels, plotter, points_up_to

pytestmark = pytest.mark.sampled


def bars(count=40, seed=0):
    """Return ends and radii of cylinders in a cube of side 2."""
    rng = np.random.default_rng(seed)
    a, b = rng.uniform(-1, 1, (2, count, 3))
    return a, a + 0.5 * (b - a), rng.uniform(0.04, 0.15, count)


def eggs(count=40, seed=0):
    """Return centres, radii and quaternions of ellipsoids in a cube of side 2."""
    rng = np.random.default_rng(seed)
    centers, radii = rng.uniform(-1, 1, (count, 3)), rng.uniform(0.05, 0.35, (count, 3))
    return centers, radii, rng.normal(size=(count, 4))


def rays(pl, things):
    """Return what rays see of cylinders or ellipsoids."""
    frame = Frame.of(pl.renderer)
    if isinstance(things, Ellipsoids):
        return cast(frame, meet_ellipsoids, things.points, things.axes())
    a, b = things.points_a, things.points_b
    meet = partial(meet_cylinders, caps=things.caps)
    return cast(frame, meet, (a + b) / 2, (b - a) / 2, things.radius)


def compare(pl, things, see, atol=1.01 / 255, edges=2e-3):
    """Check colours, coverage and depth of what a plotter shows, all white."""
    picture, far = see.grab(pl), see.depths(pl)
    ids, depth, normals = rays(pl, things)
    same = inner(ids)
    expected = np.where(ids >= 0, np.maximum(normals[..., 2], 0), 0)
    # Edges within one thing: between a cap and a wall, or along a crease.
    turns = [np.abs(np.roll(normals, k, a) - normals).max(-1) for a in (0, 1) for k in (-1, 1)]
    same &= np.max(turns, 0) < 0.5
    assert ((ids >= 0) != np.isfinite(far)).mean() < edges
    assert (np.abs(picture[..., 0] - expected)[same] <= atol).mean() > 0.9995
    seen = same & (ids >= 0)
    assert (np.abs(far[seen] - depth[seen]) < 1e-3 * depth[seen]).mean() > 0.9995
    assert seen.sum() > 100


def add(pl, kind, offset=0.0, scale=1.0, **kwargs):
    """Add what a test names: ellipsoids, or cylinders with some caps."""
    kwargs = {'color': 'white', 'diffuse': 1.0, **kwargs}
    if kind == 'ellipsoids':
        centers, radii, turns = eggs()
        return pl.ibr.add_ellipsoids(centers * scale + offset, radii * scale, turns, **kwargs)
    a, b, radii = bars()
    ends = a * scale + offset, b * scale + offset
    caps = None if kind == 'open' else kind
    return pl.ibr.add_cylinders(*ends, radii * scale, caps=caps, **kwargs)


KINDS = ['ellipsoids', 'flat', 'round', 'open']


@pytest.mark.parametrize('offset', [0.0, 1e6])
@pytest.mark.parametrize('parallel', [None, 2.5], ids=['perspective', 'parallel'])
@pytest.mark.parametrize('way', ['points', 'quads'])
@pytest.mark.parametrize('kind', KINDS)
def test_pixels_are_those_of_rays(kind, way, parallel, offset, see, monkeypatch):
    points_up_to(60.0 if way == 'points' else -1.0, monkeypatch)
    pl = plotter()
    things = add(pl, kind, offset)
    for eye in [(0, -6, 1), (3, 3, 4), (0.1, 0.2, -9)]:
        aim(pl, np.array(eye) + offset, np.full(3, offset), parallel)
        compare(pl, things, see, atol=1.01 / 255 if not offset else 3.01 / 255)
    assert things.report()[way] > 0


@pytest.mark.parametrize('scale', [1e-9, 1e9])
@pytest.mark.parametrize('parallel', [None, 1.3], ids=['perspective', 'parallel'])
@pytest.mark.parametrize('kind', KINDS)
def test_any_scale(kind, parallel, scale, see):
    pl = plotter()
    things = add(pl, kind, scale=scale)
    aim(pl, np.array((3, 3, 4)) * scale, parallel=parallel and parallel * scale)
    compare(pl, things, see)


@pytest.mark.parametrize('eye', [(0, -1.2, 0), (0.3, 0.1, 0.2), (0, 0, 0.9), (-0.6, 0.4, 0)])
@pytest.mark.parametrize('kind', KINDS)
def test_an_eye_among_them_and_a_cut_by_the_near_plane(kind, eye, see):
    pl = plotter()
    things = add(pl, kind)
    aim(pl, eye, np.add(eye, (0.3, 1, 0.1)), clip=(0.2, 10))
    compare(pl, things, see)


@pytest.mark.parametrize('parallel', [None, 0.4])
@pytest.mark.parametrize('caps', CAPS)
def test_an_eye_in_a_pipe_and_along_it(caps, parallel, see):
    pl = plotter()
    things = pl.ibr.add_cylinders(
        [[0, -5, 0]], [[0, 5, 0]], 0.5, caps=caps, color='white', diffuse=1.0
    )
    for eye, focus in [((0.1, 0, 0.2), (0.3, 9, 0)), ((0.1, -9, 0.1), (0.2, 0, 0.1))]:
        aim(pl, eye, focus, parallel, clip=(0.1, 30))
        compare(pl, things, see, edges=6e-3)


@pytest.mark.parametrize('kind', ['cylinders', 'ellipsoids'])
def test_needles_have_no_gaps(kind, see):
    pl = plotter()
    turn = np.radians(np.arange(0, 180, 15) + 1.0)  # none on the border of two pixels
    way = np.stack([np.cos(turn), 0 * turn, np.sin(turn)], 1)
    if kind == 'cylinders':
        pl.ibr.add_cylinders(0.1 * way, way, 1e-3, color='white', ambient=1.0)
    else:
        turns = quaternions.from_axis_angle([[0, -1, 0]], turn)
        pl.ibr.add_ellipsoids(
            0.55 * way, (0.45, 4.5e-4, 4.5e-4), turns, color='white', ambient=1.0
        )
    aim(pl, (0, -5, 0))
    lit = see.grab(pl)[..., 0] > 0.5
    for axis in way:
        x, y = pixels(pl, np.linspace(0.3, 0.8, 200)[:, None] * axis)
        near = [lit[y + i, x + j] for i in (-1, 0, 1) for j in (-1, 0, 1)]
        assert lit[y, x].mean() > 0.8
        assert np.any(near, 0).all()
    assert lit.sum() < 2 * len(way) * 45


def test_needles_that_are_seen_are_exact(see):
    pl = plotter()
    things = pl.ibr.add_ellipsoids(
        [[0, 0, 0]], (50.0, 0.05, 0.1), [[1, 0.2, 0.3, 0.4]], color='white', diffuse=1.0
    )
    aim(pl, (0, -2, 0.3), clip=(0.1, 100))
    compare(pl, things, see, atol=3.01 / 255)


def test_what_has_no_size(see):
    pl = plotter()
    none, half = np.zeros((3, 3)), np.array([[1.0, 0, 0]] * 3)
    for caps, seen in (('flat', False), (None, False), ('round', True)):
        things = pl.ibr.add_cylinders(none, none, 0.5, caps=caps, color='white', ambient=1.0)
        aim(pl, (0, -5, 0))
        assert (see.grab(pl).max() > 0.5) == seen
        assert (things.pick(SIZE[0] // 2, SIZE[1] // 2) is not None) == seen
        things.remove()
    for made in (
        pl.ibr.add_cylinders(none, half, 0.0),
        pl.ibr.add_ellipsoids(none, 0.0),
        pl.ibr.add_ellipsoids(none[:0], 1.0),
        pl.ibr.add_cylinders(none[:0], none[:0]),
    ):
        assert see.grab(pl).max() == 0
        assert made.pick(SIZE[0] // 2, SIZE[1] // 2) is None
        made.remove()
    disc = pl.ibr.add_ellipsoids([[0, 0, 0]], (1.0, 0.0, 1.0), color='white', diffuse=1.0)
    aim(pl, (0.5, -5, 1))
    compare(pl, disc, see, edges=5e-3)


def test_halves_have_the_colours_of_their_ends(see):
    pl = plotter()
    ends, colors = ([[-1, 0, 0]], [[1, 0, 0]]), np.array([[[255, 0, 0], [0, 255, 0]]], np.uint8)
    halves = pl.ibr.add_cylinders(*ends, 0.3, colors=colors, lighting=False)
    aim(pl, (0, -5, 0))
    row = see.grab(pl)[SIZE[1] // 2]
    middle = SIZE[0] // 2
    np.testing.assert_allclose(row[middle - 9], [1, 0, 0], atol=0.01)
    np.testing.assert_allclose(row[middle + 9], [0, 1, 0], atol=0.01)
    halves.remove()
    pl.ibr.add_cylinders(*ends, 0.3, colors=colors, lighting=False, blend=True)
    aim(pl, (0, -5, 0))
    row = see.grab(pl)[SIZE[1] // 2]
    lit = np.flatnonzero(row.max(1) > 0)
    share = row[lit, 1] / row[lit].sum(1)
    assert np.abs(share - (np.arange(len(lit)) + 0.5) / len(lit)).max() < 0.05


def test_scalars_of_both_ends_and_of_each(see):
    pl = plotter()
    ends = [[-1, 0, 0]], [[1, 0, 0]]
    things = pl.ibr.add_cylinders(
        *ends, 0.3, scalars=[[0.0, 1.0]], cmap='gray', lighting=False, show_scalar_bar=False
    )
    aim(pl, (0, -5, 0))
    row, middle = see.grab(pl)[SIZE[1] // 2, :, 0], SIZE[0] // 2
    assert row[middle - 9] < 0.01
    assert row[middle + 9] > 0.99
    assert things.scalars.shape == (1, 2)
    things.scalars = [1.0]
    assert see.grab(pl)[SIZE[1] // 2, middle - 9, 0] > 0.99
    things.map(clim=(0, 2))
    assert abs(see.grab(pl)[SIZE[1] // 2, middle - 9, 0] - 0.5) < 0.01


def test_places_can_be_changed(see):
    pl = plotter()
    rod = pl.ibr.add_cylinders([[-1, 0, 0]], [[-0.5, 0, 0]], 0.3, color='white', ambient=1.0)
    egg = pl.ibr.add_ellipsoids([[-1, 0, -0.5]], 0.2, color='white', ambient=1.0)
    aim(pl, (0, -5, 0))
    assert see.grab(pl)[:, SIZE[0] // 2 :].max() == 0
    rod.points_a, rod.points_b, rod.radius = [[0.5, 0, 0]], [[1, 0, 0]], 0.1
    egg.points, egg.radii, egg.orientation = [[1, 0, -0.5]], (0.3, 0.1, 0.1), np.eye(3)
    picture = see.grab(pl)
    assert picture[:, : SIZE[0] // 2].max() == 0
    assert picture[:, SIZE[0] // 2 :].max() > 0.5
    np.testing.assert_allclose(rod.bounds, (0.5, 1, -0.1, 0.1, -0.1, 0.1))
    np.testing.assert_allclose(egg.bounds, (0.7, 1.3, -0.1, 0.1, -0.6, -0.4))
    with pytest.raises(ValueError, match=r'points_b must have 2 rows, .*got 1; give both'):
        rod.points_a = np.zeros((2, 3))


@pytest.mark.parametrize('kind', KINDS)
def test_rays_pick_what_is_seen(kind):
    pl = plotter()
    things = add(pl, kind)
    aim(pl, (0, -5, 1))
    ids, depth, _ = rays(pl, things)
    frame, good = Frame.of(pl.renderer), inner(ids)
    for x, y in [(75, 45), (60, 40), (90, 55), (75, 20), (3, 3)]:
        hit, row = things.pick(x + 0.5, SIZE[1] - y - 0.5), (y, x)
        if good[row]:
            assert (-1 if hit is None else hit.index) == (
                ids[row] % len(things) if ids[row] >= 0 else -1
            )
        if hit is not None and good[row]:
            z = frame.view_from_world[2] @ [*hit.point, 1]
            np.testing.assert_allclose(-z, depth[row], rtol=1e-5)


@pytest.mark.parametrize('kind', ['ellipsoids', 'round'])
def test_shadows_fall_from_them_and_buffers_know_them(kind, see):
    pl, floor = floor_and_lamp()
    if kind == 'round':
        thing = pl.ibr.add_cylinders([[-0.5, 0, 1]], [[0.5, 0, 1]], 0.4, caps='round')
    else:
        thing = pl.ibr.add_ellipsoids([[0, 0, 1]], (0.9, 0.4, 0.4))
    pl.ibr.add(pvibr.Shadows())
    aim(pl, (0, -8, 4.5), (0, 0, 0.5))
    picture, (x, y) = see.grab(pl), pixels(pl, [(0.5, -0.1, 0), (1.5, -1.5, 0)])
    under, free = picture[y, x, 0]
    assert under < 0.1
    assert free > 0.8
    ids = pl.ibr.buffer('id')
    found = {id(pl.ibr.buffer_objects[int(i)]) for i in np.unique(ids[ids >= 0])}
    assert {id(thing), id(floor)} <= found


@pytest.mark.parametrize('extra', ['ssaa', 'peeling', 'edl', 'ssao', 'msaa'])
def test_passes_see_translucent_ones_as_meshes(extra, see):
    a, b, radii = bars(8, seed=5)
    centers, axes, turns = eggs(8, seed=6)
    pictures = []
    looks = {'color': 'white', 'diffuse': 1.0, 'opacity': 0.5}
    for exact in (True, False):
        pl = plotter()
        if exact:
            pl.ibr.add_cylinders(a, b, radii, **looks)
            pl.ibr.add_ellipsoids(centers, axes, turns, **looks)
        for i in range(0 if exact else len(a)):
            rod = pv.Cylinder(
                center=(a[i] + b[i]) / 2,
                direction=b[i] - a[i],
                radius=radii[i],
                height=np.linalg.norm(b[i] - a[i]),
                resolution=90,
            )
            matrix = np.eye(4)
            turn = quaternions.to_matrices(quaternions.normalized(turns[i]))
            matrix[:3, :3], matrix[:3, 3] = turn * axes[i], centers[i]
            egg = pv.Sphere(radius=1.0, theta_resolution=60, phi_resolution=60)
            egg = egg.transform(matrix, inplace=False).compute_normals()
            for mesh in (rod.compute_normals(split_vertices=True), egg):
                pl.add_mesh(mesh, smooth_shading=True, culling='back', **looks)
        PASSES[extra](pl)
        aim(pl, (0, -6, 1))
        pictures.append(see.grab(pl))
        pl.close()
    assert pictures[0].max() > 0.4
    share = (np.abs(pictures[0] - pictures[1]).max(-1) > 0.06).mean()
    # Without peeling, meshes blend in the order in which they were added.
    assert share < (0.02 if extra == 'peeling' else 0.15)


# -- what blends ------------------------------------------------------------------------------


@pytest.mark.parametrize('other', [False, True], ids=['alone', 'with a mesh'])
@pytest.mark.parametrize('peeling', [False, True], ids=['sorted', 'peeled'])
@pytest.mark.parametrize('kind', ['spheres', 'cylinders', 'ellipsoids'])
def test_translucent_ones_are_in_order(kind, peeling, other, see):
    """Three in a row from the eye on, in every order: the nearest counts most."""
    colors = np.eye(3)
    pictures = []
    for order in ([0, 1, 2], [2, 0, 1], [1, 2, 0]):
        pl = plotter()
        y = np.array([-1.0, 0, 1])[order]
        places = np.stack([0 * y, y, 0 * y], 1)
        looks = {'colors': colors[order], 'lighting': False, 'opacity': 0.5}
        if kind == 'spheres':
            pl.ibr.add_spheres(places, 0.4, **looks)
        elif kind == 'cylinders':
            up = np.array([0, 0, 0.4])
            pl.ibr.add_cylinders(places - up, places + up, 0.4, **looks)
        else:
            pl.ibr.add_ellipsoids(places, (0.4, 0.3, 0.4), **looks)
        if other:
            sheet = pv.Plane(center=(0, 0.5, 0), direction=(0, 1, 0))
            pl.add_mesh(sheet, color='white', opacity=0.5, lighting=False)
        if peeling:
            pl.enable_depth_peeling()
        aim(pl, (0, -6, 0.01))
        pictures.append(see.grab(pl)[SIZE[1] // 2, SIZE[0] // 2])
        pl.close()
    layers = [[1, 0, 0], [0, 1, 0], *([[1, 1, 1]] if other else []), [0, 0, 1]]
    expected = sum(0.5 ** (k + 1) * np.array(c) for k, c in enumerate(layers))
    np.testing.assert_allclose(pictures, [expected] * 3, atol=0.02)


def test_opacity_of_each_and_of_all(see):
    pl = plotter()
    things = pl.ibr.add_spheres(
        [[-1, 0, 0], [1, 0, 0]], 0.5, color='white', lighting=False, opacity=[0.25, 1.0]
    )
    aim(pl, (0, -5, 0))
    y, left, right = SIZE[1] // 2, 42, 107
    shown = [see.grab(pl)[y, x, 0] for x in (left, right)]
    np.testing.assert_allclose(shown, [0.25, 1.0], atol=0.01)
    assert things.depths() == []
    things.opacity = 0.5
    np.testing.assert_allclose(see.grab(pl)[y, [left, right], 0], 0.5, atol=0.01)
    things.colors = [[1.0, 0, 0], [0, 1.0, 0]]
    np.testing.assert_allclose(see.grab(pl)[y, left], [0.5, 0, 0], atol=0.01)
    things.opacity = 1.0
    np.testing.assert_allclose(see.grab(pl)[y, left], [1, 0, 0], atol=0.01)
    assert len(things.depths()) > 0
    things.prop.opacity = 0.25
    np.testing.assert_allclose(see.grab(pl)[y, left], [0.25, 0, 0], atol=0.01)
    things.opacity = [0.0, 0.5]
    np.testing.assert_allclose(see.grab(pl)[y, [left, right]], [[0, 0, 0], [0, 0.5, 0]], atol=0.01)


@pytest.mark.parametrize('kind', ['ellipsoids', 'round'])
def test_alpha_of_colors_multiplies_opacity(kind, see):
    count = len((eggs if kind == 'ellipsoids' else bars)()[0])
    colors = np.random.default_rng(7).uniform(0.2, 1, (count, 4))
    colors[0, 3] = 1.0

    def shown(colors, opacity):
        pl = plotter()
        things = add(pl, kind, colors=colors, opacity=opacity, lighting=False)
        aim(pl, (0, -6, 1))
        plain = pl.ibr.to_plain_plotter()
        pictures = see.grab(pl), plain.screenshot(None, return_img=True) / 255
        assert things.blends
        things.colors = colors[:, :3]
        assert things.blends == (np.min(opacity) < 1)
        for each in (pl, plain):
            each.close()
        return pictures

    for opacity in (1.0, 0.5, np.linspace(0.3, 1, count)):
        wanted = shown(colors[:, :3], colors[:, 3] * opacity)
        for found, want in zip(shown(colors, opacity), wanted, strict=True):
            np.testing.assert_allclose(found, want, atol=0.02)
            assert 0.1 < want.max() < 1


def test_many_translucent_ones_are_what_peeling_shows(see):
    rng = np.random.default_rng(3)
    centers = rng.uniform(-1, 1, (300, 3))
    colors = rng.integers(0, 256, (300, 3)).astype(np.uint8)
    pictures = []
    for peeling in (False, True):
        pl = plotter()
        pl.ibr.add_spheres(centers, 0.06, colors=colors, opacity=0.5, diffuse=1.0)
        if peeling:
            pl.enable_depth_peeling(number_of_peels=30)
        aim(pl, (0, -6, 1))
        pictures.append(see.grab(pl))
        pl.close()
    assert pictures[0].max() > 0.3
    assert (np.abs(pictures[0] - pictures[1]).max(-1) > 0.03).mean() < 0.01


def test_what_blends_is_behind_what_is_opaque(see):
    pl = plotter()
    pl.add_mesh(pv.Plane(center=(0, -0.2, 0), direction=(0, 1, 0)), color='red', lighting=False)
    pl.ibr.add_spheres([[0, 0, 0]], 0.4, color='white', lighting=False, opacity=0.5)
    aim(pl, (0, -5, 0))
    middle = see.grab(pl)[SIZE[1] // 2, SIZE[0] // 2]
    np.testing.assert_allclose(middle, [1, 0.5, 0.5], atol=0.01)


# -- what is refused --------------------------------------------------------------------------


REFUSED = {
    'add_cylinders': [
        ({'radius': -1.0}, 'radius must be .* got -1'),
        ({'points_b': [[0, 0, 1.0]] * 2}, 'points_b must have 1 rows.*got 2'),
        ({'caps': 'square'}, r"caps must .*got 'square'"),
        ({'points_a': [[0, 0, np.nan]]}, 'finite'),
        ({'scalars': [[1.0, 2.0, 3.0]]}, r'scalars must be \(1,\) numbers'),
        ({'opacity': 2.0}, 'opacity must be'),
    ],
    'add_ellipsoids': [
        ({'radii': [1.0, 2.0]}, 'radii must be .* got shape'),
        ({'radii': (1, 1, -2)}, 'radii must be .* got -2'),
        ({'orientation': [0.0, 0, 0, 0]}, 'of length above 0'),
        ({'orientation': [1.0, 0, 0]}, 'orientation must be .* got shape'),
        ({'orientation': np.ones((3, 3))}, 'orthonormal'),
    ],
    'add_spheres': [
        ({'radius': -1.0}, 'radius must be .* got -1'),
        ({'radius': np.nan}, 'radius must be .* got nan'),
        ({'radius': 1e300}, 'radius must be .* got 1e.300'),
        ({'radius': [1.0, 2.0]}, 'radius must be .* got shape'),
        ({'points': [[0, 0, np.inf]]}, 'finite'),
        ({'points': [[0.0, 0.0]]}, 'shape'),
        ({'scalars': [1.0, 2.0]}, r'scalars must be \(1,\) numbers'),
        ({'colors': [[2.0, 0, 0]]}, 'from 0 to 1'),
    ],
}


@pytest.mark.parametrize(
    ('method', 'given', 'match'), [(k, *case) for k, cases in REFUSED.items() for case in cases]
)
def test_what_is_refused_adds_nothing(method, given, match):
    pl = plotter()
    good = {'points': [[0.0, 0, 0]]}
    if method == 'add_cylinders':
        good = {'points_a': [[0.0, 0, 0]], 'points_b': [[0.0, 0, 1]]}
    with pytest.raises(ValueError, match=match):
        getattr(pl.ibr, method)(**good | given)
    assert not pl.ibr.effects


def test_unknown_looks_are_refused():
    with pytest.raises(TypeError, match="no argument 'colour'; did you mean 'color'"):
        Cylinders([[0, 0, 0]], [[0, 0, 1]], colour='red')
