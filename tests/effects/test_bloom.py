"""Bloom: its own definition in float64, energy, roundness, and nothing where nothing is bright."""

from functools import partial

import imageio.v3 as iio
import numpy as np
import pytest
import pyvista as pv
from scipy.ndimage import gaussian_filter

import pvibr
from benchmarks.effects.bloom import natural as natural_spectrum
from pvibr.gl import Target, Texture
from pvibr.gl.fused import Fused
from pvibr.gl.hidden_window import read_pixels
from tests.effects.tone_curves import LUMINANCE

SIZE = (160, 96)


class FakePicture:
    """A picture of chosen colours, drawn into as floats."""

    def __init__(self, window, array):
        self.size = array.shape[1], array.shape[0]
        self.color = Texture(window).upload(array.astype(np.float32))
        self.target = Target(window, *self.size, ('rgba32f',))
        self.drawing = self.target.drawing
        self.window = window
        self.scale, self.whole, self.time = 1, self.size, 0.0
        self.tile = 0.0, 0.0, 1.0, 1.0
        self.view_from_world = self.clip_from_view = np.eye(4)

        self._fused = Fused(window)

    def apply(self, point):
        self._fused.draw(self, [point])

    def ground(self, blend):
        return None

    def release(self):
        self._fused.release()
        self.color.release()
        self.target.release()


def bloomed(window, array, **settings):
    """Return what a bloom makes of a picture; None where it draws nothing."""
    bloom = pvibr.Bloom(**{'threshold': 0.7} | settings)
    picture = FakePicture(window, array)
    bloom.render(picture, picture)
    out = None if bloom.report().get('skipped') else picture.target.colors[0].download()
    bloom.release()
    picture.release()
    return out


def reference(array, bloom):
    """Return the light that a bloom adds, before intensity: (height, width, 3)."""
    height, width = array.shape[:2]
    side, widen = fitted(height * bloom.downsample / 1440, (width, height), bloom)
    light = above(array, bloom)
    for axis in (0, 1):
        light = np.moveaxis(
            np.tensordot(shares(light.shape[axis], side), light, (1, axis)), 0, axis
        )
    halve, double = partial(halved_twice, widen=widen), sampled
    if bloom.chain == 'tent':
        halve, double = halved_13, doubled
    extent = np.array([height, width]) / side
    images = []
    for _ in range(bloom.level_count()):
        light = halve(light, bloom.kernel, extent)
        extent = extent / 2
        images.append(light)
    for image in reversed(images[:-1]):
        wide = double(light, image.shape, 0.5, extent)
        extent = extent * 2
        light = (1 - bloom.spread) * image + bloom.spread * wide
    return sampled(light, array.shape, 0.5 / side)


def fitted(side, size, bloom):
    """Return a whole number of pixels if they fill the picture, and how much wider kernels are."""
    for n in (np.floor(side), np.ceil(side)):
        if n and 0.79 < side / n < 1 / 0.79 and not any(np.mod(size, n)) and bloom.chain != 'tent':
            steps = 4.0 ** np.arange(bloom.level_count())
            reach = np.arange(bloom.kernel) + 0.5
            weights = np.exp(-0.5 * (3 * reach / bloom.kernel) ** 2)
            down = (weights * reach**2).sum() / weights.sum() * steps.sum()
            rest = 0.75 * steps[1:].sum() + 0.75  # of doubling, of texels and between them
            return n, np.sqrt(((down + rest) * (side / n) ** 2 - rest) / down)
    return side, 1.0


def shares(count, side):
    """Return how much of a texel of so many pixels each pixel is, along one axis."""
    pixel, texel = np.arange(count), side * np.arange(np.ceil(count / side - 1e-6))[:, None]
    overlap = np.minimum(pixel + 1, texel + side) - np.maximum(pixel, texel)
    overlap = np.clip(overlap, 0, None)
    return overlap / overlap.sum(axis=1, keepdims=True)


def above(c, bloom):
    c = c[..., :3] * (1.0 if bloom.background else c[..., 3:])
    s, t, k = c @ LUMINANCE, bloom.threshold, bloom.knee
    step = np.clip((s - t) / k, 0, 1)
    kept = {
        'subtract': np.maximum(s - t, 0) / np.maximum(s, 1e-9),
        'keep': (s > t).astype(float),
        'soft': step * step * (3 - 2 * step),
    }[bloom.operator]
    color = s[..., None] + bloom.saturation * (c - s[..., None])
    return color * kept[..., None]


