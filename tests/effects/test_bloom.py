"""Bloom: its own definition in float64, energy, roundness, and nothing where nothing is bright."""

from __future__ import annotations

import numpy as np
import pytest
import pyvista as pv

import pvibr
from pvibr.gl import Target, Texture
from pvibr.gl.blur import Blur, halving_taps
from pvibr.gl.offscreen import hidden_window, read_rgba

SIZE = (160, 96)


@pytest.fixture(scope='module')
def window():
    with hidden_window(16, 16) as (window, _):
        yield window


class FakePicture:
    """A picture of chosen colours, drawn into as floats."""

    def __init__(self, window, array):
        self.size = array.shape[1], array.shape[0]
        self.color = Texture(window).upload(array.astype(np.float32))
        self.target = Target(window, *self.size, ('rgba32f',))
        self.drawing = self.target.drawing
        self.window = window

    def release(self):
        self.color.release()
        self.target.release()


def bloomed(window, array, **settings):
    """Return what a bloom makes of a picture; None where it draws nothing."""
    bloom = pvibr.Bloom(**settings)
    picture = FakePicture(window, array)
    bloom.render(picture, picture)
    out = None if bloom.report().get('skipped') else picture.target.colors[0].download()
    bloom.release()
    picture.release()
    return out


# ------------------------------------------------ the same definition in float64


