"""Errors name the argument, what is allowed and what it was."""

import numpy as np
import pytest
import pyvista as pv

from pvibr.animation.keyframes import frame_weights
from pvibr.animation.skinning import dual_blend, normalized_weights
from pvibr.instances.sharpness import sharpness
from pvibr.maths import quaternions as quat
from pvibr.maths.draping import blend, border, exposure_gains, sample, weights
from pvibr.maths.facing import cards, eye_of
from pvibr.maths.kernels import vogel_disk
from pvibr.maths.silhouettes import LitMesh, edge_table
from pvibr.maths.transforms import trs
from pvibr.substitutes.cloud_maths import greedy_planes, kmeans_planes
from pvibr.substitutes.cloud_texture import largest_scale
from pvibr.substitutes.impostor_maths import dop_corners
from tests.refusals import refused

UV = [[0.5, 0.5]]
ORIGIN = [[0, 0, 0]]
CUBE = pv.Cube().triangulate()
BOX = np.asarray(CUBE.points, float), CUBE.regular_faces
SQUARE = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], float), [[0, 1, 2], [0, 2, 3]]
JOINTS = np.tile(np.eye(4), (2, 1, 1)), [[0, 1]], [[0.5, 0.5]]
ROTATIONS = np.ones((2, 3, 4))


def changed(array, index, value):
    array = np.array(array, float)
    array[index] = value
    return array


def bad_vectors(value):
    """Calls with a vector that has no direction."""
    vector = [value, 0, 0]
    return [
        (
            lambda: quat.normalized(changed(ROTATIONS, (1, 2), [*vector, 0])),
            r'^quaternions\[1, 2\] must be finite and not zero, got \[',
        ),
        (lambda: quat.to_matrices([*vector, 0]), r'^quaternions must .* got \['),
        (lambda: quat.from_axis_angle([[1, 0, 0], vector], 1.0), r'axes\[1\] must be'),
        (lambda: quat.between([1, 0, 0], vector), r'^v must be '),
        (lambda: trs(np.zeros((2, 3)), [[1, 0, 0, 0], [*vector, 0]]), r'quaternions\[1\] must be'),
        (lambda: cards(ORIGIN, np.eye(4), 'cylindrical', axis=vector), r'^axis must be'),
    ]


def bad_weights(row):
    return lambda: normalized_weights([[1, 0], [0, 2], row])