def halved_twice(image, kernel, extent, widen):
    """A Gaussian of 2 kernel texels around each pair of them, along each axis."""
    reach = (np.arange(2 * kernel) - kernel + 0.5).reshape(-1, 2)
    weights = np.exp(-0.5 * (3 * reach / (kernel * widen)) ** 2)
    places = (reach * weights).sum(axis=1) / weights.sum(axis=1)
    weights = weights.sum(axis=1) / weights.sum()
    for axis in (1, 0):
        middle = 2 * np.arange(-(-image.shape[axis] // 2)) + 1
        image = sum(
            w * looked(image, axis, middle + p, extent[axis])
            for p, w in zip(places, weights, strict=True)
        )
    return image


def halved_13(image, _, extent):
    """Squares of 4 x 4 texels: the middle one counts as much as the four around it."""
    middle = square(image, (0, 0), extent)
    corners = [square(image, start, extent) for start in ((-1, -1), (-1, 1), (1, -1), (1, 1))]
    return 0.5 * middle + 0.5 * np.mean(corners, axis=0)


def square(image, middle, extent):
    for axis, start in enumerate(middle):
        at = 2 * np.arange(-(-image.shape[axis] // 2)) + 1 + start
        image = np.mean([looked(image, axis, at + d, extent[axis]) for d in (-1, 1)], axis=0)
    return image


def doubled(image, shape, scale, extent):
    """A tent over three texels along each axis, at twice the size."""
    for axis in (0, 1):
        at = (np.arange(shape[axis]) + 0.5) * scale
        image = sum(
            w * looked(image, axis, at + k, extent[axis])
            for k, w in ((-1, 0.25), (0, 0.5), (1, 0.25))
        )
    return image


def sampled(image, shape, scale, _=None):
    """Bilinear, places counted in texels from the corner."""
    for axis in (0, 1):
        image = looked(image, axis, (np.arange(shape[axis]) + 0.5) * scale)
    return image


def looked(image, axis, place, extent=np.inf):
    """Look at places in texels, between them linearly, beyond edges as in mirrors."""
    place = np.minimum(place, 2 * extent - place) - 0.5
    low, n = np.floor(place).astype(int), image.shape[axis]
    part = (place - low).reshape((-1, 1, 1) if axis == 0 else (1, -1, 1))
    near, far = (np.take(image, mirrored(low + k, n), axis) for k in (0, 1))
    return (1 - part) * near + part * far


def mirrored(index, n):
    index = index % (2 * n)
    return np.minimum(index, 2 * n - 1 - index)


def noise(size=SIZE, seed=0):
    """Smooth bright spots on dark ground, opaque in part."""
    rng = np.random.default_rng(seed)
    small = rng.uniform(0, 1, (size[1] // 8 + 1, size[0] // 8 + 1, 4)) ** 3
    array = np.kron(small, np.ones((8, 8, 1)))[: size[1], : size[0]]
    return np.clip(array * 1.6, 0, 1)


@pytest.mark.parametrize('operator', ['subtract', 'keep', 'soft'])
@pytest.mark.parametrize(
    'settings',
    [
        {},
        {'downsample': 4, 'kernel': 3},
        {'downsample': 16, 'kernel': 9, 'levels': 1},
        {'levels': 4, 'spread': 0.9, 'saturation': 0.0, 'background': True},
        {'chain': 'tent', 'levels': 3},
    ],
)
@pytest.mark.parametrize('size', [SIZE, (157, 91), (200, 160)])
def test_it_is_what_it_says(window, operator, settings, size):
    array = noise(size)
    bloom = pvibr.Bloom(operator=operator, threshold=0.6, **settings)
    light = reference(array, bloom)
    seen = bloomed(window, array, intensity=1.0, **bloom_settings(bloom))
    assert light.max() > 0.02
    assert np.abs(seen[..., :3] - array[..., :3] - light).max() < 2 / 255
    assert abs((seen[..., :3] - array[..., :3]).sum() / light.sum() - 1) < 0.01
    left = (1 - array[..., 3]) * (1 - np.minimum(light.max(axis=2), 1))
    np.testing.assert_allclose(1 - seen[..., 3], left, atol=2 / 255)


def bloom_settings(bloom):
    return {k: v for k, v in bloom.state().items() if k != 'intensity'}


def hot(x, y, value=500.0, size=(256, 256)):
    """A pixel of light at a place between pixels: four share it, as a filtered picture has it."""
    array = np.zeros((size[1], size[0], 4))
    array[..., 3] = 1
    i, j, u, v = int(x), int(y), x % 1, y % 1
    array[j : j + 2, i : i + 2, :3] = value * np.outer([1 - v, v], [1 - u, u])[..., None]
    return array


@pytest.mark.parametrize('chain', ['gaussian', 'tent'])
@pytest.mark.parametrize('operator', ['subtract', 'keep', 'soft'])
def test_a_moving_spot_stays_round_and_as_bright(window, operator, chain):
    sums = []
    for x, y in [(120, 120), (120.25, 120.5), (121.5, 123.75), (122.5, 121), (125, 126.5)]:
        array = hot(x, y, size=(720, 720))  # as many pixels as `downsample` is about
        seen = bloomed(window, array, intensity=1.0, operator=operator, chain=chain)
        light = seen[..., 0] - array[..., 0]
        sums.append(light.sum())
        rows, columns = np.mgrid[:720, :720] + 0.5
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


def test_calm_dims_lone_pixels_and_little_else(window):
    """The mean of a square with one pixel of light v, weighted by 1 / (1 + v)."""
    array = hot(120, 120, size=(720, 720))
    light = [
        (bloomed(window, array, operator='keep', firefly_reduction=c) - array)[..., :3].sum()
        for c in (0, 1)
    ]
    assert light[1] / light[0] == pytest.approx(16 / 501 / (15 + 1 / 501), rel=0.02)
    plain = np.ones((64, 64, 4)) * [0.9, 0.9, 0.9, 1]
    found = [bloomed(window, plain, operator='keep', firefly_reduction=c) for c in (0, 1)]
    np.testing.assert_allclose(found[0], found[1], atol=1e-4)


chains = pytest.mark.parametrize(
    ('chain', 'kernel', 'downsample'),
    [('gaussian', 5, 8), ('gaussian', 9, 4), ('tent', 5, 4)],
)


@chains
def test_small_kernels_on_small_images_are_a_large_one(window, chain, kernel, downsample):
    natural = natural_spectrum((320, 176))[..., 0]  # of the spectrum of photographs
    assert_blurred(window, natural, chain, kernel, downsample)


@chains
@pytest.mark.parametrize('name', ['01.jpg', '02.jpg', '03.jpg'])
def test_photographs_are_blurred_likewise(window, data_dir, name, chain, kernel, downsample):
    photo = iio.imread(data_dir / 'projection/opensfm_berlin/images' / name)
    assert_blurred(window, 0.01 + 0.99 * photo[::4, ::4, 1] / 255, chain, kernel, downsample)


def assert_blurred(window, grey, chain, kernel, downsample):
    bloom = pvibr.Bloom(
        threshold=0.0,
        operator='keep',
        spread=1.0,
        debug='blur',
        chain=chain,
        kernel=kernel,
        downsample=downsample,
    )
    picture = FakePicture(window, np.dstack([grey] * 3 + [np.ones_like(grey)]))
    bloom.render(picture, picture)
    sigma = bloom.blur_sigma
    seen = picture.target.colors[0].download()[..., 0]
    bloom.release()
    picture.release()
    assert sigma > 7
    assert np.abs(seen - gaussian_filter(grey, sigma, mode='reflect')).mean() < 0.5 / 255


def test_nothing_bright_nothing_drawn(window):
    array = noise() * [0.5, 0.5, 0.5, 1]
    assert bloomed(window, array) is None
    assert bloomed(window, array, threshold=0.2) is not None


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


def grab(pl):
    """Return what a new frame holds, (height, width, 4) uint8, row 0 below."""
    pl.render_window.Render()
    return read_pixels(pl.render_window, alpha=True)


def bright(size=(320, 192), text=False):
    pl = pv.Plotter(window_size=size)
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


@pytest.mark.parametrize('threshold', [0.7, 50.0])  # of the second, nothing is above
def test_light_is_the_same_on_any_kind_of_driver(threshold, monkeypatch):
    """On a GPU nobody asks where the light is; half floats have 11 bits."""
    pictures = []
    for kind in ('software', 'hardware'):
        monkeypatch.setenv('PVIBR_DRIVER', kind)
        pl = bright()
        pl.ibr.add(pvibr.Bloom(threshold=threshold))
        pl.show(auto_close=False)
        pictures.append(grab(pl).astype(int))
    assert np.abs(pictures[1] - pictures[0]).max() <= 1


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


class Nothing(pvibr.Effect):
    """Comes after, so that a bloom does not blend with 8 bits."""

    before = 'Tap'

    def render(self, frame, picture):
        pass


@pytest.mark.parametrize('blend', ['add', 'screen'])
@pytest.mark.parametrize('high', [False, True])
def test_light_is_the_same_in_place_and_anew(blend, high):
    pl = bright()
    pl.set_background('black')
    pl.show(auto_close=False)
    pl.ibr.add(pvibr.Bloom(blend=blend, intensity=0.7, needs_hdr=high))
    found = [pl.screenshot(transparent_background=True).astype(int)]
    pl.ibr.add(Nothing())
    found.append(pl.screenshot(transparent_background=True).astype(int))
    assert np.abs(found[0] - found[1]).max() <= 1


@pytest.mark.parametrize('seed', [0, 5])
def test_light_is_the_same_in_a_window_of_any_size(seed):
    """Its sum, and where it is: shares of the height, of lamps in random places."""
    rng = np.random.default_rng(seed)
    found = []
    places = rng.uniform(-0.6, 0.6, (4, 3)) * [1, 0.7, 0.2]
    for size in ((240, 180), (400, 300), (640, 480), (800, 600)):
        pl = pv.Plotter(window_size=size, lighting='none', off_screen=True)
        pl.set_background('black')
        pl.add_light(pv.Light(light_type='headlight', intensity=3))
        for k, place in enumerate(places):
            disc = pv.Disc(center=place, inner=0, outer=0.08 + 0.03 * k, c_res=60)
            pl.add_mesh(disc, color=(1, 0.8, 0.6), diffuse=1, ambient=0)
        pl.camera_position = [(0, 0, 5), (0, 0, 0), (0, 1, 0)]
        pl.camera.parallel_projection, pl.camera.parallel_scale = True, 1.0
        pl.ibr.add(pvibr.Bloom(threshold=0.5, debug='blur'))
        tap = pl.ibr.add(Floats())
        pl.show(auto_close=False)
        side = size[1] // 60
        found.append(tap.found.reshape(60, side, 80, side, 3).mean(axis=(1, 3)))
        pl.close()
    gains = np.array([light.sum() for light in found]) / found[-1].sum()
    assert gains.max() / gains.min() < 1.03
    peaks = np.array([light.max() for light in found])
    assert peaks.max() / peaks.min() < 1.03
    assert all(np.abs(light - found[-1]).max() < 0.02 * found[-1].max() for light in found[1:])


class Floats(pvibr.Effect):
    """Reads the picture after a bloom."""

    before, needs_hdr = 'ToneMapping', True

    def render(self, frame, picture):
        """Keep the colours."""
        self.found = picture.color.download()[..., :3].astype(float)


@pytest.mark.parametrize('cmap', ['viridis', 'jet', 'gray', 'magma'])
def test_colours_of_data_stay_by_default(cmap):
    pl = pv.Plotter(window_size=(200, 150), off_screen=True)
    mesh = pv.Plane(i_resolution=60, j_resolution=20)
    pl.add_mesh(mesh, scalars=mesh.points[:, 0], cmap=cmap, lighting=False, show_scalar_bar=False)
    pl.add_mesh(pv.Sphere(radius=0.1, center=(0, 0, 0.2)), color='orange', lighting=False)
    pl.camera_position = 'xy'
    pl.show(auto_close=False)
    before = grab(pl)
    bloom = pl.ibr.add(pvibr.Bloom())
    np.testing.assert_array_equal(grab(pl), before)
    bloom.threshold = 0.5
    assert (grab(pl) != before).any()
