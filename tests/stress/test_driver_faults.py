"""What a driver may refuse, for every thing and effect: what is promised in docs/limits.md."""

from __future__ import annotations

import sys
import warnings
from contextlib import contextmanager
from functools import cache

import pytest
import pyvista as pv

import pvibr
from pvibr.gl.feature import Feature
from pvibr.gl.quad import Quad
from pvibr.gl.target import Target
from pvibr.gl.texture import Texture
from tests.browser import everything
from tests.browser.everything import EVERYTHING
from tests.pictures import off, plotter, shot
from tests.stress.scenes import HOME, SIZE, fill, picture

_WRONG = '\nthis does not compile;\n'


@pytest.fixture(autouse=True, scope='module')
def _light():
    with everything.lighter():
        yield


def no_program(patch):
    """Programs of whole pictures do not compile."""
    make = Quad.__init__

    def wrong(self, window, fragment, name='quad', geometry=''):
        make(self, window, _WRONG + fragment, name, geometry)

    patch.setattr(Quad, '__init__', wrong)


def no_shader_text(patch):
    """VTK's programs with text of pvibr do not compile; of instances, their own first."""
    marked = Feature._marked

    def wrong(self, text):
        return marked(self, text if self.name == 'mirrored' else text + _WRONG)

    patch.setattr(Feature, '_marked', wrong)


def no_framebuffer(patch):
    """Framebuffers are incomplete."""

    def refused(_):
        raise RuntimeError('the driver cannot draw into targets of these formats')

    patch.setattr(Target, '_check', refused)


def no_floats(patch):
    """Only bytes can be drawn into."""
    allocate = Texture.allocate

    def refused(self, width, height, format='rgba8'):
        if format.endswith('f') and format != 'depth32f':
            raise RuntimeError(f'the driver refused a {format} target of {width} x {height}')
        return allocate(self, width, height, format)

    patch.setattr(Texture, 'allocate', refused)


def no_room(patch):
    """There is no memory for textures of data."""

    def refused(self, array):
        raise RuntimeError(f'the driver refused a texture of {array.shape} {array.dtype}')

    patch.setattr(Texture, 'upload', refused)


def small_textures(patch):
    """Textures have at most 1 024 texels along a side."""
    for name, module in [*sys.modules.items()]:
        if name.startswith('pvibr.') and hasattr(module, 'texture_limit'):
            patch.setattr(module, 'texture_limit', lambda _: 1024)


def few_units(patch):
    """A program samples at most 16 textures."""
    for name, module in [*sys.modules.items()]:
        if name.startswith('pvibr.') and hasattr(module, 'texture_units'):
            patch.setattr(module, 'texture_units', lambda _: 16)


FAULTS = [
    no_program,
    no_shader_text,
    no_framebuffer,
    no_floats,
    no_room,
    small_textures,
    few_units,
]
#: The share of pixels that may differ; samples of an accumulation differ from frame to frame.
SHARE = 0.02


@cache
def unchanged(name):
    """Return the picture of a scene where nothing fails."""
    return picture(name)[0]


def differ(one, other):
    return (off(one, other) > 15).mean()


@contextmanager
def heard():
    """Yield what pvibr warns of; VTK's own errors are not printed."""
    said = []
    with (
        warnings.catch_warnings(record=True) as caught,
        pv.VtkErrorCatcher(send_to_logging=False),
    ):
        warnings.simplefilter('always')
        yield said
    said += [str(w.message) for w in caught if w.category is pvibr.PvibrWarning]


def check_told(pl, said):
    """Check that what is off was told once, by its name and with what to do."""
    for row in pl.ibr.report().rows:
        if row.state == 'off':
            about = [text for text in said if text.startswith(f'{row.effect} is off')]
            assert len(about) == 1, said
            assert 'enabled = True' in about[0]
            assert row.why.splitlines()[0] in about[0]
        else:
            assert row.state == 'ran'
    assert len(set(said)) == len(said) <= 2, said  # a crowd has two ways left


@pytest.mark.sampled
@pytest.mark.parametrize('name', EVERYTHING)
@pytest.mark.parametrize('fault', FAULTS, ids=lambda fault: fault.__name__)
def test_driver_that_refuses(name, fault, monkeypatch):
    """The picture goes on, whole or without the effect, which is told; and comes back."""
    pl = plotter(SIZE, lighting='light kit')
    with monkeypatch.context() as patch:
        fault(patch)
        with heard() as said:
            fill(pl, name, HOME)
            pl.show(auto_close=False)
            shot(pl)
        with heard() as again:
            found = shot(pl)
        check_told(pl, said)
        assert not again
        is_off = pl.ibr.report().rows[0].state == 'off'
        with heard():
            pl.ibr.effects[0].enabled = False
            plain = shot(pl)
    if is_off:
        assert differ(found, plain) <= SHARE
    elif not said:
        assert differ(found, unchanged(name)) <= SHARE
    if fault is not no_shader_text:  # whose text stays with the features that have it
        pl.ibr.effects[0].enabled = True
        with heard() as said:
            shot(pl)
            assert differ(shot(pl), unchanged(name)) <= SHARE
        assert not said
