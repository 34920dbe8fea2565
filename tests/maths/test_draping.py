"""Draping: invariants of the blend, and gains against exposures that are known."""

import imageio.v3 as iio
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.ndimage import map_coordinates

from pvibr.maths.draping import blend, border, exposure_gains, sample, weights

VIEWS, POINTS = 3, 5
NOTHING = np.nan
table = VIEWS, POINTS
cosines = arrays(float, table, elements=st.one_of(st.just(NOTHING), st.floats(-1, 1)))
factors = arrays(float, table, elements=st.one_of(st.just(NOTHING), st.floats(0, 1)))
lengths = arrays(
    float, table, elements=st.one_of(st.sampled_from([NOTHING, np.inf]), st.floats(-1, 1e9))
)


def picture(height=7, width=9, channels=3):
    return np.random.default_rng(4).integers(0, 256, (height, width, channels), dtype=np.uint8)


@pytest.mark.parametrize('kind', ['linear', 'nearest'])
def test_pixel_centres_give_their_pixel(kind):
    image = picture()
    row, column = np.mgrid[:7, :9].reshape(2, -1)
    uv = np.column_stack([(column + 0.5) / 9, 1 - (row + 0.5) / 7])
    np.testing.assert_allclose(sample(image, uv, kind), image.reshape(-1, 3), atol=1e-10)


def test_linear_sampling_against_scipy():
    image = picture()
    uv = np.random.default_rng(5).uniform(0, 1, (200, 2))
    at = [(1 - uv[:, 1]) * 7 - 0.5, uv[:, 0] * 9 - 0.5]
    for c, values in enumerate(sample(image, uv).T):
        expected = map_coordinates(image[..., c].astype(float), at, order=1, mode='nearest')
        np.testing.assert_allclose(values, expected)


def test_outside_is_nothing():
    uv = [[-1e-9, 0.5], [0.5, 1 + 1e-9], [NOTHING, 0.5], [np.inf, 0.5], [0, 0], [1, 1]]
    for kind in 'linear', 'nearest':
        found = np.isnan(sample(picture(), uv, kind)).all(axis=1)
        assert found.tolist() == [True] * 4 + [False] * 2
    assert sample(picture()[..., 0], np.zeros((0, 2))).shape == (0, 1)


@given(arrays(float, (20, 2), elements=st.one_of(st.just(NOTHING), st.floats(-1, 2))))
def test_the_border_is_smooth_and_within_the_picture(uv):
    found = border(uv, 0.2)
    assert ((found >= 0) & (found <= 1)).all()
    inside = ((uv >= 0) & (uv <= 1)).all(axis=1)
    assert not found[~inside].any()
    assert (border(uv, 0) == inside).all()
    assert (found <= inside).all()


def test_the_border_rises_to_its_width():
    u = np.linspace(0, 0.5, 101)
    found = border(np.column_stack([u, u * 0 + 0.5]), 0.25)
    assert (np.diff(found) >= 0).all()
    assert found[0] == 0
    assert (found[u >= 0.25] == 1).all()
    assert np.abs(np.diff(found, 2)).max() < 0.004  # no kink at either end


@given(cosines, lengths, factors, factors, st.sampled_from(['feather', 'best']), st.floats(0, 8))
def test_weights_are_a_partition(cos, texels, borders, masks, method, power):
    found = weights(cos, texels, borders, masks, method, power)
    assert (found >= 0).all()
    total = found.sum(axis=0)
    assert np.isclose(total, np.where(total > 0, 1, 0)).all()
    hidden = ~(cos > 0) | ~((texels > 0) & (texels < np.inf)) | ~(borders > 0) | ~(masks > 0)
    assert not found[hidden].any()
    if method == 'best':
        assert np.isin(found, [0, 1]).all()


@given(cosines, st.sampled_from([1e-200, 1e-9, 1e9, 1e100]))
def test_weights_know_no_unit_of_length(cos, unit):
    texels = np.array([1.0, 2.0, 5.0])[:, None] * np.ones(POINTS)
    np.testing.assert_allclose(weights(cos, texels * unit), weights(cos, texels), rtol=1e-9)


def test_the_best_view_has_the_largest_weight():
    rng = np.random.default_rng(6)
    cos, texels = rng.uniform(-1, 1, (4, 50)), rng.uniform(0.1, 2, (4, 50))
    every, best = weights(cos, texels), weights(cos, texels, method='best')
    seen = every.any(axis=0)
    assert (best.argmax(axis=0) == every.argmax(axis=0))[seen].all()
    assert not best[:, ~seen].any()
    assert weights([[1.0], [1.0]], method='best').ravel().tolist() == [1.0, 0.0]


def test_no_views_and_no_points():
    assert weights(np.zeros((0, 4)), method='best').shape == (0, 4)
    assert weights(np.zeros((4, 0)), np.zeros((4, 0)), method='best').shape == (4, 0)
    assert np.isnan(blend(np.zeros((0, 4, 3)), np.zeros((0, 4)))).all()
    assert exposure_gains(np.zeros((2, 0, 3))).tolist() == [[1.0] * 3] * 2


