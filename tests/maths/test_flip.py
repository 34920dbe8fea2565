"""FLIP of many small pictures, against the package of its authors."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

from pvibr.maths.flip import Flip
from pvibr.maths.image_error import flip


@pytest.mark.parametrize('shape', [(2, 40, 57), (3, 9, 9), (1, 90, 31)])
def test_maps_are_those_of_the_authors(shape):
    rng = np.random.default_rng(3)
    truth = np.clip((gaussian_filter(rng.random((*shape, 3)), (0, 2, 2, 0)) - 0.5) * 4 + 0.5, 0, 1)
    images = np.clip(truth + rng.normal(0, 0.2, truth.shape), 0, 1)
    expected = np.stack([flip(*pair) for pair in zip(images, truth, strict=True)])
    np.testing.assert_allclose(Flip(truth).maps(images), expected, atol=2e-3)


def test_extremes():
    black, white = np.zeros((1, 24, 24, 3)), np.ones((1, 24, 24, 3))
    assert Flip(black).maps(black).max() == 0
    np.testing.assert_allclose(Flip(black).maps(white), flip(white[0], black[0])[None], atol=2e-3)
