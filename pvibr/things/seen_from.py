"""The scene in other views: those of lights, mirrors, textures and image layers."""

from __future__ import annotations

from contextlib import contextmanager


@contextmanager
def seen_from(things, other_frame):
    """Let things draw in a frame of another view: call ``thing.draws(seen)`` within.

    The pipeline prepares them for their own frame again before the next effect.
    """
    other_frame.astray.update(things)
    try:
        yield
    finally:
        for thing in things:
            thing.finish(other_frame)
