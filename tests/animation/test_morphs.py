"""Morph targets, dense and sparse."""

import numpy as np
import pytest
import pyvista as pv
from hypothesis import given
from hypothesis import strategies as st

from pvibr import Figure
from pvibr.animation import FigureMesh, Morphs
from tests.animation.conftest import refused


@given(st.integers(0, 2**32 - 1))
def test_sparse_targets_are_dense_ones_with_zeros(seed):
    rng = np.random.default_rng(seed)
    dense = rng.normal(size=(4, 20, 3)) * (rng.random((4, 20, 1)) < 0.3)
    sparse = [(np.flatnonzero(d.any(1)), d[d.any(1)]) for d in dense]
    weights = rng.normal(size=4) * 3  # below 0 and above 1
    expected = np.tensordot(weights, dense, 1)
    assert np.allclose(Morphs(dense).total('positions', weights, 20), expected)
    assert np.allclose(Morphs(sparse).total('positions', weights, 20), expected)


def test_an_index_twice_adds_twice():
    morphs = Morphs([([1, 1], [[1.0, 0, 0], [1.0, 0, 0]])])
    assert morphs.total('positions', [1.0], 2)[1, 0] == 2


def test_a_target_may_leave_something_alone():
    morphs = Morphs(np.zeros((2, 3, 3)), normals=[None, np.ones((3, 3))])
    assert morphs.has('normals')
    assert not morphs.has('colors')
    assert morphs.target('normals', 0) is None
    assert morphs.target('colors', 0) is None
    assert morphs.total('normals', [1.0, 0.5], 3).tolist() == [[0.5] * 3] * 3
    assert Morphs(np.zeros((1, 3, 3)), colors=np.zeros((1, 3, 4))).width('colors') == 4


def test_float32_stays_so():
    assert Morphs(np.zeros((1, 3, 3), np.float32)).target('positions', 0)[1].dtype == np.float32


@pytest.mark.parametrize(
    ('arguments', 'words'),
    [
        (([[[0, 0, 1]]], [[[0, 0, 1]]] * 2), 'normals must have 1 targets, got 2'),
        (([[[0, 0]]],), r'positions\[0\] must be \(v, 3\), got \(1, 2\)'),
        (([[[0, np.nan, 0]]],), r'positions\[0\]\[0, 1\].* finite'),
        (([([0, 1], [[0, 0, 1.0]])],), r'indices of positions\[0\] must be 1 whole numbers'),
        (([([-1], [[0, 0, 1.0]])],), r'indices of positions\[0\]'),
    ],
)
def test_unusable_targets_are_named(arguments, words):
    refused(words, Morphs, *arguments)


def test_numbers_of_names_and_weights_must_fit():
    refused('names must have', Morphs, [[[0, 0, 1]]], names=['a', 'b'])
    refused('weights must have', Morphs, [[[0, 0, 1]]], weights=[1, 2])
    refused('must be finite', Morphs, [[[0, 0, 1]]], weights=[np.inf])
    with pytest.raises(ValueError, match=r'indices of positions\[0\] must be from 0 to 2, got 7'):
        Morphs([([7], [[0, 0, 1.0]])]).check(3)


def test_normals_follow_the_shape():
    ball = pv.Sphere(theta_resolution=40, phi_resolution=40)
    ball.clear_data()
    stretch = ball.points * [0.0, 0.0, 1.0]
    sparse = ([0], stretch[:1])
    morphs = Morphs([stretch, sparse], names=['long', 'peak'], weights=[1, 0]).with_normals(ball)
    figure = Figure([FigureMesh(ball, morphs=morphs)])
    other = ball.copy()
    other.points = ball.points + stretch
    expected = other.compute_normals(cell_normals=False, split_vertices=False).active_normals
    assert np.allclose(figure.mesh().active_normals, expected, atol=1e-5)
    assert np.array_equal(ball.points, pv.Sphere(theta_resolution=40, phi_resolution=40).points)
    assert morphs.names == ('long', 'peak')
    assert len(morphs.target('normals', 1)[0]) < 50
