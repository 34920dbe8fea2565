"""The thread that uses a plotter: an OpenGL context belongs to one."""

from __future__ import annotations

import os
from threading import current_thread, get_ident
from weakref import WeakSet

from pvibr.core.errors import ThreadError

_FORKED = (
    'this process was forked from one whose window is open, and OpenGL does not work in it: '
    "start it by multiprocessing's 'spawn' or 'forkserver', or close all plotters before"
)


class DrawingThread:
    """The thread that uses a plotter first, or that draws its first frame."""

    #: Whether OpenGL was used before this process was forked.
    is_forked = False
    #: Of plotters that are open.
    drawing: WeakSet[DrawingThread] = WeakSet()

    def __init__(self):
        if DrawingThread.is_forked:
            raise ThreadError(_FORKED)
        self.has_drawn = False
        self._take_over()

    def _take_over(self):
        self._thread, self._ident = current_thread(), get_ident()

    def is_here(self) -> bool:
        """Return whether this is the thread."""
        return self._ident == get_ident() and not DrawingThread.is_forked

    def check(self):
        """Raise an error in a thread other than that of a window, unless that has ended."""
        if self.is_here():
            return
        if DrawingThread.is_forked:
            raise ThreadError(_FORKED)
        if self._thread.is_alive():
            raise ThreadError(
                f'pvibr must be called in the thread that uses its plotter, {self._thread.name}, '
                f'got {current_thread().name}: let that thread make the call, such as by a queue'
            )
        self._take_over()

    def begin(self):
        """Belong to this thread, which draws the first frame."""
        self._take_over()
        self.has_drawn = True
        DrawingThread.drawing.add(self)

    def end(self):
        """Belong to this thread, which closes the window, and forget that."""
        self._take_over()
        DrawingThread.drawing.discard(self)


def _after_fork():
    DrawingThread.is_forked |= len(DrawingThread.drawing) > 0


if hasattr(os, 'register_at_fork'):
    os.register_at_fork(after_in_child=_after_fork)
