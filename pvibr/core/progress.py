"""Bakes show their progress and can be interrupted."""

from __future__ import annotations

import signal
import sys
import threading
import time
from contextlib import contextmanager

_SOON = 1.0  # seconds after which a bar appears


@contextmanager
def baking(shown, title='Baking views'):
    """Yield a function of the fraction done, which shows it and raises what was interrupted."""
    # VTK ends the process if Ctrl-C is pressed while it calls Python: the signal waits for the
    # next step.
    with _deferred_interrupt() as check, _bar(shown, title) as show:

        def advance(done):
            check()
            show(done)

        yield advance
        check()


def in_notebook() -> bool:
    """Return True in a kernel of Jupyter."""
    return 'ipykernel' in sys.modules


@contextmanager
def _deferred_interrupt():
    pressed: list[bool] = []

    def check():
        if pressed:
            raise KeyboardInterrupt

    if threading.current_thread() is not threading.main_thread():
        yield check
        return
    before = signal.getsignal(signal.SIGINT)
    signal.signal(signal.SIGINT, lambda *_: pressed.append(True))
    try:
        yield check
    finally:
        signal.signal(signal.SIGINT, before or signal.SIG_DFL)


@contextmanager
def _bar(shown, title):
    """Yield a function of the fraction done; the bar appears after a while."""
    if not (sys.stderr.isatty() or in_notebook() if shown is None else shown):
        yield lambda _: None
        return
    from rich.console import Console
    from rich.progress import Progress

    start, bar = time.perf_counter(), Progress(console=Console(stderr=True), transient=True)
    task = bar.add_task(title, total=1.0)

    def show(done):
        if time.perf_counter() - start > _SOON:
            bar.start()
        bar.update(task, completed=done)

    try:
        yield show
    finally:
        bar.stop()
