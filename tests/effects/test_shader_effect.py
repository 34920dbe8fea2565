"""Effects of a user's own: the contract of the template, against the same in numpy."""

import numpy as np
import pytest
import pyvista as pv

import pvibr
from pvibr import Param, ShaderEffect
from pvibr.core.errors import PvibrWarning
from tests.makers import ENABLED
from tests.pictures import places, shot
from tests.refusals import refused

pytestmark = pytest.mark.sampled

SIZE = (96, 64)


@pytest.fixture
def pl():
    pl = pv.Plotter(window_size=SIZE)
    pl.set_background((0.1, 0.4, 0.6))
    pl.add_mesh(pv.Sphere(), color='tan', smooth_shading=True)
    pl.add_mesh(pv.Cube(center=(0.6, 0, 0)), color='red')
    pl.camera_position = [(0, -3, 1), (0.2, 0, 0), (0, 0, 1)]
    pl.show(auto_close=False)
    return pl


def body(text):
    return f'vec4 effect(vec2 uv) {{ {text} }}'


def test_the_picture_itself(pl):
    before = shot(pl)
    pl.ibr.add(ShaderEffect(body('return color_at(uv);')))
    np.testing.assert_array_equal(shot(pl), before)


def test_settings_are_uniforms_of_their_types(pl):
    class Mixed(ShaderEffect):
        source = body(
            'return vec4(on ? pair.x : 0.0, count == 3 ? tint.g : 0.0,'
            ' way == 1 ? level * four.w : 0.0, 1.0);'
        )
        on = Param(True, 'A bool.')
        count = Param(3, 'An int.', range='[0, 9]')
        level = Param(0.5, 'A float.', range='[0, 1]')
        way = Param('down', 'A choice.', choices=('up', 'down'))
        pair = Param((0.2, 0.3), 'Two.')
        tint = Param((0.0, 0.6, 0.0), 'Three.')
        four = Param((0.0, 0.0, 0.0, 0.8), 'Four.')

    effect = pl.ibr.add(Mixed())
    assert np.abs(shot(pl) - 255 * np.array([0.2, 0.6, 0.4])).max() <= 1
    effect.on, effect.count, effect.way = False, 2, 'up'
    assert (shot(pl) == 0).all()
    assert effect.state()['tint'] == [0.0, 0.6, 0.0]
    with pytest.raises(ValueError, match=r'Mixed.level must be a float in \[0, 1\], got 2'):
        effect.level = 2


def test_values_given_with_a_text_are_settings(pl):
    one = ShaderEffect(body('return vec4(vec3(amount), 1.0);'), amount=0.5)
    two = ShaderEffect(body('return vec4(0.0);'))
    assert not hasattr(two, 'amount')
    pl.ibr.add(one)
    assert np.abs(shot(pl) - 127.5).max() <= 1
    one.amount = 0.25
    assert np.abs(shot(pl) - 63.75).max() <= 1
    with pytest.raises(TypeError, match='amount'):
        one.amount = 'much'


def test_intensity_mixes(pl):
    before = shot(pl)
    effect = pl.ibr.add(ShaderEffect(body('return vec4(1.0);'), intensity=0.25))
    assert np.abs(shot(pl) - (0.75 * before + 0.25 * 255)).max() <= 1
    effect.intensity = 0
    np.testing.assert_array_equal(shot(pl), before)


def test_places_size_and_time(pl):
    pl.ibr.add(ShaderEffect(body('return vec4(uv, time / 10.0, 1.0);')))
    pl.ibr.time = 4.0
    expected = 255 * np.dstack([places(SIZE), np.full(SIZE[::-1], 0.4)])
    assert np.abs(shot(pl) - expected).max() <= 1
    large = shot(pl, scale=2).reshape(SIZE[1], 2, SIZE[0], 2, 3).mean(axis=(1, 3))
    assert np.abs(large - expected).max() <= 1
    pl.ibr.clear()
    pl.ibr.add(ShaderEffect(body('return vec4(size / 256.0, scale / 4.0, 1.0);')))
    assert np.abs(shot(pl) - 255 * np.array([96 / 256, 64 / 256, 0.25])).max() <= 1
    assert np.abs(shot(pl, scale=2) - 255 * np.array([192 / 256, 0.5, 0.5])).max() <= 1


def test_colours_of_other_places(pl):
    before = shot(pl)
    pl.ibr.add(ShaderEffect(body('return color_at(vec2(1.0 - uv.x, uv.y));')))
    np.testing.assert_array_equal(shot(pl), before[:, ::-1])


@pytest.mark.parametrize('parallel', [False, True])
def test_depth_is_in_world_units(pl, parallel):
    pl.camera.parallel_projection = parallel
    depth = pl.ibr.buffer('depth')
    text = 'float d = depth_at(uv); return vec4(d == nothing ? 1.0 : 0.0, d / 8.0, 0.0, 1.0);'
    pl.ibr.add(ShaderEffect(body(text)))
    found = shot(pl) / 255
    nothing = np.isinf(depth)
    assert 0.1 < nothing.mean() < 0.9
    np.testing.assert_array_equal(found[..., 0] == 1, nothing)
    assert np.abs(found[..., 1] - depth / 8)[~nothing].max() < 1 / 255