CASES = [
    (lambda: sample(np.zeros(3), UV), 'image must have shape'),
    (lambda: sample(np.zeros((0, 3)), UV), 'image must have shape'),
    (lambda: sample(np.zeros((2, 2)), UV, 'cubic'), 'filter must be'),
    (lambda: border(UV, 0.6), 'width must be'),
    (lambda: weights([1.0]), 'cosines must have shape'),
    (lambda: weights([[1.0]], method='all'), 'method must be'),
    (lambda: weights([[1.0]], power=-1), 'power must be'),
    (lambda: weights([[1.0]], masks=[[1.0, 1.0]]), 'masks must have shape'),
    (lambda: blend([[1.0]], [[1.0]]), 'colors must have shape'),
    (lambda: blend([[[1.0]]], [[1.0, 1.0]]), 'weights must have shape'),
    (lambda: blend([[[1.0]]], [[-1.0]]), 'weights must not be negative'),
    (lambda: exposure_gains([[[1.0]]], limits=(1.0, 0.0)), 'limits must increase'),
    (lambda: frame_weights([0, 1, 1], 0), r'keys must increase, got 1.0 after 1.0 at keys\[2\]'),
    (lambda: frame_weights([0, np.nan], 0), r'keys\[1\] must be finite, got nan'),
    (lambda: frame_weights([], 0), 'at least one time'),
    (lambda: frame_weights([0, 1], 0, 'cosine'), "one of 'step', 'linear'"),
    (lambda: frame_weights([0, 1], 0, period=0.5), r'period must be .* 1.0.*got 0.5'),
    (lambda: frame_weights([0], 0, period=0.0), r'period must .* got 0\.0'),
    (lambda: frame_weights([0, 1], [0, np.inf]), r'times\[1\] must be finite, got inf'),
    *(case for value in (0.0, np.nan, np.inf) for case in bad_vectors(value)),
    (lambda: quat.normalized(np.ones((4, 3))), r'shape \(\.\.\., 4\)'),
    (lambda: quat.from_matrices(np.eye(4)), r'shape \(\.\.\., 3, 3\)'),
    (lambda: eye_of(np.diag([2.0, 2, 2, 1])), 'rotation'),
    (lambda: eye_of(np.diag([-1.0, 1, 1, 1])), 'rotation'),
    (lambda: eye_of(np.full((4, 4), np.nan)), 'rotation'),
    (lambda: cards(ORIGIN, np.eye(4), 'around'), 'facing must be'),
    (lambda: cards(ORIGIN, np.eye(4), towards='line'), 'towards must be'),
    (bad_weights([1, -0.5]), r'weights must be 0 or more, got \[1.0, -0.5\] in row 2$'),
    (bad_weights([0, 0]), r'weights must be above 0 .* in row 2$'),
    (bad_weights([np.nan, 1]), r'weights must be finite, .* row 2$'),
    (bad_weights([np.inf, 1]), r'weights must be finite, .* row 2$'),
    (
        lambda: normalized_weights(np.zeros((9, 4))),
        r'weights must be above 0 .* row 0 and 8 more$',
    ),
    (lambda: normalized_weights(np.ones((3, 9))), '1 to 8'),
    (lambda: dual_blend(*JOINTS, bulge=2.0), r'bulge must be .* got 2'),
    (lambda: edge_table(SQUARE[0][:, :2], SQUARE[1]), r'points must have shape .* got \(4, 2\)'),
    (lambda: edge_table(SQUARE[0], np.zeros((2, 4), int)), r'triangles must .* got \(2, 4\)'),
    (lambda: edge_table(SQUARE[0], [[0, 1, -1]]), 'from 0 to 3'),
    (lambda: edge_table(SQUARE[0], [[0, 1, 4]]), 'from 0 to 3'),
    (lambda: edge_table(changed(SQUARE[0], (2, 1), np.nan), SQUARE[1]), r'points\[2\] must be'),
    (lambda: LitMesh(edge_table(*SQUARE), (0, 0, 0, 0)), 'light must be'),
    (lambda: LitMesh(edge_table(*SQUARE), (0, 0, 1)), 'light must be'),
    (lambda: LitMesh(edge_table(*SQUARE), (0, 0, np.nan, 1)), 'light must be'),
    (lambda: LitMesh(edge_table(*SQUARE), (0, 0, 1, -1)), 'light must be'),
    (lambda: LitMesh(edge_table(*SQUARE), (0, np.inf, 0, 0)), 'light must be'),
    (lambda: greedy_planes(*BOX, 0), 'epsilon must be'),
    (lambda: greedy_planes(*BOX, -1), 'epsilon must be'),
    (lambda: greedy_planes(*BOX, np.nan), 'epsilon must be'),
    (lambda: greedy_planes(*BOX, np.inf), 'epsilon must be'),
    (lambda: greedy_planes(*BOX, 1e-6), r'epsilon must be .* got 1e-06'),
    (lambda: kmeans_planes(*BOX, 0), 'planes must be'),
    (lambda: kmeans_planes(BOX[0], BOX[1][:0], 3), 'must have triangles'),
    (lambda: largest_scale(np.ones((30, 2)), 16, 2), 'side must be larger for 30 rectangles'),
    (lambda: dop_corners(np.zeros((0, 3))), 'points must have one or more rows'),
    (lambda: vogel_disk(0), 'n must be at least 1, got 0'),
    (
        lambda: sharpness(np.eye(9)[..., None] * [1, 1, 1], np.ones((9, 9, 3))),
        'reference must have',
    ),
]


@pytest.mark.parametrize(('call', 'message'), CASES)
def test_bad_input_is_named(call, message):
    refused(message, call)
