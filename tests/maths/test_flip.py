"""FLIP, against the package of its authors."""

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

from pvibr.maths.flip import Flip, flip


def authors(image, reference):
    evaluator = pytest.importorskip('flip_evaluator')
    pair = [np.ascontiguousarray(a, np.float32) for a in (reference, image)]
    error, _, _ = evaluator.evaluate(*pair, 'LDR', applyMagma=False, computeMeanError=False)
    return np.asarray(error).reshape(image.shape[:2])


@pytest.mark.parametrize('shape', [(2, 40, 57), (3, 9, 9), (1, 90, 31)])
def test_maps_are_those_of_the_authors(shape):
    rng = np.random.default_rng(3)
    truth = np.clip((gaussian_filter(rng.random((*shape, 3)), (0, 2, 2, 0)) - 0.5) * 4 + 0.5, 0, 1)
    images = np.clip(truth + rng.normal(0, 0.2, truth.shape), 0, 1)
    expected = np.stack([authors(*pair) for pair in zip(images, truth, strict=True)])
    np.testing.assert_allclose(Flip(truth).maps(images), expected, atol=5e-5)


def test_extremes():
    black, white = np.zeros((24, 24, 3)), np.ones((24, 24, 3))
    assert flip(black, black).max() == 0
    np.testing.assert_allclose(flip(white, black), authors(white, black), atol=5e-5)


def test_same_small_and_worst():
    image = np.random.default_rng(0).random((16, 24, 3))
    same = flip(image, image)
    assert same.shape == (16, 24)
    assert same.max() == 0
    worst = flip(np.zeros((16, 24, 3)), np.ones((16, 24, 3))).mean()
    small = flip(image, np.clip(image + 0.02, 0, 1)).mean()
    assert 0 < small < 0.15 < 0.5 < worst <= 1


def test_it_shows_where():
    reference = np.full((32, 32, 3), 0.5)
    image = reference.copy()
    image[20:24, 4:8] = [1, 0, 0]
    error = flip(image, reference)
    assert np.unravel_index(error.argmax(), error.shape)[0] in range(19, 25)
    assert error[2, 28] == 0