def test_normals_and_ids_are_drawn_where_the_text_names_them(pl):
    normal, number = pl.ibr.buffer('normal'), pl.ibr.buffer('id')
    text = 'return vec4(0.5 + 0.5 * normal_at(uv), 1.0);'
    effect = pl.ibr.add(ShaderEffect(body(text)))
    assert np.abs(shot(pl) - 255 * (0.5 + 0.5 * normal)).max() <= 1
    effect.source = body('return vec4(vec3(float(id_at(uv) + 1) / 4.0), 1.0);')
    assert np.abs(shot(pl) - 255 * (number[..., None] + 1) / 4).max() <= 1
    held = pl.ibr.report().picture_bytes
    pl.ibr.remove(effect)
    pl.ibr.add(ShaderEffect(body('return color_at(uv); /* no normal_at here */')))
    shot(pl)
    assert pl.ibr.report().picture_bytes < held


def test_images(pl):
    image = np.random.default_rng(5).integers(0, 256, (*SIZE[::-1], 3), np.uint8)
    pl.ibr.add(ShaderEffect(body('return texture(paper, uv);'), images={'paper': image}))
    assert np.abs(shot(pl) - image).max() <= 1


def test_light_above_one_before_tone_mapping(pl):
    class Lamp(ShaderEffect):
        source = body('return vec4(vec3(4.0), 1.0);')
        before = 'ToneMapping'

    lamp = pl.ibr.add(Lamp(needs_hdr=True))
    pl.ibr.add(pvibr.ToneMapping(exposure=-6))
    light = ((4 + 0.055) / 1.055) ** 2.4 / 64  # six stops less of it
    assert np.abs(shot(pl) - 255 * (1.055 * light ** (1 / 2.4) - 0.055)).max() <= 1
    assert pl.ibr.effects[0] is lamp
    odd = Lamp()
    odd.before = 'Lunch'
    refused(r"Lamp.before must be one of .*, Shadows, .*got 'Lunch'", pl.ibr.add, odd)


def test_what_is_no_number_leaves_the_pixel(pl):
    before = shot(pl)
    text = 'float zero = min(uv.x, 0.0); return vec4(uv.x < 0.5 ? zero / zero : 1.0);'
    pl.ibr.add(ShaderEffect(body(text)))
    after = shot(pl)
    np.testing.assert_array_equal(after[:, :48], before[:, :48])
    assert (after[:, 48:] == 255).all()


@pytest.mark.parametrize('text', ['c + nonsense', 'c +', 'effect(uv, c)'])
def test_errors_name_file_line_and_text(pl, tmp_path, text):
    before = shot(pl)
    path = tmp_path / 'mine.glsl'
    path.write_text(
        f'// mine\nvec4 effect(vec2 uv)\n{{\n  vec4 c = color_at(uv);\n  return {text};\n}}'
    )
    effect = pl.ibr.add(ShaderEffect(path))
    with pytest.warns(PvibrWarning, match='ShaderEffect is off') as caught:
        after = shot(pl)
    np.testing.assert_array_equal(after, before)
    said = str(caught[0].message)
    assert f"{path}, line 5, 'return {text};': " in said
    path.write_text(body('return vec4(1.0);'))
    effect.enabled = True
    assert (shot(pl) == 255).all()


def test_a_text_without_the_function(pl):
    pl.ibr.add(ShaderEffect('vec4 efect(vec2 uv) { return vec4(1.0); }'))
    with pytest.warns(PvibrWarning, match="shader 'ShaderEffect' does not compile.*effect"):
        shot(pl)


def test_the_template_is_an_effect(pl):
    before = shot(pl) / 255
    pl.ibr.add(ShaderEffect(ShaderEffect.template, amount=0.5, tint=(1, 0.9, 0.7)))
    gray = (before @ [0.2126, 0.7152, 0.0722])[..., None]
    expected = 0.5 * before + 0.5 * gray * [1, 0.9, 0.7]
    assert np.abs(shot(pl) - 255 * expected).max() <= 1


def test_bad_arguments(tmp_path):
    refused(r'source must be GLSL', ShaderEffect)
    with pytest.raises(FileNotFoundError):
        ShaderEffect(tmp_path / 'none.glsl')
    with pytest.raises(ValueError, match=r'ShaderEffect\.size must not be a reserved name'):
        ShaderEffect(body('return vec4(size);'), size=2.0)
    with pytest.raises(TypeError, match=r'ShaderEffect\.word must be a uniform'):
        ShaderEffect(body('return vec4(0.0);'), word='x')
    refused('five', ShaderEffect, body('return vec4(0.0);'), kind=TypeError, five=(1, 2, 3, 4, 5))


@pytest.mark.parametrize('high', [False, True])
@pytest.mark.parametrize('name', ['ssaa', 'msaa', 'ssao', 'peeling', 'gradient', 'nothing'])
def test_normals_beside_what_a_plotter_enables(pl, name, high):
    normal = pl.ibr.buffer('normal')
    ENABLED[name](pl)
    text = 'return vec4(0.5 + 0.5 * normal_at(uv), 1.0);'
    pl.ibr.add(ShaderEffect(body(text), needs_hdr=high))
    shot(pl)
    differ = np.abs(shot(pl) - 255 * (0.5 + 0.5 * normal)).max(axis=2)
    assert (differ > 3).mean() < 0.02  # along edges, where there are several samples
    assert np.median(differ) <= 1
    large = shot(pl, scale=2).reshape(SIZE[1], 2, SIZE[0], 2, 3).mean(axis=(1, 3))
    assert (np.abs(large - shot(pl)).max(axis=2) > 12).mean() < 0.12  # at edges
