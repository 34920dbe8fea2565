"""Small formulas at values known in closed form."""

import numpy as np
import pytest

from pvibr.effects.reflections import through_rectangle
from pvibr.export.glb import bounds_of
from pvibr.instances.support import table_of
from pvibr.maths.blocks import ascending, members
from pvibr.maths.facing import turned_azimuths
from pvibr.maths.quaternions import unit_matrices
from pvibr.maths.transforms import inverses, signs_of
from pvibr.maths.vectors import as_units, products, unit_vectors
from pvibr.maths.views import box_distance, may_see, perspective
from pvibr.visibility.depth_test import seen, texel_size, uncertain

QUARTER_TURN = [[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]
VIEW = perspective([0, 0, 5], [0, 0, -1], 1.0, 1.0, 10.0)
UP = [[0, 0, 1.0]] * 2
WIRE = np.where(np.arange(64) == 40, 0.5, np.ones((64, 64)))


@pytest.mark.parametrize(
    ('result', 'expected'),
    [
        (bounds_of([[[0, 0, 0], [1, 2, 3]], [[5, 1, 1]]]), [[0, 0, 0], [5, 2, 3]]),
        (bounds_of([]), np.zeros((2, 3))),
        (members(np.array([0, 1]), 2, 3), [[0, 1], [2, 2]]),
        (ascending(np.array([3.0, 1.0, 2.0])), [1, 2, 0]),
        (texel_size(VIEW, 100), 0.02),
        (seen(VIEW, np.full((8, 8), 0.8), [[0, 0, 3], [0, 0, 0]], UP), [1, 0]),
        (uncertain(VIEW, np.ones((64, 64)), [[0, 0, 0], [1.3, 0, 0]], UP, WIRE), [False, True]),
        (turned_azimuths([0.0, 0.0, 1.0], QUARTER_TURN), np.pi / 2),
        (unit_matrices(np.array([0.0, 0.0, 0.0, 1.0])), np.diag([-1, -1, 1])),
        (table_of(np.array([[0.0, 0.0, 2.0]]), 5)[2], [0, 1, 2, 1, 0]),
        (inverses(np.diag([2.0, 4.0, 0.0, 1.0])), np.diag([0.5, 0.25, 0, 1])),
        (signs_of(np.diag([2.0, -3.0, 1.0, 1.0])), -1),
        (signs_of(np.array([np.eye(4), np.diag([1.0, 0, 1, 1])])), [1, 0]),
        (unit_vectors([[3.0, 4.0], [0.0, 0.0], [0.0, 1e-200]]), [[0.6, 0.8], [0, 0], [0, 1]]),
        (as_units('axis', [0, 0, 1e-200]), [0, 0, 1]),
        (products(np.array([[0.0, 2.0]]), np.array([[1.0, 3.0], [4.0, 5.0]])), [[6], [10]]),
        (box_distance([3, 0, 0], [[-1, 1, -1, 1, -1, 1]]), 2),
        (may_see(VIEW, [[-1, 1, -1, 1, -1, 1], [90, 91, 0, 1, 0, 1]]), [True, False]),
        (VIEW.texture_from_world() @ [0, 0, 0, 1] / 5, [0.5, 0.5, 8 / 9, 1]),
    ],
)
def test_formulas(result, expected):
    np.testing.assert_allclose(result, expected, atol=1e-12)


def test_a_mirror_shows_what_is_above_it_nearer_to_the_camera():
    floor = [0, 0, 0], [4, 0, 0], [0, 2, 0]
    view = through_rectangle(floor, [0, 1, -1], np.array([[0, 4, 0, 2, 0, 3.0]]))
    clip = view.clip_from_view @ view.view_from_world @ [2, 1, 1, 1]
    np.testing.assert_allclose(clip[:2], [0, -1], atol=1e-6)
