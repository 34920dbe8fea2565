"""No frame waits for a GPU: it would stand still until Python has its answer."""

import numpy as np
import pytest

import pvibr
from tests import test_every_thing as things
from tests.calls import calls_of
from tests.effects import test_every as effects
from tests.pictures import off, shot

pytestmark = pytest.mark.sampled

#: What returns once the GPU has drawn: methods of VTK, and `download`, which reads a texture.
WAITS = {
    *('download', 'Download1D', 'Download3D', 'WaitForCompletion', 'MapBuffer'),
    *('GetPixelData', 'GetRGBAPixelData', 'GetRGBACharPixelData', 'GetZbufferData'),
    *('GetZbufferDataAtPoint', 'vtkglReadPixels', 'vtkglFinish', 'vtkglGetTexImage'),
}


def waits_of(pl) -> list[str]:
    """Return the waits in frames of a camera and a time that move."""

    def move():
        for k in range(4):
            pl.camera.Azimuth(4.0)
            pl.ibr.time += 0.1
            (pl.render if k else pl.render_window.Render)()

    move()
    return [name for name in calls_of(move) if name in WAITS]


@pytest.mark.parametrize('name', things.EVERY)
def test_things(name, monkeypatch):
    monkeypatch.setenv('PVIBR_DRIVER', 'hardware')
    pl, thing = things.drawn(name)
    assert not waits_of(pl)
    assert thing.enabled


@pytest.mark.parametrize('name', effects.EVERY)
def test_effects(name, monkeypatch):
    monkeypatch.setenv('PVIBR_DRIVER', 'hardware')
    pl = effects.plotter()
    effect = effects.add(pl, name)
    assert not waits_of(pl)
    assert effect.enabled


SETTINGS = {
    'automatic exposure': lambda: [pvibr.ToneMapping('aces', auto=True)],
    'exposed bloom': lambda: [pvibr.Bloom(0.4), pvibr.ToneMapping(auto=True)],
    'soft shadows': lambda: [pvibr.Shadows(method='pcss')],
    'volumes': lambda: [pvibr.Shadows(method='volume')],
    'accumulation': lambda: [pvibr.Accumulation()],
}


def scene(setting):
    pl = effects.plotter()
    for effect in SETTINGS[setting]():
        pl.ibr.add(effect)
    return pl


@pytest.mark.parametrize('setting', SETTINGS)
def test_settings(setting, monkeypatch):
    monkeypatch.setenv('PVIBR_DRIVER', 'hardware')
    pl = scene(setting)
    assert not waits_of(pl)
    assert all(effect.enabled for effect in pl.ibr.effects)


@pytest.mark.parametrize('setting', SETTINGS)
def test_pictures_of_both_kinds_of_driver(setting, monkeypatch):
    """Half floats have 11 bits, bytes 8."""
    pictures = []
    for kind in ('software', 'hardware'):
        monkeypatch.setenv('PVIBR_DRIVER', kind)
        pictures.append(shot(scene(setting)))
    assert off(*pictures).max() <= 1


def test_a_wait_is_seen(monkeypatch):
    """In software, where blurring less pays for the answer."""
    monkeypatch.setenv('PVIBR_DRIVER', 'software')
    pl = effects.plotter()
    effects.add(pl, 'Bloom')
    assert 'download' in waits_of(pl)


def test_layers_of_both_kinds_of_driver(monkeypatch):
    """What a GPU finds of an image serves from the next frame on."""
    pictures = []
    for kind in ('software', 'hardware'):
        monkeypatch.setenv('PVIBR_DRIVER', kind)
        pl, layers = things.drawn('ImageLayers')
        frames = [shot(pl)]
        for _ in range(6):
            pl.camera.Azimuth(0.3)
            frames.append(shot(pl))
        pictures.append(np.array(frames))
        assert layers.report()['taken'] >= 1
    assert (np.abs(pictures[1] - pictures[0]) > 15).mean() < 0.01
