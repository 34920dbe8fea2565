"""Code: pasted where there is a plotter, it makes the same."""

import inspect

import numpy as np
import pytest
import pyvista as pv

import pvibr
from pvibr.core.effect import Effect
from pvibr_widgets.model import Model


def plotter():
    pl = pv.Plotter(shape=(1, 2), window_size=(64, 32))
    pl.subplot(0, 0)
    return pl


def test_image_effects_are_made_again():
    pl = plotter()
    pl.ibr.add(pvibr.Bloom(threshold=0.25, blend='screen', levels=3))
    lens = pl.ibr.add(pvibr.DepthOfField((1, 2, 3), f_number=1.4))
    lens.name = 'lens'
    pl.subplot(0, 1)
    pl.ibr.add(pvibr.Sky(top=(0.1, 0.2, 0.3)))
    pl.ibr.add(pvibr.Outline(width=5, color=(1, 0, 0), opacity=0.123456789)).enabled = False
    pl.ibr.time = 1.25
    other = plotter()
    exec(Model(pl).code(), {'pl': other})
    assert other.ibr.state() == pl.ibr.state()


def test_what_is_made_of_data_is_set():
    def add(pl, **settings):
        ball = pl.add_mesh(pv.Sphere())
        pl.ibr.add_spheres([[0, 0, 0]], 1.0, name='atoms')
        pl.ibr.add(pvibr.Glow(ball, **settings))
        pl.ibr.add(pvibr.Outline(actors=[ball], **settings and {'width': 7}))
        pl.ibr.add(pvibr.ImageOverlay(np.ones((4, 4))))

    pl, other = plotter(), plotter()
    add(pl, intensity=0.5)
    add(other)
    pl.ibr.add(pvibr.Vignette())
    pl.ibr.contents['0']['atoms'].visibility = False
    code = Model(pl).code()
    assert code.count('pl.ibr.add(') == 1
    exec(code, {'pl': other})
    assert other.ibr.state() == pl.ibr.state()


def test_effects_of_the_users_own_are_set():
    class Fade(Effect):
        amount = pvibr.Param(0.5, 'How much.', range='[0, 1]')

    pl, other = plotter(), plotter()
    pl.ibr.add(Fade(amount=0.25))
    other.ibr.add(Fade())
    exec(Model(pl).code(), {'pl': other})
    assert other.ibr.effects[0].amount == 0.25


def test_one_subplot_needs_no_word_of_it():
    pl = pv.Plotter(window_size=(64, 32))
    pl.ibr.add(pvibr.Bloom())
    assert Model(pl).code() == 'import pvibr\n\npl.ibr.add(pvibr.Bloom())'


def test_what_is_in_nothing_is_no_code():
    assert Model(plotter()).code().strip() == 'import pvibr'


MADE_OF = [
    (k, name)
    for k in (getattr(pvibr, n) for n in pvibr.__all__)
    if isinstance(k, type)
    and issubclass(k, Effect)
    and all(
        p.default is not p.empty
        for p in inspect.signature(k).parameters.values()
        if p.kind is not p.VAR_KEYWORD
    )
    for name, p in inspect.signature(k).parameters.items()
    if p.kind is not p.VAR_KEYWORD and name != 'images'
]


@pytest.mark.parametrize(('kind', 'name'), MADE_OF)
def test_what_a_constructor_took_can_be_asked_for(kind, name):
    thing = (
        kind('vec4 effect(vec2 uv) { return color_at(uv); }')
        if kind is pvibr.ShaderEffect
        else kind()
    )
    assert hasattr(thing, name) or hasattr(thing, f'_{name}')
