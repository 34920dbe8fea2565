"""Textures of draws, bound to units that programs keep."""

import numpy as np
import pytest

from pvibr.gl import Texture
from pvibr.gl import enums as gl
from pvibr.gl.binder import Binder

TEXTURE_BINDING_2D = 0x8069


@pytest.fixture
def textures(window):
    made = [Texture(window).upload(np.zeros((2, 2, 4), np.uint8)) for _ in range(3)]
    yield made
    for texture in made:
        texture.release()


def bound_to(window, unit):
    state, handle = window.GetState(), [0]
    state.vtkglActiveTexture(gl.TEXTURE0 + unit)
    state.vtkglGetIntegerv(TEXTURE_BINDING_2D, handle)
    return handle[0]


def test_each_is_bound_to_the_unit_of_its_name(window, textures):
    binders, (a, b, c) = (Binder(), Binder()), textures
    for binder, named in zip(2 * binders, ({'x': a, 'y': b}, {'x': c, 'y': b}) * 2, strict=True):
        units = binder.bind(named)
        assert list(units) == list(named)
        for name, texture in named.items():
            assert bound_to(window, units[name]) == texture.object.GetHandle()
    binders[0].unbind()


def test_programs_keep_their_units(textures):
    a, b, c = textures
    assert Binder().bind({'x': a, 'y': b}) is Binder().bind({'x': c, 'y': a})


def test_what_was_released_is_bound_again(window, textures):
    a, binder = textures[0], Binder()
    binder.bind({'x': a})
    a.release()
    a.upload(np.zeros((2, 2, 4), np.uint8))
    unit = binder.bind({'x': a})['x']
    assert bound_to(window, unit) == a.object.GetHandle()


def test_draws_without_textures():
    assert Binder().bind({}) == {}
