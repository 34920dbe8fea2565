"""Progress bars of bakes, and deferred interrupts."""

from __future__ import annotations

import signal
import sys
import threading
import time
from contextlib import contextmanager

_DELAY = 1.0  # seconds until a bar appears


@contextmanager
def baking(visible, title='Baking views'):
    """Yield a function that shows the fraction done and raises a pending KeyboardInterrupt."""
    # Ctrl-C while VTK calls Python would end the process: defer the signal to the next step.
    with _deferred_interrupt() as raise_pending, _bar(visible, title) as show_fraction:

        def advance(fraction):
            raise_pending()
            if fraction is not None:
                show_fraction(fraction)

        yield advance
        raise_pending()


def in_notebook() -> bool:
    """Return True in a Jupyter kernel."""
    return 'ipykernel' in sys.modules


@contextmanager
def _deferred_interrupt():
    pending_signals: list[bool] = []

    def check():
        if pending_signals:
            raise KeyboardInterrupt

    if threading.current_thread() is not threading.main_thread():
        yield check
        return
    old_handler = signal.getsignal(signal.SIGINT)
    signal.signal(signal.SIGINT, lambda *_: pending_signals.append(True))
    try:
        yield check
    finally:
        signal.signal(signal.SIGINT, old_handler or signal.SIG_DFL)


@contextmanager
def _bar(visible, title):
    """Yield a function that shows the fraction done, in a bar that appears after a delay."""
    if not (sys.stderr.isatty() or in_notebook() if visible is None else visible):
        yield lambda _: None
        return
    from rich.console import Console
    from rich.progress import Progress

    start_time = time.perf_counter()
    progress_bar = Progress(console=Console(stderr=True), transient=True)
    task_id = progress_bar.add_task(title, total=1.0)

    def show(fraction):
        if time.perf_counter() - start_time > _DELAY:
            progress_bar.start()
        progress_bar.update(task_id, completed=fraction)

    try:
        yield show
    finally:
        progress_bar.stop()
