"""The scene as other views have it: those of lights, mirrors, textures and image layers."""

from __future__ import annotations

from contextlib import contextmanager


@contextmanager
def seen_from(things, seen):
    """Let things be drawn in a frame of another view: they answer ``thing.draws(seen)`` within.

    The pipeline prepares them for their own frame again, once, before the next effect.
    """
    seen.astray.update(things)
    try:
        yield
    finally:
        for thing in things:
            thing.finish(seen)
