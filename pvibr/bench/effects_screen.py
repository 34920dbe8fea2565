"""What tone mapping and the billboards cost in full-screen copies."""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np

from pvibr.bench.copies import Stand, in_copies
from pvibr.core.frame import Frame
from pvibr.effects.backgrounds import Sky
from pvibr.effects.screen import Flash, ImageOverlay, Iris, NightVision, Vignette
from pvibr.effects.shader_effect import ShaderEffect
from pvibr.effects.tone_mapping import ToneMapping
from pvibr.gl.offscreen import hidden_window
from pvibr.maths.tones import CURVES


def screen_times(size=(1280, 720), rounds=9) -> dict:
    """Time every curve and billboard and a copy of the picture, in turns."""
    with hidden_window() as (window, renderer):
        array = np.random.default_rng(0).integers(0, 256, (size[1], size[0], 4), np.uint8)
        stand, frame, effects = Stand(window, array), Frame.of(renderer), _effects(size)
        effects['Sky'].prepare(frame)
        found = in_copies(
            stand, {n: partial(e.render, frame, stand) for n, e in effects.items()}, rounds
        )
        for owner in (stand, *effects.values()):
            owner.release()
    return found


def _effects(size) -> dict[str, Any]:
    image = np.random.default_rng(1).integers(0, 256, (size[1], size[0], 4), np.uint8)
    found: dict[str, Any] = {f'ToneMapping {c}': ToneMapping(curve=c) for c in CURVES}
    others: tuple[Any, ...] = (
        ToneMapping(auto=True),
        Vignette(),
        Flash(at=0),
        NightVision(),
        Iris(),
        Sky(),
    )
    found |= {e.name if e.name != 'ToneMapping' else 'ToneMapping auto': e for e in others}
    own = ShaderEffect(ShaderEffect.template, amount=0.5, tint=(1.0, 0.9, 0.7))
    return found | {'ImageOverlay': ImageOverlay(image), 'ShaderEffect, the template': own}
