"""Tone mapping: the curves as numpy has them, an eye that adapts, and nothing else touched."""

import numpy as np
import pytest
import pyvista as pv

from pvibr import Bloom, ToneMapping
from pvibr.core.effect import Effect
from pvibr.gl import Quad
from pvibr.maths.tones import CURVES, to_display, to_light
from tests.effects.tone_curves import tone_map
from tests.pictures import shot

SIZE = (96, 64)


class Chart(Effect):
    """Colours up to 8 that are known everywhere, in place of the scene."""

    needs_hdr = True
    code = 'vec3(8.0 * uv.x * uv.x, 4.0 * uv.y * uv.y, 2.0 * uv.x * uv.y)'
    quad = None

    def render(self, frame, picture):
        if self.quad is None:
            text = f'void main() {{ gl_FragData[0] = vec4({self.code}, 1.0); }}'
            self.quad = Quad(frame.window, text)
        with picture.drawing():
            self.quad.draw()

    def release(self):
        if self.quad is not None:
            self.quad.release()
        self.quad = None


def charted(pl, code=None):
    chart = Chart()
    chart.code = code or chart.code
    return pl.ibr.add(chart)


def chart_colors():
    width, height = SIZE
    u, v = np.meshgrid((np.arange(width) + 0.5) / width, 1 - (np.arange(height) + 0.5) / height)
    return np.stack([8 * u**2, 4 * v**2, 2 * u * v], -1)


@pytest.fixture
def pl():
    pl = pv.Plotter(window_size=SIZE)
    pl.add_mesh(pv.Sphere(), color='tan')
    pl.show(auto_close=False)
    return pl


@pytest.mark.parametrize('stops', [0.0, -2.5, 1.0])
@pytest.mark.parametrize('curve', CURVES)
def test_curves_are_those_of_numpy(pl, curve, stops):
    charted(pl)
    pl.ibr.add(ToneMapping(curve=curve, exposure=stops))
    expected = 255 * tone_map(chart_colors(), curve, stops)
    assert np.abs(shot(pl) - expected).max() <= 1


def test_faithful_leaves_ordinary_scenes(pl):
    before = shot(pl)
    tone = pl.ibr.add(ToneMapping())
    np.testing.assert_array_equal(shot(pl), before)
    tone.curve = 'aces'
    assert np.abs(shot(pl).astype(int) - before).max() > 5
    tone.intensity = 0
    np.testing.assert_array_equal(shot(pl), before)
    assert pl.ibr.report().rows[0].why == 'intensity is 0'


def test_half_the_intensity_is_half_the_way(pl):
    before = shot(pl).astype(float)
    tone = pl.ibr.add(ToneMapping(curve='neutral', exposure=1))
    whole = shot(pl).astype(float)
    tone.intensity = 0.5
    assert np.abs(shot(pl) - (before + whole) / 2).max() <= 1


def test_auto_brings_the_picture_to_middle_grey(pl):
    charted(pl, 'vec3(uv.x < 2.0 ? 2.0 : 0.0)')
    tone = pl.ibr.add(ToneMapping(auto=True))
    seen = shot(pl)
    assert np.abs(seen - 255 * to_display(0.18)).max() <= 1
    tone.exposure = 1.0
    assert np.abs(shot(pl) - 255 * to_display(0.36)).max() <= 1
    tone.exposure, tone.min_exposure = 0.0, -1.0
    shot(pl)
    assert tone.stops == -1.0
    assert pl.ibr.report().rows[1].details['stops'] == -1.0


def test_auto_measures_the_mean_of_logarithms(pl):
    charted(pl, 'vec3(uv.x < 0.25 ? 2.0 : 0.5)')
    tone = pl.ibr.add(ToneMapping(auto=True))
    shot(pl)
    light = 0.25 * np.log2(((2 + 0.055) / 1.055) ** 2.4) + 0.75 * np.log2((0.555 / 1.055) ** 2.4)
    assert tone.stops == pytest.approx(np.log2(0.18) - light, abs=0.01)


def test_auto_adapts_by_the_clock_and_not_by_frames(pl):
    chart = charted(pl, 'vec3(uv.x < 2.0 ? 0.5 : 0.0)')
    tone = pl.ibr.add(ToneMapping(auto=True, adaptation=2.0))

    def stops_at(time):
        pl.ibr.time = time
        shot(pl)
        return tone.stops

    def light(code):
        chart.release()
        chart.code = code

    dark = stops_at(0.0)
    light('vec3(uv.x < 2.0 ? 1.0 : 0.0)')
    once = [stops_at(t) for t in (1.0, 1.0, 2.0)]
    bright = np.log2(0.18)
    for time, found in zip((1, 1, 2), once, strict=True):
        assert found == pytest.approx(bright + (dark - bright) * np.exp(-time / 2), abs=1e-4)
    assert stops_at(0.5) == pytest.approx(bright, abs=1e-4)  # time went back: at once
    light('vec3(uv.x < 2.0 ? 0.5 : 0.0)')
    tone.reset()
    assert stops_at(3.0) == pytest.approx(dark, abs=1e-4)


def test_pixels_that_are_no_numbers_do_not_spread(pl):
    charted(pl, 'uv.x < 0.5 && uv.y < 0.5 ? vec3(log(-uv.x)) : vec3(0.5)')
    tone = pl.ibr.add(ToneMapping(auto=True))
    seen = shot(pl)
    assert tone.stops == pytest.approx(np.log2(0.18 / (0.555 / 1.055) ** 2.4), abs=0.01)
    assert np.abs(seen[:30, 50:] - 255 * to_display(0.18)).max() <= 1


LAMP = 'vec3(distance(uv, vec2(0.5)) < 0.1 ? 0.6 : 0.2)'


@pytest.mark.parametrize('operator', ['subtract', 'keep', 'soft'])
@pytest.mark.parametrize(('stops', 'shines'), [(0.0, False), (1.5, True), (-2.0, False)])
def test_what_is_bright_when_exposed_shines(pl, operator, stops, shines):
    charted(pl, LAMP)
    tone = pl.ibr.add(ToneMapping(exposure=stops))
    bloom = pl.ibr.add(Bloom(operator=operator, threshold=0.8, intensity=0.5))
    shot(pl)
    assert ('skipped' not in bloom.report()) == shines
    tone.intensity = 0.0  # not exposed then
    shot(pl)
    assert 'skipped' in bloom.report()


def test_light_above_an_exposed_threshold_is_that_of_numpy(pl):
    """A plain picture, so that blurred light is light."""
    charted(pl, 'vec3(uv.x < 2.0 ? 0.6 : 0.0)')
    pl.ibr.add(ToneMapping(exposure=1.0))
    pl.ibr.add(Bloom(operator='subtract', threshold=0.7, intensity=0.25))
    threshold = to_display(to_light(0.7) / 2)
    light = 0.6 + 0.25 * (0.6 - threshold)
    assert np.abs(shot(pl) - 255 * tone_map([light] * 3, stops=1.0)).max() <= 1


def test_auto_exposure_and_bloom_are_the_same_every_time(pl):
    charted(pl, LAMP)
    tone = pl.ibr.add(ToneMapping(auto=True))
    bloom = pl.ibr.add(Bloom(threshold=0.8))
    first = shot(pl)
    assert tone.stops > 0
    assert 'skipped' not in bloom.report()
    np.testing.assert_array_equal(shot(pl), first)
