"""Frames that are the mean of several samples."""

from __future__ import annotations

from contextlib import contextmanager

from pvibr.effects.accumulation import Accumulation


@contextmanager
def sampled(pipelines, sample_count, set_moment=None):
    """Yield a function that draws a window as the mean of many samples in all subplots.

    `set_moment` is called before each sample with its time in the exposure, 0 to 1.
    """
    if sample_count == 1:
        yield lambda window: window.Render()
        return
    drawing = [pipeline for pipeline in pipelines if pipeline.renderer.GetDraw()]
    old_effects = [_accumulation(pipeline) for pipeline in drawing]
    was_enabled = [old is not None and old.enabled for old in old_effects]
    effects = [old or p.add(Accumulation()) for p, old in zip(drawing, old_effects, strict=True)]

    def draw(window):
        for k in range(sample_count):
            if set_moment is not None:
                set_moment((k + 0.5) / sample_count)
            for effect in effects:
                effect.enabled = True
                effect.take(k, sample_count)
            window.Render()

    try:
        yield draw
    finally:
        for k, pipeline in enumerate(drawing):
            if old_effects[k] is None:
                pipeline.remove(effects[k])
            else:
                effects[k].enabled = was_enabled[k]
                effects[k].take(None)


def _accumulation(pipeline):
    """Return a pipeline's accumulation, or None."""
    return next((e for e in pipeline.effects if isinstance(e, Accumulation)), None)
