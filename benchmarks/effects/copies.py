"""What image effects cost in full-screen copies: tone mapping and the overlays here."""

from __future__ import annotations

from functools import partial

import numpy as np

from benchmarks.common.harness import Row
from benchmarks.common.timing import least, seconds
from pvibr.core.effect import Effect
from pvibr.effects.backgrounds import Sky
from pvibr.effects.screen import Flash, ImageOverlay, Iris, NightVision, Vignette
from pvibr.effects.shader_effect import ShaderEffect
from pvibr.effects.tone_mapping import ToneMapping
from pvibr.gl import Quad, Target, Texture, release
from pvibr.gl.fused import Fused
from pvibr.gl.hidden_window import hidden_window
from pvibr.maths.tones import CURVES
from pvibr.things.frame import Frame

_COPY = 'uniform sampler2D color; void main() { gl_FragData[0] = texture(color, uv); }'


class Stand:
    """What an effect sees of a frame and of its picture."""

    def __init__(self, window, array):
        self.window = window
        self.size = array.shape[1], array.shape[0]
        self.color = Texture(window, filter='linear').upload(array)  # as a frame's picture is
        self.depth = self.color  # whose red is as good as depth
        self.target = Target(window, *self.size, ('rgba16f',))
        self.drawing = self.target.drawing
        self.scale, self.whole, self.time = 1, self.size, 0.0
        self.tile = 0.0, 0.0, 1.0, 1.0
        self.view_from_world = self.clip_from_view = np.eye(4)
        self._ground = Target(window, *self.size)
        self._fused = Fused(window)

    def apply(self, point):
        """Draw a program at once."""
        self._fused.draw(self, [point])

    def ground(self, blend):
        """Return what is blended with, as for the last effect of a frame."""
        return self._ground

    def release(self):
        """Free the GPU's memory; the context must be alive."""
        self._fused.release()
        self.color.release()
        self.target.release()
        self._ground.release()


class Copy(Effect):
    """One full-screen copy: what other effects are measured in."""

    _quad: Quad | None = None

    def render(self, frame, picture):
        """Draw the picture once more."""
        if self._quad is None:
            self._quad = Quad(frame.window, _COPY, 'copy')
        with picture.drawing():
            self._quad.draw(textures={'color': picture.color})

    def release(self):
        """Free the GPU's memory."""
        if self._quad is not None:
            self._quad.release()
            self._quad = None


class HalfFloatCopy:
    """One pass over a window's size from one texture of half floats to another."""

    def __init__(self, window, size):
        width, height = size
        self._source, self._target = (
            Target(window, width, height, ('rgba16f',)) for _ in range(2)
        )
        self._quad = Quad(window, _COPY, 'copy')
        pixels = Texture(window, filter='linear').upload(noise(size))
        self._source.draw(self._quad, textures={'color': pixels})
        pixels.release()

    def draw(self):
        """Copy once."""
        self._target.draw(self._quad, textures={'color': self._source.colors[0]})

    def release(self):
        """Free the GPU's memory; the context must be alive."""
        release(self._source, self._target, self._quad)


def in_copies(stand, jobs, rounds) -> tuple[dict, float]:
    """Return the times of jobs in copies of the picture, and the ms of a copy, taken in turns."""
    copy = Copy()
    jobs = {**jobs, 'copy': partial(copy.render, stand, stand)}
    best = least(rounds, {n: partial(seconds, stand.window, job) for n, job in jobs.items()})
    copy.release()
    copied = best.pop('copy')
    return {name: s / copied for name, s in best.items()}, 1e3 * copied


def measure(settings, results):
    """Yield the times of every curve and overlay, in copies of the picture."""
    size = settings.screen
    with hidden_window() as (window, renderer):
        stand, frame, effects = Stand(window, noise(size)), Frame.of(renderer), _effects(size)
        effects['Sky'].prepare(frame)
        jobs = {n: partial(e.render, frame, stand) for n, e in effects.items()}
        times, _ = in_copies(stand, jobs, settings.rounds)
        for owner in (stand, *effects.values()):
            owner.release()
    yield from (Row(f'{name} over a copy', copies, 'x') for name, copies in times.items())
    results.points['copies'] |= times


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
