"""A plugin of pytest that runs PyVista's own tests of plotting beside pvibr.

In a clone of PyVista, at the tag that is installed, with the tests' requirements installed::

    export PYTHONPATH=path/to/pvibr/.ci
    python -m pytest tests/plotting -p pyvista_tests --generated_image_dir out/alone
    export PVIBR_EFFECT=identity
    python -m pytest tests/plotting -p pyvista_tests --generated_image_dir out/identity

`PVIBR_EFFECT` says what every subplot of every plotter has: `none`, `identity` (an effect that
returns each pixel as it is), `neutral` (every effect that can be, at its neutral setting) or
`silent` (the same at a billionth: all run, and what they add is less than a pixel can show).
Where pvibr is not installed and `PVIBR_EFFECT` is not set, it is PyVista alone.
"""

from __future__ import annotations

import functools
import gc
import os

import numpy as np
import pytest
import pyvista as pv
import vtkmodules.vtkRenderingOpenGL2  # noqa: F401
from vtkmodules.vtkRenderingCore import vtkRenderWindow

EFFECT = os.environ.get('PVIBR_EFFECT')


def _identity():
    import pvibr

    return [pvibr.ShaderEffect('vec4 effect(vec2 uv) { return color_at(uv); }')]


def _neutral():
    import pvibr

    found = [getattr(pvibr, name) for name in pvibr.EFFECTS]
    found = [kind for kind in found if kind.neutral and kind.render is not pvibr.Effect.render]
    made = [kind.sample([]) for kind in found]
    for effect in made:
        setattr(effect, *effect.neutral)
    return made


def _silent():
    made = [effect for effect in _neutral() if effect.neutral[1] == 0]
    for effect in made:
        setattr(effect, effect.neutral[0], 1e-9)
    return made


EFFECTS = {'none': list, 'identity': _identity, 'neutral': _neutral, 'silent': _silent}


def _with_effects(init, make):
    @functools.wraps(init)
    def made(self, *args, **kwargs):
        init(self, *args, **kwargs)
        places = [self.renderers.index_to_loc(k) for k in range(len(self.renderers))]
        for place in [*places[1:], places[0]]:
            self.subplot(*np.atleast_1d(place).tolist())
            for effect in make():
                self.ibr.add(effect)

    return made


if EFFECT:
    import pvibr.api.plotter_component  # noqa: F401

    if EFFECT != 'none':
        pv.Plotter.__init__ = _with_effects(pv.Plotter.__init__, EFFECTS[EFFECT])


def pytest_collection_finish():
    """Let no search for leaks go through modules and tests: it takes most of the time."""
    gc.collect()
    gc.freeze()


@pytest.fixture(autouse=True, scope='session')
def _open_display():
    """Hold a window open: with the last one the driver is unloaded, and loaded for the next."""
    window = vtkRenderWindow()  # no plotter: PyVista's fixtures close those
    window.SetOffScreenRendering(True)
    window.Render()
    gc.freeze()
    yield
    window.Finalize()
