"""Textures, targets, full-screen programs: what goes in comes out, and nothing else changes."""

import numpy as np
import pytest
import pyvista as pv

from pvibr.core.errors import ShaderError
from pvibr.gl import Quad, Target, Texture, release, texture_limit
from pvibr.gl.hidden_window import hidden_window, read_pixels

COPY = 'uniform sampler2D image; void main() { gl_FragData[0] = texture(image, uv); }'


def drawn(window, fragment, uniforms=None, textures=None, size=(4, 3), format='rgba32f'):
    target, quad = Target(window, *size, (format,)), Quad(window, fragment)
    with target.drawing(clear=(9, 9, 9, 9)):
        quad.draw(uniforms, textures)
    out = target.colors[0].download()
    release(target, quad)
    return out


@pytest.mark.parametrize('dtype', [np.uint8, np.uint16, np.float32])
@pytest.mark.parametrize('channels', [1, 2, 3, 4])
@pytest.mark.parametrize('size', [(4, 3), (1, 1), (7, 5)])
def test_an_array_comes_back(window, dtype, channels, size):
    rng = np.random.default_rng(0)
    values = rng.uniform(0, 200, (size[1], size[0], channels)).astype(dtype)
    texture = Texture(window).upload(values)
    assert texture.size == size
    assert texture.nbytes == values.nbytes
    seen = drawn(window, COPY, textures={'image': texture}, size=size)[..., :channels]
    scale = 1 if dtype is np.float32 else np.iinfo(dtype).max
    np.testing.assert_allclose(seen * scale, values, rtol=1e-5)
    texture.release()
    assert texture.nbytes == 0


@pytest.mark.parametrize('channels', [1, 2, 3, 4])
def test_rows_come_back_whatever_the_window_aligns_them_to(window, channels):
    values = np.random.default_rng(0).integers(0, 255, (5, 7, channels), np.uint8)
    texture = Texture(window).upload(values)
    window.GetState().vtkglPixelStorei(0x0D05, 4)  # GL_PACK_ALIGNMENT, as windows of Qt have it
    np.testing.assert_array_equal(texture.download(), values)
    texture.release()


def test_an_array_replaces_another(window):
    texture = Texture(window)
    for side in (3, 8, 2):
        values = np.full((side, side, 4), side, np.float32)
        texture.upload(values)
        np.testing.assert_array_equal(texture.download(), values)
    texture.release()


@pytest.mark.parametrize('shape', [(0, 4, 4), (4, 0, 4), (1, 10**6, 1)])
def test_a_texture_that_cannot_be(window, shape):
    with pytest.raises(ValueError, match=f'must be 1 to {texture_limit(window)}'):
        Texture(window).upload(np.zeros(shape, np.uint8))
    with pytest.raises(ValueError, match=r'dtype must be one of uint8, .*, got float64'):
        Texture(window).upload(np.zeros((2, 2, 4)))


def test_row_zero_is_below(window):
    seen = drawn(window, 'void main() { gl_FragData[0] = vec4(uv, gl_FragCoord.xy); }')
    np.testing.assert_allclose(seen[0, :, 1], 1 / 6, rtol=1e-5)
    np.testing.assert_allclose(seen[:, 0, 0], 1 / 8, rtol=1e-5)
    np.testing.assert_allclose(seen[2, 3, 2:], [3.5, 2.5])


def test_uniforms_by_their_types(window):
    rows = np.arange(9.0).reshape(3, 3)
    text = """
      uniform int i; uniform float f; uniform vec2 a; uniform vec4 c; uniform mat3 m;
      void main()
      {
        vec3 turned = m * vec3(1.0, 10.0, 100.0) + max(uv.x - 1.0, 0.0);  // uv must be used
        gl_FragData[0] = vec4(float(i) + f, a.y, c.w, turned.y);
      }
    """
    values = {'i': np.int64(3), 'f': np.float32(0.5), 'a': (1, 2), 'c': [1, 2, 3, 4]}
    values['m'] = np.asarray(rows, float)
    seen = drawn(window, text, values)
    np.testing.assert_allclose(seen[0, 0], [3.5, 2, 4, rows[1] @ [1, 10, 100]])


def test_programs_hold_what_they_were_given(window):
    """Also of values that are changed in place, and of another program of the same text."""
    text = (
        'uniform vec2 a; uniform float f; void main() { gl_FragData[0] = vec4(a + uv.x, f, 0); }'
    )
    quads = [Quad(window, text, f'text {k}') for k in range(2)]
    target = Target(window, 1, 1, ('rgba32f',))
    changed = np.array([1.0, 2.0]), [3.0, 4.0], pv.pyvista_ndarray([5.0, 6.0])

    def seen(quad, a, f):
        with target.drawing():
            quad.draw({'a': a, 'f': f})
        return target.colors[0].download()[0, 0, :3].tolist()

    for a in changed:
        for step in (0.0, 8.0, 8.0, 16.0, 0.0):
            a[0] = step
            for quad in quads:
                assert seen(quad, a, step) == [step + 0.5, a[1] + 0.5, step]
                assert seen(quad, (a[1], a[0]), 1.0) == [a[1] + 0.5, step + 0.5, 1.0]
    for resource in (*quads, target):
        resource.release()


def test_a_shader_that_does_not_compile(window):
    with (
        pv.VtkErrorCatcher(send_to_logging=False),
        pytest.raises(ShaderError, match=r"shader 'mine' does not compile"),
    ):
        Quad(window, 'void main() { this is none; }', 'mine')


def test_a_target_puts_state_back(window):
    state = window.GetState()
    state.vtkglViewport(1, 2, 3, 4)
    target = Target(window, 5, 5, ('rgba8', 'rgba8'), depth=True)
    with pytest.raises(ZeroDivisionError), target.drawing(clear=(0, 0, 0, 0)):
        1 / 0
    found = [0] * 4
    state.vtkglGetIntegerv(0x0BA2, found)  # GL_VIEWPORT
    assert found == [1, 2, 3, 4]
    assert target.nbytes == 5 * 5 * (4 + 4 + 4)
    target.release()


def test_a_hidden_window_is_transparent_black(window):
    with hidden_window(6, 4) as (own, renderer):
        renderer.SetBackground(0, 0, 0)
        renderer.SetBackgroundAlpha(0.0)
        own.Render()
        assert read_pixels(own, alpha=True).shape == (4, 6, 4)
        assert read_pixels(own, alpha=True).max() == 0
