"""The error table: what it compares, from where, in which light."""

from __future__ import annotations

import numpy as np
import pytest
import pyvista as pv

from pvibr.bench.instances.single import ONCE, moved_rows
from pvibr.instances import measure as me
from pvibr.instances.atlas import bounding_sphere
from pvibr.instances.levels import make_model
from pvibr.maths.image_error import box_reduce
from pvibr.meshes.parts import as_parts


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
    ramp = np.arange(side)[:, None] + 3.0 * np.arange(side)
    truth = me._filtered(ramp)
    while me.SIZES[-1] * len(truth) > size * side // me._SAMPLES:
        truth = box_reduce(truth, 2)
    inner = (slice(-1), slice(-1))  # of the last row and column a part is beyond the picture
    np.testing.assert_allclose(truth[inner], me._once(ramp, size)[inner])


@pytest.mark.parametrize('half', [False, True])
def test_the_first_views_are_all_around(sheet, half):
    atlas = sheet.model.atlas
    atlas.half, kept = half, atlas.half
    views = me._poses(atlas, sheet.spacing)[:, 2, :3]
    atlas.half = kept
    assert len(np.unique(np.round(views, 6), axis=0)) == me._COLUMNS * me._ROWS
    for count in (4, me._COLUMNS):
        few = views[:count] - [0, 0, 0.5 * half]
        assert np.linalg.norm(few.mean(0)) < 0.3


def test_only_the_light_kit_shines(sheet):
    assert sheet.renderer.GetLights().GetNumberOfItems() == 5


def test_cards_lie_where_the_mesh_is(atlases):
    ball = make_model(as_parts(pv.Sphere(center=(3, 1, 0))), views=4, tile=64, cache=atlases)
    sheet = me._Sheet(ball)
    size, cell = me.SIZES[-1], round(me.SIZES[-1] * me._CELL)
    middles = []
    for picture in (me._filtered(sheet.draw_mesh(0)), sheet.draw_cards('flat', size)):
        weight = picture[:cell, :cell, 3]
        middles.append((np.indices(weight.shape) * weight).sum((1, 2)) / weight.sum())
    sheet.release()
    # Half a sample would be a quarter of a pixel.
    np.testing.assert_allclose(*middles, atol=0.15)


def test_one_bad_view_counts():
    size = me.SIZES[2]
    cell = round(size * me._CELL)
    truth = np.zeros((cell * me._ROWS, cell * me._COLUMNS, 4))
    row, column = np.indices(truth.shape[:2]) % cell
    truth[np.hypot(row - cell / 2, column - cell / 2) < size / 3] = 1
    picture = truth.copy()
    assert me._moved(picture, truth, size) == 0
    picture[cell // 2, cell // 2] = 0
    assert me._moved(picture, truth, size) == pytest.approx(size / 3 / me._WORST, abs=1)


def test_a_bar_is_never_below_the_mesh_itself():
    meshes = {
        'wires': {64: {ONCE: (1.0, 3.0), '1.0': (0.7, 2.8)}},
        'ball': {64: {ONCE: (1.0, 1.0), '1.0': (0.7, 1.4)}},
    }
    (row,) = (row for row in moved_rows(meshes) if 'max_error 1.0' in row.name)
    assert row.ok
    assert (row.value, row.bar) == (1.4, 1.5)


def test_directions_are_on_the_half_that_is_asked_for():
    assert (me.directions(16, half=True)[:, 2] >= 0).all()
    center, radius = bounding_sphere(me.directions(64))
    assert np.linalg.norm(center) < 0.1
    assert radius < 1.1
