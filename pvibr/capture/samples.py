"""Frames of a window that are each the mean of several samples."""

from __future__ import annotations

from contextlib import contextmanager

from pvibr.effects.accumulation import Accumulation


@contextmanager
def sampled(pipelines, count, moments=None):
    """Yield a function that draws a frame of a window, of so many samples in all subplots.

    `moments` is called with each share of an exposure, 0 to 1, before the samples of it.
    """
    if count == 1:
        yield lambda window: window.Render()
        return
    found = [(p, _accumulation(p)) for p in pipelines if p.renderer.GetDraw()]
    effects = [effect or p.add(Accumulation()) for p, effect in found]
    enabled = [effect.enabled for effect in effects]

    def draw(window):
        for k in range(count):
            if moments is not None:
                moments((k + 0.5) / count)
            for effect in effects:
                effect.enabled = True
                effect.take(k, count)
            window.Render()

    try:
        yield draw
    finally:
        for (pipeline, old), effect, was_on in zip(found, effects, enabled, strict=True):
            if old is None:
                pipeline.remove(effect)
            else:
                effect.enabled = was_on
                effect.take(None)


def _accumulation(pipeline):
    """Return the accumulation of a pipeline, None without."""
    return next((e for e in pipeline.effects if isinstance(e, Accumulation)), None)
