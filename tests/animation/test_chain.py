"""Chains: forward kinematics against the plain product of matrices."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pvibr.animation import batched_quaternions as columns
from pvibr.animation.chain import Chain
from pvibr.maths import quaternions as quat
from pvibr.maths.transforms import trs


@st.composite
def trees(draw):
    n = draw(st.integers(1, 20))
    parents = [draw(st.integers(-1, i - 1)) for i in range(n)]
    return parents, np.random.default_rng(draw(st.integers(0, 99)))


@given(trees())
def test_world_is_the_product_of_matrices_from_the_root(tree):
    parents, rng = tree
    offsets = rng.normal(size=(len(parents), 3))
    rotations = quat.normalized(rng.normal(size=(len(parents), 4)))
    chain = Chain(parents, offsets)
    world = chain.world(rotations)
    for joint, parent in enumerate(parents):
        above = np.eye(4) if parent < 0 else world[parent]
        expected = above @ trs(offsets[joint], rotations[joint])[0]
        np.testing.assert_allclose(world[joint], expected, atol=1e-12)
        assert chain.path(joint)[-1] == joint
        origins = world[chain.path(joint), :3, 3]
        bones = np.linalg.norm(np.diff(origins, axis=0), axis=1)
        assert np.isclose(chain.reach(joint), bones.sum())


def test_columns_agree_with_rows():
    rng = np.random.default_rng(0)
    a, b = quat.normalized(rng.normal(size=(2, 9, 4)))
    np.testing.assert_allclose(columns.product(a.T, b.T).T, quat.multiply(a, b), atol=1e-15)
    np.testing.assert_allclose(columns.matrices(a.T), quat.to_matrices(a), atol=1e-15)
    np.testing.assert_array_equal(columns.cross(a.T[1:], b.T[1:]).T, np.cross(a[:, 1:], b[:, 1:]))


def test_bad_chains_are_named():
    with pytest.raises(ValueError, match=r'parents\[1\] is 1'):
        Chain([-1, 1], np.zeros((2, 3)))
    with pytest.raises(ValueError, match=r'parents\[0\] is -2'):
        Chain([-2], np.zeros((1, 3)))
    with pytest.raises(ValueError, match='offsets must be finite'):
        Chain([-1], [[0, 0, np.nan]])
