"""Poses: shapes and checks."""

import numpy as np
import pytest
import pyvista as pv
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from pvibr.meshes.poses import as_poses
from tests.refusals import refused

finite = st.floats(-1e12, 1e12)


@given(arrays(np.float64, st.tuples(st.integers(0, 20), st.just(3)), elements=finite))
def test_points_stay_points_and_are_not_copied(points):
    poses = as_poses(points)
    assert poses.shape == points.shape
    assert np.shares_memory(poses, points) or not points.size


@given(st.integers(-9, 9), st.booleans())
def test_scales_and_mirroring_pass(exponent, mirrored):
    matrix = np.diag([10.0**exponent] * 3 + [1.0])
    matrix[0] *= -1 if mirrored else 1
    assert as_poses(matrix).shape == (1, 4, 4)


def test_accepted_kinds():
    assert as_poses((1, 2, 3)).shape == (1, 3)
    assert as_poses([]).shape == (0, 3)
    assert as_poses(np.zeros((0, 4, 4))).shape == (0, 4, 4)
    assert as_poses(pv.Sphere()).shape == (842, 3)
    assert as_poses(pv.PointSet(np.ones((5, 3), np.float32))).dtype == np.float64


def test_huge_values_are_not_taken_for_infinite():
    assert len(as_poses(np.full((4, 3), 1e308))) == 4


def _broken(row, value):
    matrices = np.tile(np.eye(4), (3, 1, 1))
    matrices[2][row] = value
    return matrices


@pytest.mark.parametrize(
    ('poses', 'error', 'match'),
    [
        ([[0, 0, 0], [0, np.nan, 0]], ValueError, r'poses\[1\].*finite'),
        ([[0, 0, np.inf]], ValueError, r'poses\[0\].*finite'),
        (_broken(3, 0.5), ValueError, r'poses\[2\].*last row'),
        (_broken(1, [0, 0, 0, 5]), ValueError, r'poses\[2\].*inverse'),
        (_broken(1, [1, 0, 0, 5]), ValueError, r'poses\[2\].*inverse'),
        (np.zeros((4, 2)), ValueError, r'shape \(4, 2\)'),
        (np.zeros((4, 3, 3)), ValueError, r'\(n, 4, 4\)'),
        (5.0, ValueError, 'shape'),
        ('words', TypeError, 'numbers'),
        (None, ValueError, 'shape|finite'),
    ],
)
def test_bad_poses_are_named(poses, error, match):
    refused(match, as_poses, poses, kind=error)
