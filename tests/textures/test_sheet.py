"""Images in one texture: nothing overlaps, nothing bleeds, cut-outs keep what they cover."""

from __future__ import annotations

import warnings

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.ndimage import map_coordinates

from pvibr.gl.hidden_window import hidden_window
from pvibr.maths.filled_texels import premultiplied
from pvibr.textures.sheet import Sheet, as_images, shelves
from tests.pictures import damaged_jpeg


@given(st.lists(st.tuples(st.integers(1, 40), st.integers(1, 40)), min_size=1, max_size=12))
def test_boxes_do_not_overlap(sizes):
    sizes = np.array(sizes)
    corners, (width, height) = shelves(sizes, 4096)
    taken = np.zeros((height, width), int)
    for (x, y), (w, h) in zip(corners, sizes, strict=True):
        taken[y : y + h, x : x + w] += 1
    assert taken.max() == 1
    assert taken.sum() == sizes.prod(1).sum()


def plain(color, size=(8, 8)):
    return np.full((*size, 4), color, np.uint8)


def test_no_level_mixes_two_images():
    red, blue = plain((255, 0, 0, 255), (16, 16)), plain((0, 0, 255, 255), (11, 23))
    sheet = Sheet([red, blue])
    assert len(sheet.levels) > 3
    for k, level in enumerate(sheet.levels):
        for rect, color in zip(sheet.rects.astype(int), [red[0, 0], blue[0, 0]], strict=True):
            left, bottom, right, top = rect
            part = level[bottom >> k : -(-top >> k), left >> k : -(-right >> k)]
            assert (part == color).all()


def leaves(seed=0, side=128, count=60):
    """Return an image of small discs, each about 4 texels wide, with soft edges."""
    rng = np.random.default_rng(seed)
    y, x = np.mgrid[:side, :side]
    alpha = np.zeros((side, side))
    for cx, cy in rng.uniform(0, side, (count, 2)):
        alpha = np.maximum(alpha, np.clip(3.0 - np.hypot(x - cx, y - cy), 0, 1))
    image = np.zeros((side, side, 4), np.uint8)
    image[..., 1], image[..., 3] = 200, np.rint(255 * alpha)
    return image


def test_smaller_levels_of_a_cut_out_cover_what_the_largest_does():
    image = leaves()
    kept, plainly = Sheet([image], cutout=0.5), Sheet([image])
    share = (image[..., 3] >= 128).mean()
    for k in range(1, 4):
        # As a filter reads it, anywhere between the texels.
        alpha = kept.levels[k][..., 3].astype(float)
        places = np.random.default_rng(k).uniform(0, len(alpha) - 1, (2, 20_000))
        covered = (map_coordinates(alpha, places, order=1, mode='nearest') >= 127.5).mean()
        assert abs(covered - share) < 0.15 * share
    assert (plainly.levels[3][..., 3] >= 128).mean() < 0.3 * share


def test_blended_levels_keep_the_mean():
    sheet = Sheet([leaves()])
    means = [premultiplied(level).mean((0, 1)) * 255 for level in sheet.levels]
    np.testing.assert_allclose(means, np.tile(means[0], (len(means), 1)), atol=1)


def test_colours_know_nothing_of_what_is_transparent():
    image = plain((255, 0, 0, 255))
    image[::2] = (0, 255, 0, 0)
    for level in Sheet([image]).levels:
        assert level[..., 1].max() == 0


def test_levels_arrive_on_the_gpu():
    sheet = Sheet([leaves()], cutout=0.5)
    with hidden_window() as (window, _):
        texture, skipped = sheet.upload(window)
        assert skipped == 0
        assert (texture.download() == sheet.levels[0]).all()
        texture.release()


@pytest.mark.parametrize(
    ('image', 'words'),
    [
        (np.zeros((0, 4)), 'shape'),
        (np.zeros((2, 2, 5)), 'shape'),
        (np.array([[0.0, np.nan]]), 'floats from 0 to 1'),
        ([], 'empty list'),
        ([np.zeros((2, 2)), np.zeros(3)], r'image\[1\]'),
    ],
)
def test_what_is_no_image_is_refused(image, words):
    with pytest.raises(ValueError, match=words):
        as_images(image)


def test_a_corrupt_file_is_refused(tmp_path):
    file = tmp_path / 'broken.png'
    file.write_bytes(b'\x89PNG\r\n\x1a\nnothing')
    with pytest.raises(ValueError, match=r'broken\.png'):
        as_images(file)
    with pytest.raises(FileNotFoundError):
        as_images(tmp_path / 'none.png')


@pytest.mark.parametrize('name', ['a.jpg', 'a.JPG', 'a.png', 'a'])
def test_of_a_picture_whose_description_is_damaged_nothing_is_said(tmp_path, name):
    file = tmp_path / name
    file.write_bytes(damaged_jpeg())
    with warnings.catch_warnings():
        warnings.simplefilter('error')
        assert (as_images(file)[0] == 255).all()


def test_images_of_any_kind_are_rgba():
    assert as_images(np.full((2, 2), 65535, np.uint16))[0].tolist() == [[[255] * 4] * 2] * 2
    assert as_images(np.full((2, 3, 3), 0.5))[0][0, 0].tolist() == [128, 128, 128, 255]


def test_frames_are_cut_by_rows_from_the_upper_left():
    sheet = np.arange(6, dtype=np.uint8).reshape(2, 3)
    assert [int(f[0, 0, 0]) for f in as_images(sheet, frames=(3, 2))] == [0, 1, 2, 3, 4, 5]
    for wrong in ((2, 2), (0, 1), 3, (1.5, 1)):
        with pytest.raises(ValueError, match='frames'):
            as_images(sheet, frames=wrong)


def test_too_many_texels_are_refused():
    with pytest.raises(ValueError, match='texels together'):
        shelves(np.full((9, 2), 100), 250)


@pytest.mark.parametrize('seed', [0, 1, 2])
def test_each_level_of_a_thin_image_is_its_own_mean(seed):
    rng = np.random.default_rng(seed)
    images = [
        rng.integers(0, 255, (h, w, 4), dtype=np.uint8)
        for w, h in ((90, 3), (3, 90), (90, 3), (5, 7), *rng.integers(1, 40, (4, 2)))
    ]
    sheet = Sheet(images)
    for image, (left, bottom, right, top) in zip(images, sheet.rects.astype(int), strict=True):
        whole = image[::-1].astype(float)
        whole[..., :3] *= whole[..., 3:] / 255
        for k, level in enumerate(sheet.levels):
            side = 1 << k
            for y in range(bottom >> k, -(-top >> k)):
                for x in range(left >> k, -(-right >> k)):
                    rows = slice(y * side - bottom, (y + 1) * side - bottom)
                    mean = whole[rows, x * side - left : (x + 1) * side - left].mean((0, 1))
                    mean[:3] *= 255 / max(mean[3], 1e-9)
                    kept = slice(None) if mean[3] else 3
                    assert np.abs(level[y, x] - mean)[kept].max() <= 0.51
