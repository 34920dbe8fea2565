"""What tone mapping and the overlays cost in full-screen copies."""

from __future__ import annotations

from functools import partial

import numpy as np

from pvibr.bench.common.harness import Row
from pvibr.bench.effects.copies import Stand, in_copies
from pvibr.core.effect import Effect
from pvibr.core.frame import Frame
from pvibr.effects.backgrounds import Sky
from pvibr.effects.screen import Flash, ImageOverlay, Iris, NightVision, Vignette
from pvibr.effects.shader_effect import ShaderEffect
from pvibr.effects.tone_mapping import ToneMapping
from pvibr.gl.offscreen import hidden_window
from pvibr.maths.tones import CURVES


def measure(settings, results):
    """Yield the times of every curve and overlay, in copies of the picture."""
    times = _times(settings.screen, settings.rounds)
    yield from (Row(f'{name} over a copy', copies, 'x') for name, copies in times.items())
    results.points['copies'] |= times


def _times(size, rounds) -> dict:
    with hidden_window() as (window, renderer):
        stand, frame, effects = Stand(window, noise(size)), Frame.of(renderer), _effects(size)
        effects['Sky'].prepare(frame)
        jobs = {n: partial(e.render, frame, stand) for n, e in effects.items()}
        found, _ = in_copies(stand, jobs, rounds)
        for owner in (stand, *effects.values()):
            owner.release()
    return found


def _effects(size):
    found: dict[str, Effect] = {f'ToneMapping {c}': ToneMapping(curve=c) for c in CURVES}
    found['ToneMapping auto'] = ToneMapping(auto=True)
    found |= {e.name: e for e in (Vignette(), Flash(at=0), NightVision(), Iris(), Sky())}
    own = ShaderEffect(ShaderEffect.template, amount=0.5, tint=(1.0, 0.9, 0.7))
    image = ImageOverlay(noise(size, 1))
    return found | {'ImageOverlay': image, 'ShaderEffect, the template': own}


def noise(size, seed=0) -> np.ndarray:
    """Return an image of random pixels."""
    return np.random.default_rng(seed).integers(0, 256, (size[1], size[0], 4), np.uint8)
