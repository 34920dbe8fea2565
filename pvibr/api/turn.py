"""One frame on its way through a pipeline."""

from __future__ import annotations

import time
from collections.abc import Callable

from pvibr.core.counts import TOTAL
from pvibr.core.errors import warn
from pvibr.things.frame import Frame


class Turn:
    """One frame on its way through a pipeline, with what went wrong in it."""

    def __init__(self, frame):
        self.images: list = []
        self.failures: list[str] = []
        self.begun: Frame | None = None
        self.camera = None  # once all is prepared for it
        self.counts = TOTAL.so_far()
        self.take(frame)

    def take(self, frame):
        """Switch to a frame, unless it is None."""
        if frame is not None and frame is not self.begun:
            self.begun = frame
            self.drawn, self.frame = (frame, frame) if frame.picking else frame.within_passes()

    def put_camera_back(self):
        """Let the renderer have the user's camera again, after a sample."""
        sample = self.frame.sample
        if sample is not None:
            self.frame.renderer.SetActiveCamera(sample.camera)

    def guard(self, entries, hook: Callable, *args):
        """Call a hook; an error must not reach VTK's loop: it disables the effects involved."""
        start = time.perf_counter()
        try:
            return hook(*args)
        except Exception as error:  # noqa: BLE001, RUF100
            for entry in entries:
                self._fail(entry, error)
            return None
        finally:
            entries[0].row.ms += 1e3 * (time.perf_counter() - start)

    def _fail(self, entry, error):
        entry.effect.enabled = False
        entry.stop('off', f'{type(error).__name__}: {error}')
        why = entry.row.why.rstrip('.')
        self.failures.append(
            f'{entry.effect.name} is off, the picture is drawn without it: {why}. '
            'Mend the cause, then set its enabled = True, or remove it.'
        )

    def warn(self):
        """Say what went wrong, once; last, since a filter may turn a warning into an error."""
        if self.failures:
            warn('\n'.join(self.failures))
