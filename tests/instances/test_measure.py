"""The error table: what it compares, from where, in which light."""

from __future__ import annotations

import numpy as np
import pytest
import pyvista as pv

from pvibr.bench.instances.single import ONCE, moved_rows
from pvibr.instances import measure as me
from pvibr.instances.levels import make_model
from pvibr.maths.image_error import box_reduce
from pvibr.meshes.parts import as_parts

pytestmark = pytest.mark.all_sizes


@pytest.fixture(scope='module')
def sheet(atlases):
    """An off-centre cone on its sheet."""
    cone = pv.Cone(center=(3, 1, 0), resolution=30)
    sheet = me._Sheet(make_model(as_parts(cone), views=4, tile=16, cache=atlases))
    yield sheet
    sheet.release()


@pytest.mark.parametrize('size', me.SIZES[1:])
def test_the_sample_is_in_the_middle_of_the_pixel(size):
    side = round(me.SIZES[-1] * me._SAMPLES * me._CELL)
    ramp = (np.arange(side) // 2).astype(np.uint8)[:, None] + np.zeros((side, side), np.uint8)
    truth = box_reduce(me._reduced(ramp[..., None]), me.SIZES[-1] // size)[..., 0]
    inner = (slice(-1), slice(-1))  # of the last row and column a part is beyond the picture
    once = me._once(ramp, size)
    np.testing.assert_allclose(truth[inner], once[inner], atol=0.5 / 255)


@pytest.mark.parametrize('half', [False, True])
def test_patches_of_views_are_patches_of_directions(half):
    views = me.directions(half)
    assert np.allclose(np.linalg.norm(views, axis=1), 1)
    means = np.stack([me._patches(v) for v in views.T], 1)
    assert np.linalg.norm(means, axis=1).min() > 0.7  # its views look much the same way
    apart = np.linalg.norm(means[:, None] - means, axis=2) + np.eye(16)
    assert apart.min() > 0.2
    assert (views[:, 2] >= 0).all() == half
    assert np.linalg.norm(views.mean(0) - [0, 0, 0.5 * half]) < 0.1


def test_only_the_light_kit_shines(sheet):
    assert sheet.renderer.GetLights().GetNumberOfItems() == 5


@pytest.mark.slow
def test_cards_lie_where_the_mesh_is(atlases):
    ball = make_model(as_parts(pv.Sphere(center=(3, 1, 0))), views=4, tile=64, cache=atlases)
    sheet = me._Sheet(ball)
    size, cell = me.SIZES[-1], round(me.SIZES[-1] * me._CELL)
    middles = []
    for picture in (me._reduced(sheet.draw_mesh(0)), sheet.draw_cards('flat', size)):
        weight = picture[:cell, :cell, 3]
        middles.append((np.indices(weight.shape) * weight).sum((1, 2)) / weight.sum())
    sheet.release()
    # Half a sample would be a quarter of a pixel.
    np.testing.assert_allclose(*middles, atol=0.15)


def test_one_bad_view_is_told_from_others():
    size = me.SIZES[2]
    cell = round(size * me._CELL)
    truth = np.zeros((cell * 8, cell * 8, 4), np.float32)
    row, column = np.indices(truth.shape[:2]) % cell
    truth[np.hypot(row - cell / 2, column - cell / 2) < size / 3] = 1
    picture = truth.copy()
    assert (me._moved(picture, truth, size) == 0).all()
    picture[: cell // 2, :cell] = 0  # half of the first view's disk
    moved = me._moved(picture, truth, size)
    assert moved[0] > size / 5
    assert (moved[1:] == 0).all()


def test_few_pixels_of_an_outline_are_told_by_all_views_of_a_patch():
    rng = np.random.default_rng(9)
    away, views = rng.exponential(size=7000), rng.integers(0, 64, 7000)
    views[views == 5] = 6
    found = me._bounds(away, views, 64, 0.95)
    truth = [np.percentile(away[views == v], 95) if v != 5 else 0.0 for v in range(64)]
    np.testing.assert_allclose(found, truth)
    size = me.SIZES[3]
    cell = round(size * me._CELL)
    truth = np.zeros((cell * 8, cell * 8, 4), np.float32)
    truth[np.indices(truth.shape[:2]).sum(0) % cell > cell // 3] = 1
    picture = truth.copy()
    picture[cell // 2, 10:18] = 0  # a slit within the first view
    assert me._moved(picture, truth, size)[0] > 2
    picture[cell // 2, 14:18] = 1
    assert me._moved(picture, truth, size)[0] == 0


def falling(rows, power=0.6):
    """Return errors whose own FLIP falls with a power of the samples per pixel."""
    return np.c_[rows, np.full(len(rows), power)]


def test_a_colour_is_allowed_by_its_excess_or_its_ratio():
    # Of cards a quarter of the mesh's own beyond four fifths of it, or 0.005.
    rows = [[2.5, 0.08, 0.1], [0, 0.1, 0.1], [0, 0.053, 0.06], [0, 0.018, 0.01], [0, 0.18, 0.2]]
    np.testing.assert_allclose(me.of_cards(falling(rows)), [2, 0.8, 1 / 3, 2, 0.4], atol=1e-9)
    assert np.isclose(me.of_cards([[0, 0.5, 0.25, 0.6]]), 2.5)  # of large ones a ratio
    # What a lighter mesh adds is beside what few samples add: half of that, or 0.01.
    rows = [[0.5, 0.0, 0.1], [2.5, 0.02, 0.06], [0, 0.06, 0.1], [0, 0.04, 0.03], [0, 0.005, 0.01]]
    np.testing.assert_allclose(me.of_meshes(falling(rows)), [0, 2, 1.2, 8 / 3, 0.5], atol=1e-9)


def test_a_step_of_eight_bits_is_no_error():
    rng = np.random.default_rng(4)
    truth = rng.uniform(0.1, 0.9, (40, 40, 4)).astype(np.float32)
    step = rng.integers(-3, 4, truth.shape) * (rng.random((40, 40, 1)) < 0.5)
    told = me._told((truth + step / 255).astype(np.float32), truth)
    more = np.abs(step).max(-1) > 1
    assert 0.3 < more.mean() < 0.6
    assert (told[~more] == truth[~more]).all()
    np.testing.assert_allclose(told[more], (truth + step / 255)[more], atol=1e-6)


@pytest.mark.parametrize('seed', [0, 1])
def test_less_is_allowed_where_the_mesh_has_more_samples(seed):
    rows = falling(np.random.default_rng(seed).uniform(0.01, 0.4, (50, 3)))
    for rule in (me.of_cards, me.of_meshes):
        allowed = [rule(rows, samples) for samples in (0, 1, 4, 8)]
        assert np.array_equal(*allowed[:2])
        assert (np.diff(allowed[1:], axis=0) >= 0).all()
        assert (np.diff(allowed[1:], axis=0) > 0.1).any()


def of_four_samples(parts, folder):
    """Return a model, and over its FLIP at 16 px that of the mesh drawn with four samples."""
    model = make_model(parts, views=4, tile=16, cache=folder)
    row = model.atlas.errors['flat'][list(me.SIZES).index(16)]
    return model, me._sampled(row, 4)[2].mean() / row[:, 2].mean()


def test_the_samples_of_a_mesh_lessen_its_error_as_told(atlases):
    ball = pv.Sphere(theta_resolution=60, phi_resolution=60)
    model, told = of_four_samples(as_parts(ball), atlases)
    sheet = me._Sheet(model)
    picture = sheet.draw_mesh(0)
    sheet.release()
    truth = me._Truth(picture, me._pixels(picture)[16], 16)
    step = me.SIZES[-1] * me._SAMPLES // 16
    places = np.array([(1, 3), (3, 7), (5, 1), (7, 5)]) * step // 8  # as drivers spread them
    four = np.mean([np.roll(picture, (-y, -x), (0, 1))[::step, ::step] for y, x in places], 0)
    found = truth._flip((four / 255).astype(np.float32)).mean() / truth.base.mean()
    assert told == pytest.approx(found, rel=0.2)
    assert told < 0.6


def test_samples_lessen_no_error_within_triangles(atlases):
    checks = 255 * (np.indices((64, 64)).sum(0) % 2).astype(np.uint8)
    texture = pv.Texture(np.repeat(checks[..., None], 3, 2))
    _, told = of_four_samples(as_parts(pv.Plane(), texture=texture), atlases)
    assert told > 0.75


def test_a_bar_is_never_below_the_mesh_itself():
    meshes = {
        'wires': {64: {ONCE: {'moved': 3.0}, '1.0': {'moved': 2.8}}},
        'ball': {64: {ONCE: {'moved': 1.0}, '1.0': {'moved': 1.4}}},
    }
    (row,) = (row for row in moved_rows(meshes) if 'max_error 1.0' in row.name)
    assert row.ok
    assert (row.value, row.bar) == (1.4, 1.5)


@pytest.mark.slow
def test_limits_follow_the_samples_of_the_window(atlases):
    pl = pv.Plotter(off_screen=True, window_size=(200, 150))
    knot = pv.ParametricTorus(1.0, 0.3, u_res=60, v_res=30)
    things = pl.ibr.add_instances(
        knot, [[0, 0, 0], [3, 0, 0]], bake=True, cache=atlases, progress=False
    )
    found = {}
    pl.show(auto_close=False)
    for name, samples in (('one', 0), ('two', 2), ('four', 4), ('again', 0)):
        pl.render_window.SetMultiSamples(samples)
        pl.render()
        found[name] = things.limits[0]
    pl.enable_anti_aliasing('ssaa')
    pl.render()
    ends = [found[name].mesh.mean() for name in ('one', 'two', 'four')] + [
        things.limits[0].mesh.mean()
    ]
    assert (np.diff(ends) < 0).all()  # of five samples
    assert found['again'] is found['one']
    pl.close()