@given(
    arrays(float, (*table, 2), elements=st.one_of(st.just(NOTHING), st.floats(0, 255))), factors
)
def test_blends_stay_between_what_is_shown(colors, given_weights):
    found = blend(colors, given_weights)
    used = np.isfinite(colors).all(axis=2) & (given_weights > 0)
    assert (np.isfinite(found).all(axis=1) == used.any(axis=0)).all()
    low = np.where(used[..., None], colors, np.inf).min(axis=0)
    high = np.where(used[..., None], colors, -np.inf).max(axis=0)
    shown = used.any(axis=0)
    assert (found[shown] >= low[shown] - 1e-9).all()
    assert (found[shown] <= high[shown] + 1e-9).all()


def exposed(true, seed=7, points=4000, noise=0.02):
    """Return what overlapping views with these gains to be found show of a scene."""
    rng = np.random.default_rng(seed)
    true = np.asarray(true)
    scene = rng.uniform(10, 120, (points, true.shape[1]))
    colors = scene / true[:, None, :] * np.exp(rng.normal(0, noise, (len(true), points, 1)))
    start = np.arange(len(true)) * 0.2
    place = rng.uniform(0, 1, points)
    seen = (place >= start[:, None]) & (place <= start[:, None] + 0.4)
    return np.where(seen[..., None], np.clip(colors, 0, 255).round(), np.nan)


def normalised(gains):
    return gains / np.exp(np.log(gains).mean(axis=0))


TRUE = np.array([[1.0, 1.1, 0.9], [1.6, 1.5, 1.7], [0.6, 0.7, 0.65], [1.2, 1.0, 1.1]])


def test_gains_are_recovered():
    found = exposure_gains(exposed(TRUE))
    np.testing.assert_allclose(found, normalised(TRUE), rtol=0.01)
    np.testing.assert_allclose(np.log(found).sum(axis=0), 0, atol=1e-9)


def test_gains_are_recovered_despite_clipping_and_outliers():
    colors = exposed(TRUE * 0.4)  # brighter: much is clipped at 255
    assert (colors == 255).mean() > 0.05
    rng = np.random.default_rng(8)
    wrong = rng.uniform(0, 1, colors.shape[:2]) < 0.08
    colors[wrong] = rng.uniform(0, 255, (wrong.sum(), 3))
    np.testing.assert_allclose(exposure_gains(colors), normalised(TRUE), rtol=0.03)


def test_one_gain_for_all_channels():
    true = TRUE[:, :1] * np.ones(3)
    found = exposure_gains(exposed(true), common=True)
    assert found.shape == (4,)
    np.testing.assert_allclose(found, normalised(true)[:, 0], rtol=0.01)


def test_floats_between_0_and_1():
    found = exposure_gains(exposed(TRUE) / 255, limits=(0.0, 1.0))
    np.testing.assert_allclose(found, normalised(TRUE), rtol=0.01)


def test_gains_make_views_alike():
    colors = exposed(TRUE)
    evened = colors * exposure_gains(colors)[:, None]
    spread = np.nanmedian(np.abs(np.log(evened[0] / evened[1])))
    assert spread < 0.03
    assert spread < 0.1 * np.nanmedian(np.abs(np.log(colors[0] / colors[1])))


def test_no_overlap_no_change():
    colors = np.full((3, 30, 2), np.nan)
    for view in range(3):
        colors[view, 10 * view : 10 * view + 10] = 40 * (view + 1)
    assert exposure_gains(colors).tolist() == [[1.0, 1.0]] * 3
    everywhere = np.broadcast_to([[[40.0]], [[80.0]]], (2, 30, 1))
    none = exposure_gains(everywhere, np.eye(2).repeat(15, axis=1))
    assert none.tolist() == [[1.0], [1.0]]
    assert exposure_gains(np.zeros((2, 30, 1))).tolist() == [[1.0], [1.0]]  # black says nothing


def test_each_group_of_views_has_its_own_mean():
    one, other = exposed(TRUE[:2], points=2000), exposed(TRUE[2:], seed=9, points=2000)
    nothing = np.full_like(one, np.nan)
    colors = np.concatenate([np.hstack([one, nothing]), np.hstack([nothing, other])])
    found = exposure_gains(colors)
    np.testing.assert_allclose(found[:2], normalised(TRUE[:2]), rtol=0.02)
    np.testing.assert_allclose(found[2:], normalised(TRUE[2:]), rtol=0.02)


def test_few_samples_are_hardly_believed():
    one = np.array([[[40.0]], [[160.0]]])
    few, many = (exposure_gains(one.repeat(n, axis=1))[0, 0] for n in (1, 1000))
    assert 1 < few < many
    assert many == pytest.approx(2, rel=1e-4)


def test_photographs_give_a_scene_its_published_colours(berlin):
    points, published, views = berlin
    shown = []
    for file, camera, pixels in views:
        colors = sample(iio.imread(file), camera.project(points)[0])
        shown.append(np.where(np.isfinite(pixels[:, :1]), colors, np.nan))
    # Each colour was taken from one of the photographs, at the pixel that was matched.
    least = np.nanmin(np.abs(shown - published).max(axis=2), axis=0)
    assert np.median(least) < 5
    gains = exposure_gains(shown)
    np.testing.assert_allclose(gains, 1, atol=0.05)
    before, after = (
        np.nanmedian(np.log(values[0] / values[1]), axis=0)
        for values in (np.array(shown), shown * gains[:, None])
    )
    assert (np.abs(after) < 0.2 * np.abs(before)).all()
