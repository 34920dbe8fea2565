"""The error table: what it compares, from where, in which light."""

from __future__ import annotations

import numpy as np
import pytest
import pyvista as pv

from benchmarks.instances.single import ONCE, moved_rows
from pvibr.instances import measure as me
from pvibr.instances import view_pictures as vp
from pvibr.instances.levels import make_model
from pvibr.instances.view_sheet import Sheet
from pvibr.maths.image_error import Silhouette, box_reduce
from pvibr.meshes.parts import as_parts

pytestmark = pytest.mark.all_sizes


SMALL, LARGE = me.LAYOUTS


def sheet_of(model, layout=SMALL):
    """Return a model's views of a layout."""
    return Sheet(model, layout, me.directions(layout.side))


def moved_by(picture, truth):
    """Return by how much outlines of a picture are displaced in each patch, px."""
    silhouettes = (Silhouette(p[..., 3]) for p in (picture, truth))
    return vp.displacement_of(*silhouettes, 8)


@pytest.fixture(scope='module')
def sheet(atlases):
    """An off-centre cone on its sheet."""
    cone = pv.Cone(center=(3, 1, 0), resolution=30)
    sheet = sheet_of(make_model(as_parts(cone), views=4, tile=16, cache=atlases))
    yield sheet
    sheet.__exit__()


