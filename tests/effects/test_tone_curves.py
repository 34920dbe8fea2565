"""Curves against what their authors say of them."""

import numpy as np
import pytest

from pvibr.maths.tones import CURVES, to_display, to_light
from tests.effects.tone_curves import tone_map

GREYS = np.repeat(np.linspace(0, 60, 4001)[:, None], 3, axis=1)


def test_light_and_display_undo_each_other():
    values = np.linspace(0, 8, 1001)
    np.testing.assert_allclose(to_display(to_light(values)), values, atol=1e-6)


@pytest.mark.parametrize('curve', CURVES)
def test_greys_stay_grey_grow_and_fit(curve):
    shown = tone_map(GREYS, curve)
    assert shown.min() >= 0
    assert shown.max() <= 1 + 1e-12
    # The matrices of AgX and ACES are rounded: white is so to a few thousandths.
    assert np.ptp(shown, axis=1).max() < 6e-3
    assert (np.diff(shown[:, 1]) >= -1e-12).all()


def test_faithful_leaves_what_a_display_shows_and_keeps_hues():
    colors = np.random.default_rng(0).random((500, 3))
    np.testing.assert_array_equal(tone_map(colors), colors)
    bright = tone_map(3 * colors)
    order = np.argsort(colors, axis=1)
    assert (np.diff(np.take_along_axis(bright, order, 1), axis=1) >= 0).all()


def test_stops_double_light():
    assert tone_map([[to_display(0.2)] * 3], stops=1.0)[0, 0] == pytest.approx(to_display(0.4))


def test_reinhard_white_is_white():
    assert tone_map([to_display([4.0] * 3)], 'reinhard', white=4.0)[0] == pytest.approx([1, 1, 1])


def test_neutral_is_one_to_one_below_its_knee():
    """Published: base colours are kept, less the 4 % that a surface mirrors."""
    light = np.array([0.5, 0.3, 0.1])
    found = to_light(tone_map(to_display(light), 'neutral'))
    np.testing.assert_allclose(found, light - 0.04, atol=1e-12)
    assert to_light(tone_map(to_display([0.04] * 3), 'neutral')[0]) == pytest.approx(0.01)


def test_agx_middle_grey():
    """AgX brings 0.18 to a half: the pivot of its sigmoid."""
    assert tone_map(to_display([0.18] * 3), 'agx')[0] == pytest.approx(0.5, abs=0.005)


def test_aces_passes_published_points():
    assert tone_map(np.zeros(3), 'aces') == pytest.approx(0, abs=1e-9)
    light = to_light(tone_map(to_display([1.0] * 3), 'aces')[0])
    assert light == pytest.approx((1.0245786 - 9.0537e-5) / (1.41668 + 0.238081), abs=2e-4)
