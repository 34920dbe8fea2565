"""The support function: never less than that of the points, and the same on the GPU."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from pvibr.instances.support import SIDE, box_of, support, support_table
from tests.maths.card_shader import evaluated

POINTS = arrays(float, (12, 3), elements=st.floats(-1, 1))
AXES = np.concatenate([np.eye(3), -np.eye(3)])


def directions(count=4000):
    d = np.random.default_rng(3).normal(size=(count, 3))
    d /= np.linalg.norm(d, axis=1)[:, None]
    return np.concatenate([AXES, d])


@settings(deadline=None, max_examples=40)
@example(points=np.concatenate([[[1.0, 1, -1]], np.full((11, 3), -1.0)]))
@example(points=np.tile(2 * np.eye(3) - 1, (4, 1)))
@given(points=POINTS)
def test_nothing_reaches_farther(points):
    d = directions()
    found, exact = support(support_table(points), d), (d @ points.T).max(1)
    assert (found >= exact - 1e-12).all()
    np.testing.assert_allclose(found[:6], exact[:6], atol=1e-12)
    # Points differ by at most 4 along a step of 1/16 of the octahedron. Within a triangle,
    # interpolating their maximum adds the differences weighted by the products of two barycentric
    # coordinates, whose sum is at most 1/3; lengths by the octahedron's are up to 3**0.5.
    assert (found - exact).max() < 4 / 16 / 3 * 3**0.5


@settings(deadline=None, max_examples=40)
@given(points=POINTS, at=arrays(float, 3, elements=st.floats(-2, 2)))
def test_shapes_are_moved_by_the_table_of_a_point(points, at):
    moved = support_table(points) + support_table(at[None])
    np.testing.assert_allclose(moved, support_table(points + at), atol=1e-12)
    box = np.stack([points.min(0), points.max(0)]) + at
    np.testing.assert_allclose(box_of(moved), box, atol=1e-12)


def test_room_is_a_sphere_around_each_point():
    d = directions()
    found = support(support_table([[0.5, 0.0, 0.0]], room=0.25), d)
    np.testing.assert_allclose(found, 0.5 * d[:, 0] + 0.25, atol=1e-3)


@pytest.mark.parametrize('length', [0.01, 1.0, 300.0])
def test_distances_grow_with_the_vector(length):
    d, table = directions(), support_table(np.random.default_rng(1).normal(size=(50, 3)))
    np.testing.assert_allclose(support(table, length * d), length * support(table, d), rtol=1e-9)


MAIN = 'void main() { gl_FragData[0] = vec4(ibr_support_of(texture(points, uv).xyz)); }'


def test_shader_is_the_same():
    d = directions(1018).reshape(32, 32, 3)
    table = support_table(np.random.default_rng(2).normal(size=(30, 3)) * [1.0, 0.2, 0.6])
    (distances,) = evaluated(MAIN, d, table)
    assert table.shape == (SIDE, SIDE)
    np.testing.assert_allclose(distances[..., 0], support(table, d), atol=1e-5)