@pytest.mark.parametrize('layout', me.LAYOUTS)
def test_the_sample_is_in_the_middle_of_the_pixel(layout):
    largest, size = layout.sizes[-1], layout.sizes[0]
    side = round(largest * vp.SAMPLES * vp.CELL)
    ramp = (np.arange(side) // 2).astype(np.uint16)[:, None] + np.zeros((side, side), np.uint16)
    truth = box_reduce(vp.reduced(ramp[..., None]), largest // size)[..., 0]
    inner = (slice(-1), slice(-1))  # of the last row and column a part is beyond the picture
    once = vp.one_sample(ramp, largest, size)
    np.testing.assert_allclose(truth[inner], once[inner], atol=0.5 / 255)


@pytest.mark.parametrize('layout', me.LAYOUTS)
@pytest.mark.parametrize('half', [False, True])
def test_patches_of_views_are_patches_of_directions(half, layout):
    views = me.directions(layout.side, half)
    assert np.allclose(np.linalg.norm(views, axis=1), 1)
    means = np.stack([vp.patches(v) for v in views.T], 1)
    assert np.linalg.norm(means, axis=1).min() > 0.7  # its views look much the same way
    apart = np.linalg.norm(means[:, None] - means, axis=2) + np.eye(16)
    assert apart.min() > (0.2 if layout is SMALL else 0.1)
    assert (views[:, 2] >= 0).all() == half
    assert np.linalg.norm(views.mean(0) - [0, 0, 0.5 * half]) < 0.1


def test_only_the_light_kit_shines(sheet):
    assert sheet.renderer.GetLights().GetNumberOfItems() == 5


@pytest.mark.slow
def test_cards_lie_where_the_mesh_is(atlases):
    ball = make_model(as_parts(pv.Sphere(center=(3, 1, 0))), views=4, tile=64, cache=atlases)
    sheet = sheet_of(ball, LARGE)
    size = LARGE.sizes[-1]
    cell = round(size * vp.CELL)
    middles = []
    for picture in (vp.reduced(sheet.draw_mesh(0)), sheet.draw_cards('flat', size)):
        weight = picture[:cell, :cell, 3]
        middles.append((np.indices(weight.shape) * weight).sum((1, 2)) / weight.sum())
    sheet.__exit__()
    # Half a sample would be a quarter of a pixel.
    np.testing.assert_allclose(*middles, atol=0.15)


def test_one_bad_view_is_told_from_others():
    size = 32
    cell = round(size * vp.CELL)
    truth = np.zeros((cell * 8, cell * 8, 4), np.float32)
    row, column = np.indices(truth.shape[:2]) % cell
    truth[np.hypot(row - cell / 2, column - cell / 2) < size / 3] = 1
    picture = truth.copy()
    assert (moved_by(picture, truth) == 0).all()
    picture[: cell // 2, :cell] = 0  # half of the first view's disk
    moved = moved_by(picture, truth)
    assert moved[0] > size / 5
    assert (moved[1:] == 0).all()


def test_few_pixels_of_an_outline_are_told_by_all_views_of_a_patch():
    rng = np.random.default_rng(9)
    away, views = rng.exponential(size=7000), rng.integers(0, 64, 7000)
    views[views == 5] = 6
    found = vp.quantiles(away, views, 64, 0.95)
    truth = [np.percentile(away[views == v], 95) if v != 5 else 0.0 for v in range(64)]
    np.testing.assert_allclose(found, truth)
    size = 64
    cell = round(size * vp.CELL)
    truth = np.zeros((cell * 8, cell * 8, 4), np.float32)
    truth[np.indices(truth.shape[:2]).sum(0) % cell > cell // 3] = 1
    picture = truth.copy()
    picture[cell // 2, 10:18] = 0  # a slit within the first view
    assert moved_by(picture, truth)[0] > 2
    picture[cell // 2, 14:18] = 1
    assert moved_by(picture, truth)[0] == 0


def test_a_colour_is_allowed_in_shares_of_the_meshs_own():
    def colours(needs, rows):
        return needs([[0.0, *row, 0.0] for row in rows])['colour']

    # Of cards all of it, or 0.005 beyond 0.75 of it; of lighter meshes 0.35, or 0.005.
    cards = colours(me.card_needs, [(0.1, 0.1), (0.16, 0.1), (0.0125, 0.01), (0.05, 0.1)])
    np.testing.assert_allclose(cards, [1, 2, 1, 0.5], atol=1e-9)
    meshes = colours(me.mesh_needs, [(0.035, 0.1), (0.07, 0.1), (0.005, 0.001), (0.0, 0.1)])
    np.testing.assert_allclose(meshes, [1, 2, 1, 0], atol=1e-9)


@pytest.mark.parametrize('rule', [me.card_needs, me.mesh_needs])
def test_the_worst_cause_decides(rule):
    needs = rule([[me.SLACK + 3.0, 0.0, 0.1, 0.0], [0.0, 0.0, 0.1, 2 * me.BLUR]])
    np.testing.assert_allclose(needs['outline'], [3, 0])
    np.testing.assert_allclose(needs['blur'], [0, 2])
    np.testing.assert_allclose(me.worst(needs), [3, 2])


def test_blurred_cards_are_told_from_sharp_ones(atlases):
    checks = 255 * (np.indices((64, 64)).sum(0) % 2).astype(np.uint8)
    checkered = pv.Texture(np.kron(checks, np.ones((4, 4), np.uint8))[..., None].repeat(3, 2))
    blurs = {}
    for tile in (16, 128):
        model = make_model(
            as_parts(pv.Plane(), texture=checkered), views=4, tile=tile, cache=atlases
        )
        sheet = sheet_of(model)
        rows = {
            truth.size: truth.card_errors(sheet.draw_cards('flat', truth.size))
            for truth in me._sized_references(sheet.draw_mesh(0), sheet.layout)
        }
        blurs[tile] = np.median(me.card_needs(rows[64])['blur'])
        assert not rows[16][:, 3].any()
        sheet.__exit__()
    assert blurs[16] > 2 * blurs[128]
    assert blurs[16] > 1


def test_a_step_of_eight_bits_is_no_error():
    rng = np.random.default_rng(4)
    truth = rng.uniform(0.1, 0.9, (40, 40, 4)).astype(np.float32)
    step = rng.integers(-3, 4, truth.shape) * (rng.random((40, 40, 1)) < 0.5)
    told = vp.without_rounding((truth + step / 255).astype(np.float32), truth)
    more = np.abs(step).max(-1) > 1
    assert 0.3 < more.mean() < 0.6
    assert (told[~more] == truth[~more]).all()
    np.testing.assert_allclose(told[more], (truth + step / 255)[more], atol=1e-6)


def test_a_bar_is_never_below_the_mesh_itself():
    meshes = {
        'wires': {64: {ONCE: {'moved': 3.0}, '1.0': {'moved': 2.8}}},
        'ball': {64: {ONCE: {'moved': 1.0}, '1.0': {'moved': 1.4}}},
    }
    (row,) = (row for row in moved_rows(meshes) if 'max_error 1.0' in row.name)
    assert row.ok
    assert (row.value, row.bar) == (1.4, 1.5)


@pytest.mark.slow
def test_limits_do_not_depend_on_the_samples_of_the_window(atlases):
    pl = pv.Plotter(off_screen=True, window_size=(200, 150))
    knot = pv.ParametricTorus(1.0, 0.3, u_res=60, v_res=30)
    things = pl.ibr.add_instances(
        knot, [[0, 0, 0], [3, 0, 0]], bake=True, cache=atlases, progress=False
    )
    pl.show(auto_close=False)
    limits = things.limits[0]
    for samples in (0, 4, 8):
        pl.render_window.SetMultiSamples(samples)
        pl.render()
        assert things.limits[0] is limits
    pl.close()
