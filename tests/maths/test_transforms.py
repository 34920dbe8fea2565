"""Matrices: closed forms and invariants."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from pvibr.maths.transforms import transform_normals, transform_points, trs

quaternions = arrays(np.float64, (5, 4), elements=st.floats(-1, 1)).filter(
    lambda q: (np.abs(q).max(axis=1) > 1e-3).all()
)


@given(quaternions, arrays(np.float64, (5, 3), elements=st.floats(0.1, 10)))
def test_normals_stay_perpendicular(q, scales):
    for matrix in trs(np.ones((5, 3)), q, scales * [1, 1, -1]):
        edges = matrix[:3, :3] @ [[1.0, 0.3], [0.0, 1.0], [0.0, 0.0]]
        normal = transform_normals(matrix, [[0.0, 0.0, 1.0]])[0]
        np.testing.assert_allclose(normal @ edges / np.abs(edges).max(), 0, atol=1e-9)
        assert np.isclose(np.linalg.norm(normal), 1)
        up = transform_points(matrix, [[0, 0, 1.0]]) - matrix[:3, 3]
        assert (up @ normal).item() > 0


def test_zero_normals_stay_zero():
    assert not transform_normals(np.eye(4), [[0.0, 0.0, 0.0]]).any()


def test_no_rows():
    assert trs(np.zeros((0, 3)), np.zeros((0, 4)), np.zeros(0)).shape == (0, 4, 4)
