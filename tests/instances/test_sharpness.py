"""Sharpness, against closed forms."""

from __future__ import annotations

import numpy as np
import pytest

from pvibr.instances.sharpness import FLAT_SHARE, sharpness

X, Y = np.meshgrid(np.arange(160.0), np.arange(120.0))


def grey(luminance):
    return np.repeat(np.asarray(luminance)[..., None], 3, axis=-1)


def waves(period, contrast=0.4):
    return grey(0.5 + contrast * np.sin(2 * np.pi * X / period) * np.cos(2 * np.pi * Y / period))


def test_a_picture_is_as_sharp_as_itself():
    picture = np.random.default_rng(1).random((60, 80, 3))
    assert sharpness(picture, picture) == 1


@pytest.mark.parametrize('contrast', [0.1, 0.2, 0.4])
def test_contrast_left_is_sharpness(contrast):
    assert sharpness(waves(8, contrast), waves(8)) == pytest.approx(contrast / 0.4, rel=1e-9)


@pytest.mark.parametrize('period', [6.0, 10.0, 16.0])
def test_a_blur_leaves_what_its_transfer_function_does(period):
    truth = 0.5 + 0.4 * np.sin(2 * np.pi * X / period)
    blurred = 0.5 + (truth - 0.5) * (1 + 2 * np.cos(2 * np.pi / period)) / 3  # a box of 3 px
    mean_of_three = (np.roll(truth, 1, 1) + truth + np.roll(truth, -1, 1)) / 3
    assert np.allclose(blurred[:, 1:-1], mean_of_three[:, 1:-1])
    expected = (1 + 2 * np.cos(2 * np.pi / period)) / 3
    assert sharpness(grey(blurred), grey(truth)) == pytest.approx(expected, rel=1e-9)


def test_hues_of_one_luminance_have_no_gradient():
    red, green = (0.114 + 0.587, 0.0, 0.0), (0.0, 0.299 * (0.114 + 0.587) / 0.587, 0.0)
    picture = np.where((X // 4 % 2 == 0)[..., None], red, green)
    assert sharpness(picture, waves(8)) < 1e-9


@pytest.mark.parametrize(('share', 'blurred'), [(0.02, False), (0.2, True)])
def test_a_part_counts_from_a_twentieth_on(share, blurred):
    truth = waves(8)
    picture = truth.copy()
    edge = int(share * picture.shape[1])
    picture[:, :edge] = 0.5
    assert (sharpness(picture, truth) < 0.5) is blurred


def test_what_is_flat_in_the_truth_has_no_say():
    truth = waves(8)
    flat = int((FLAT_SHARE - 0.05) * truth.shape[1])
    truth[:, :flat] = 0.5 + (truth[:, :flat] - 0.5) * 0.01
    picture = truth.copy()
    picture[:, : flat - 25] = 0.5
    assert sharpness(picture, truth) == pytest.approx(1, abs=1e-6)


def test_a_background_has_no_say_however_large():
    truth = np.ones((200, 300, 3))
    truth[80:120, 100:160] = np.random.default_rng(1).random((40, 60, 3))
    picture = 0.5 + (truth - 0.5) / 2
    assert sharpness(picture, truth) == pytest.approx(0.5, rel=1e-6)
