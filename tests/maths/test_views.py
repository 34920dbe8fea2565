"""Views: which pixels boxes cover."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from pvibr.maths.views import corners, covered, look_along, orthographic, perspective

SIZE = 120, 80
numbers = st.floats(-3, 3)


@given(st.lists(numbers, min_size=6, max_size=6), st.booleans())
def test_what_is_in_a_box_is_in_its_pixels(ends, parallel):
    low, high = np.minimum(ends[:3], ends[3:]), np.maximum(ends[:3], ends[3:])
    bounds = np.column_stack([low, high]).ravel()
    view = perspective([0, 0, 8], [0, 0, -1], 0.5, 1.0, 20.0)
    if parallel:
        view = orthographic(look_along([0, 0, 0], [0, 0.2, -1])[:3, :3], [-2, -2, -9], [2, 2, 9])
    left, bottom, right, top = covered(view, bounds, SIZE)
    assert 0 <= left <= right <= SIZE[0]
    assert 0 <= bottom <= top <= SIZE[1]
    shares = np.random.default_rng(0).uniform(size=(50, 3))
    points = np.vstack([low + shares * (high - low), corners(bounds)[0]])
    x, y, _, w = view.texture_from_world() @ np.column_stack([points, np.ones(len(points))]).T
    x, y = x / w * SIZE[0], y / w * SIZE[1]
    seen = (x >= 0) & (x <= SIZE[0]) & (y >= 0) & (y <= SIZE[1])
    margin = 1e-4
    assert ((x >= left - margin) & (x <= right + margin))[seen].all()
    assert ((y >= bottom - margin) & (y <= top + margin))[seen].all()


def test_boxes_beside_the_eye_may_cover_all():
    view = perspective([0, 0, 5], [0, 0, -1], 1.0, 1.0, 10.0)
    assert covered(view, [-1, 1, -1, 1, 0, 6], SIZE) == (0, 0, *SIZE)
