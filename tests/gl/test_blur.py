"""Blurs: what they keep, where their light ends, and drawing on what is there."""

import numpy as np
import pytest

from pvibr.gl import Quad, Target, Texture, release
from pvibr.gl.blur import CHAINS, Blur, halving_taps

SPOT = """void main()
{{
  vec2 away = abs(gl_FragCoord.xy - vec2({0}, {1})) + min(uv.x, 0.0);
  gl_FragData[0] = gl_FragData[1] = vec4(max(away.x, away.y) < 1.0 ? 1.0 : 0.0);
}}
"""


@pytest.mark.parametrize('kernel', [1, 3, 5, 9, 31])
def test_halving_keeps_energy(kernel):
    places, weights = halving_taps(kernel)
    assert weights.sum() == pytest.approx(1)
    np.testing.assert_allclose(places, -places[::-1], atol=1e-12)


@pytest.mark.parametrize('chain', CHAINS)
@pytest.mark.parametrize('extent', [(77, 45), (76.25, 44.5)])
def test_blur_of_nothing_but_one_colour(window, chain, extent):
    image = Texture(window, filter='linear').upload(np.full((45, 77, 4), 0.5, np.float32))
    blur = Blur(window, extent, 3, 5, chain)
    out = blur.draw(image, 0.6).download()
    assert out.shape == (23, 39, 4)
    np.testing.assert_allclose(out, 0.5, atol=1e-6)
    release(blur, image)


@pytest.mark.parametrize('chain', CHAINS)
@pytest.mark.parametrize('kernel', [3, 9])
@pytest.mark.parametrize('levels', [1, 2, 4])
def test_light_ends_where_it_says(window, chain, kernel, levels):
    blur = Blur(window, (640, 16), levels, kernel, chain)
    quad = Quad(window, SPOT.format(320, 8))
    with blur.source.drawing():
        quad.draw()
    assert blur.lit() == (319, 7, 321, 9)
    row = blur.draw(blur.source.colors[0], 1.0).download()[..., 0].max(axis=0)
    lit = np.flatnonzero(row)
    # Between texels too: one more on each side.
    assert 2 * (lit[0] - 1) >= 319 - blur.reach
    assert 2 * (lit[-1] + 2) <= 321 + blur.reach
    release(blur, quad)


@pytest.mark.parametrize('chain', CHAINS)
@pytest.mark.parametrize('levels', [1, 3])
def test_its_width_is_what_it_says(window, chain, levels):
    """The second moment of what becomes of a spot."""
    blur = Blur(window, (512, 512), levels, 5, chain)
    quad = Quad(window, SPOT.format(256, 256))
    with blur.source.drawing():
        quad.draw()
    light = blur.draw(blur.source.colors[0], 1.0).download()[..., 0].astype(float)
    assert 4 * light.sum() == pytest.approx(4, rel=1e-4)
    places = 2 * np.arange(256) + 1 - 256
    variance = (light.sum(axis=0) * places**2).sum() / light.sum() - 1 / 4
    assert variance == pytest.approx(blur.sigma**2, rel=0.01)
    release(blur, quad)


@pytest.mark.parametrize(('blend', 'there'), [('add', [0.75, 1.0]), ('screen', [0.625, 0.75])])
def test_quads_blend_with_what_is_there(window, blend, there):
    target = Target(window, 4, 4)
    quad = Quad(window, 'void main() { gl_FragData[0] = vec4(0.25, 0.5, 0.0, 0.5) + 0.0 * uv.x; }')
    with target.drawing(clear=(0.5, 0.5, 0.0, 0.5)):
        quad.draw(blend=blend)
    seen = target.colors[0].download()[1, 1] / 255
    np.testing.assert_allclose(seen, [*there, 0.0, 0.75], atol=2 / 255)
    with target.drawing():
        quad.draw()
    seen = target.colors[0].download()[1, 1] / 255
    np.testing.assert_allclose(seen, [0.25, 0.5, 0.0, 0.5], atol=1 / 255)
    release(target, quad)