def reference(array, bloom):
    """Return the light that a bloom adds, before intensity: (height, width, 3)."""
    height, width = array.shape[:2]
    side = bloom.reduction // 2
    padded = np.pad(array, ((0, -height % side), (0, -width % side), (0, 0)), 'edge')
    light = means(above(means(padded, 2), bloom), side // 2)
    images = []
    for _ in range(bloom._levels((width, height))):
        light = halved(halved(light, 1, bloom.kernel), 0, bloom.kernel)
        images.append(light)
    for image in reversed(images[:-1]):
        light = (1 - bloom.spread) * image + bloom.spread * sampled(light, image.shape, 0.5)
    return sampled(light, array.shape, 1 / bloom.reduction)


def means(array, side):
    height, width = array.shape[0] // side, array.shape[1] // side
    return array.reshape(height, side, width, side, -1).mean(axis=(1, 3))


def above(c, bloom):
    c = c[..., :3] * (1.0 if bloom.background else c[..., 3:])
    s, t, k = c.max(axis=-1), bloom.threshold, bloom.knee
    step = np.clip((s - t + k) / (2 * k), 0, 1)
    kept = {
        'subtract': np.maximum(s - t, 0) / np.maximum(s, 1e-9),
        'keep': (s > t).astype(float),
        'soft': step * step * (3 - 2 * step),
    }[bloom.operator]
    color = s[..., None] + bloom.saturation * (c - s[..., None])
    return color * kept[..., None]


def halved(image, axis, kernel):
    """A Gaussian of 2 kernel texels around each pair of them; edges go on."""
    image = np.moveaxis(image, axis, 0)
    reach = np.arange(2 * kernel) - kernel + 0.5
    weights = np.exp(-0.5 * (3 * reach / kernel) ** 2)
    rows = np.arange(-(-len(image) // 2))
    total = sum(
        w * image[np.clip(2 * rows + int(r + 0.5), 0, len(image) - 1)]
        for r, w in zip(reach, weights / weights.sum(), strict=True)
    )
    return np.moveaxis(total, 0, axis)


def sampled(image, shape, scale):
    """Bilinear, places counted in texels from the corner."""
    for axis in (0, 1):
        place = (np.arange(shape[axis]) + 0.5) * scale - 0.5
        low, part = np.floor(place).astype(int), place - np.floor(place)
        last = image.shape[axis] - 1
        part = part.reshape((-1, 1, 1) if axis == 0 else (1, -1, 1))
        image = (1 - part) * np.take(image, np.clip(low, 0, last), axis) + part * np.take(
            image, np.clip(low + 1, 0, last), axis
        )
    return image


def noise(size=SIZE, seed=0):
    """Smooth bright spots on dark ground, opaque in part."""
    rng = np.random.default_rng(seed)
    small = rng.uniform(0, 1, (size[1] // 8 + 1, size[0] // 8 + 1, 4)) ** 3
    array = np.kron(small, np.ones((8, 8, 1)))[: size[1], : size[0]]
    return np.clip(array * 1.6, 0, 1)


@pytest.mark.parametrize('operator', ['subtract', 'keep', 'soft'])
@pytest.mark.parametrize(
    'settings',
    [{}, {'reduction': 4, 'kernel': 3}, {'reduction': 16, 'kernel': 9, 'levels': 1},
     {'levels': 4, 'spread': 0.9, 'saturation': 0.0, 'background': True}],
)  # fmt: skip
@pytest.mark.parametrize('size', [SIZE, (157, 91)])
def test_it_is_what_it_says(window, operator, settings, size):
    array = noise(size)
    bloom = pvibr.Bloom(operator=operator, threshold=0.6, **settings)
    light = reference(array, bloom)
    seen = bloomed(window, array, intensity=1.0, **bloom_settings(bloom))
    assert light.max() > 0.02
    assert np.abs(seen[..., :3] - array[..., :3] - light).max() < 2 / 255
    assert abs((seen[..., :3] - array[..., :3]).sum() / light.sum() - 1) < 0.01
    np.testing.assert_allclose(seen[..., 3], np.maximum(array[..., 3], light.max(axis=2)),
                               atol=2 / 255)  # fmt: skip


def bloom_settings(bloom):
    return {k: v for k, v in bloom.state().items() if k != 'intensity'}


# ------------------------------------------------ one hot pixel


def hot(x, y, value=500.0, size=(256, 256)):
    """A pixel of light at a place between pixels: four share it, as a filtered picture has it."""
    array = np.zeros((size[1], size[0], 4))
    array[..., 3] = 1
    i, j, u, v = int(x), int(y), x % 1, y % 1
    array[j : j + 2, i : i + 2, :3] = value * np.outer([1 - v, v], [1 - u, u])[..., None]
    return array


@pytest.mark.parametrize('operator', ['subtract', 'keep', 'soft'])
def test_a_moving_spot_stays_round_and_as_bright(window, operator):
    sums = []
    for x, y in [(120, 120), (120.25, 120.5), (121.5, 123.75), (122.5, 121), (125, 126.5)]:
        array = hot(x, y)
        light = bloomed(window, array, intensity=1.0, operator=operator)[..., 0] - array[..., 0]
        sums.append(light.sum())
        rows, columns = np.mgrid[:256, :256] + 0.5
        spread = [
            (light * (k - (light * k).sum() / light.sum()) ** 2).sum() / light.sum()
            for k in (columns, rows)
        ]
        assert max(spread) / min(spread) < 1.05**2
        # A contour: round along the diagonals too.
        level = light > 0.3 * light.max()
        axes = [np.ptp(k[level]) + 1 for k in (columns, rows)]
        diagonals = [(np.ptp(k[level]) + 1) / np.sqrt(2) for k in (columns + rows, columns - rows)]
        assert max(axes + diagonals) / min(axes + diagonals) < 1.15
    assert max(sums) / min(sums) < 1.02
    assert abs(np.mean(sums) / 500 - 1) < 0.02


@pytest.mark.parametrize('kernel', [1, 3, 5, 9, 31])
def test_halving_keeps_energy(kernel):
    places, weights = halving_taps(kernel)
    assert weights.sum() == pytest.approx(1)
    np.testing.assert_allclose(places, -places[::-1], atol=1e-12)


def test_blur_of_nothing_but_one_colour(window):
    image = Texture(window, filter='linear').upload(np.full((45, 77, 4), 0.5, np.float32))
    blur = Blur(window, (77, 45), 3, 5)
    out = blur.draw(image, 0.6).download()
    assert out.shape == (23, 39, 4)
    np.testing.assert_allclose(out, 0.5, atol=1e-3)
    for owner in (blur, image):
        owner.release()


# ------------------------------------------------ what it must not do


def test_nothing_bright_nothing_drawn(window):
    array = noise() * [0.5, 0.5, 0.5, 1]
    assert bloomed(window, array) is None
    assert bloomed(window, array, threshold=0.2) is not None


@pytest.mark.parametrize('value', [np.nan, np.inf])
def test_what_is_no_number_does_not_spread(window, value):
    array = noise()
    array[40, 60, :3] = value
    seen = bloomed(window, array)
    bad = ~np.isfinite(seen[..., :3]).all(axis=2)
    assert bad.sum() <= 1


def test_white_light_and_screen(window):
    array = hot(120, 120) * [0.002, 0.0002, 0.0, 1]
    white = bloomed(window, array, saturation=0.0, threshold=0.1) - array
    np.testing.assert_allclose(white[..., 0], white[..., 2], atol=1e-4)
    screen = bloomed(window, np.clip(noise(), 0, 1), blend='screen', intensity=3.0)
    assert np.isfinite(screen).all()
    added = bloomed(window, np.clip(noise(), 0, 1), intensity=3.0)
    assert (screen <= added + 1e-3).all()
    full = noise()[..., :3] == 1
    np.testing.assert_array_equal(screen[..., :3][full], 1.0)


# ------------------------------------------------ in a plotter


def grab(pl):
    """Return what a new frame holds, (height, width, 4) uint8, row 0 below."""
    pl.render_window.Render()
    return read_rgba(pl.render_window)


def bright(size=(320, 192), text=False):
    pl = pv.Plotter(window_size=size)
    pl.disable_anti_aliasing()
    pl.add_mesh(pv.Sphere(), color='tan', smooth_shading=True)
    if text:
        pl.add_text('text', font_size=12)
    pl.add_mesh(pv.Sphere(radius=0.1, center=(-0.7, 0.6, 0)), color='white', lighting=False)
    return pl


def test_zero_and_dark_are_the_identity():
    pl = bright(text=True)
    pl.show(auto_close=False)
    before = grab(pl)
    bloom = pl.ibr.add(pvibr.Bloom(intensity=0.0))
    np.testing.assert_array_equal(grab(pl), before)
    bloom.intensity, bloom.threshold = 0.5, 1.5
    np.testing.assert_array_equal(grab(pl), before)
    assert pl.ibr.report().rows[0].state == 'ran'
    bloom.threshold = 0.9
    after = grab(pl)
    lit = (after != before).any(axis=2)
    assert 0.01 < lit.mean() < 0.9
    assert (after[..., :3].astype(int) - before[..., :3]).min() >= 0
    pl.ibr.remove(bloom)
    np.testing.assert_array_equal(grab(pl), before)


def test_a_white_background_does_not_shine():
    pl = pv.Plotter(window_size=(160, 90))
    pl.set_background('white')
    pl.add_mesh(pv.Sphere(), color=(0.2, 0.3, 0.2))
    pl.show(auto_close=False)
    before = grab(pl)
    bloom = pl.ibr.add(pvibr.Bloom(threshold=0.7))
    np.testing.assert_allclose(grab(pl), before, atol=1)
    bloom.background = True
    assert (grab(pl) != before).any()


def test_text_and_other_subplots_stay():
    pl = pv.Plotter(shape=(1, 2), window_size=(320, 120), border=False)
    for i in range(2):
        pl.subplot(0, i)
        pl.add_mesh(pv.Sphere(), color='white', lighting=False)
        pl.set_background('black')
        pl.add_text('text', font_size=8, color='red')
    pl.show(auto_close=False)
    before = grab(pl)
    pl.ibr.add(pvibr.Bloom())
    after = grab(pl)
    np.testing.assert_array_equal(after[:, :160], before[:, :160])
    assert (after[:, 160:] != before[:, 160:]).any()
    pure = (before[..., :3] == [255, 0, 0]).all(axis=2)
    assert pure.any()
    np.testing.assert_array_equal(after[pure], before[pure])


@pytest.mark.parametrize('high', [False, True])
@pytest.mark.parametrize('size', [(1, 1), (200, 20), (33, 190)])
def test_any_window_and_again(size, high):
    pl = bright(size)
    bloom = pl.ibr.add(pvibr.Bloom(high_range=high, threshold=0.5))
    pl.show(auto_close=False)
    first = grab(pl)
    pl.window_size = (64, 64)
    grab(pl)
    pl.ibr.remove(bloom)
    pl.window_size = size
    pl.ibr.add(bloom)
    np.testing.assert_array_equal(grab(pl), first)
    assert bloom.enabled


def test_transparent_background_keeps_what_is_not_lit():
    pl = bright()
    pl.set_background('black')
    pl.show(auto_close=False)
    before = pl.screenshot(transparent_background=True)
    pl.ibr.add(pvibr.Bloom(threshold=0.9))
    grab(pl)
    after = pl.screenshot(transparent_background=True)
    more = after[..., 3].astype(int) - before[..., 3]
    assert more.min() == 0
    assert more.max() > 0
    same = (after[..., :3] == before[..., :3]).all(axis=2)
    assert (more[same] == 0).all()


@pytest.mark.parametrize('debug', ['bright', 'blur'])
def test_stages_can_be_seen(debug):
    pl = bright()
    bloom = pl.ibr.add(pvibr.Bloom(debug=debug, threshold=0.9))
    pl.show(auto_close=False)
    assert bloom.enabled
    assert 0 < grab(pl)[..., :3].mean() < 30
