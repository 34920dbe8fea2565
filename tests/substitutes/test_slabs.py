"""Thin slabs hold what they should, and as few of them as one can find."""

import numpy as np
import pytest
import pyvista as pv
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from pvibr.substitutes.slabs import Cover, hemisphere, thinnest, turned

clouds = st.integers(1, 40).flatmap(
    lambda n: arrays(float, (n, 3), elements=st.floats(-10, 10, width=32))
)


@given(clouds, st.floats(0.01, 30))
def test_a_slab_holds_its_points_and_is_no_thicker_than_at_its_start(points, enough):
    start = np.array([0.0, 0.6, 0.8])
    normal, offset, width = thinnest(points, [start], enough)
    assert np.linalg.norm(normal) == pytest.approx(1)
    assert np.abs(points @ normal - offset).max() <= width / 2 + 1e-9
    if np.ptp(points @ start) <= enough:
        assert width <= np.ptp(points @ start) + 1e-6


@given(st.integers(0, 2**32 - 1), st.floats(1e-3, 0.2))
def test_a_slab_of_a_plate_is_as_thin_as_the_plate(seed, thick):
    rng = np.random.default_rng(seed)
    turn, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    points = rng.uniform(-1, 1, (200, 3)) * [2, 1, thick / 2]
    normal, _, width = thinnest(points @ turn.T, [], 1.2 * thick)
    assert width <= 1.25 * thick  # the search ends a little above what is enough
    assert abs(normal @ turn[:, 2]) > 1 - 3 * thick**2


@given(st.floats(0.05, 0.5))
def test_directions_are_spread_and_turns_are_around(step):
    found = hemisphere(step)
    np.testing.assert_allclose(np.linalg.norm(found, axis=1), 1)
    assert found[:, 2].min() >= 0
    around = turned(np.array([0.6, 0.0, 0.8]), step)
    cosines = around @ [0.6, 0.0, 0.8]
    assert cosines.max() == pytest.approx(1)
    assert np.arccos(np.clip(cosines, -1, 1)).max() < 1.5 * step


@pytest.mark.slow
@settings(max_examples=30)
@given(st.integers(0, 2**32 - 1), st.floats(0.05, 1))
def test_merged_slabs_hold_every_triangle_and_are_not_more(seed, bound):
    rng = np.random.default_rng(seed)
    points = rng.normal(size=(30, 3))
    faces = rng.integers(0, 30, (25, 3))
    corners = points[faces]
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    lengths = np.linalg.norm(across, axis=1)
    normals = np.where(
        lengths[:, None] > 0, across / np.maximum(lengths, 1e-300)[:, None], [1.0, 0, 0]
    )
    flat = lengths > 0  # a slab through each triangle that has a plane
    faces, normals, areas = faces[flat], normals[flat], lengths[flat] / 2
    if not len(faces):
        return
    offsets = (points[faces[:, 0]] * normals).sum(1)
    merged, middles = Cover(points, faces, areas, normals, offsets, bound).merged()
    assert 1 <= len(merged) <= len(normals)
    away = np.abs(points @ merged.T - middles)[faces].max(1)
    assert away.min(1).max() <= bound


def test_two_halves_of_a_wall_are_one():
    wall = pv.Plane(i_resolution=4, j_resolution=4).triangulate().rotate_x(33)
    points, faces = np.asarray(wall.points, float), wall.regular_faces
    normal = np.array([0, -np.sin(np.radians(33)), np.cos(np.radians(33))])
    tilted = turned(normal, 0.1)
    normals, offsets = tilted[[2, 22]], np.zeros(2)
    cover = Cover(points, faces, np.ones(len(faces)), normals, offsets, 0.02)
    cover.holds[:, 0], cover.holds[:, 1] = faces[:, 0] < 12, faces[:, 0] >= 12
    merged, _ = cover.merged()
    assert len(merged) == 1
    assert abs(merged[0] @ normal) > 0.99
