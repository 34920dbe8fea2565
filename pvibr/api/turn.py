"""One frame on its way through a pipeline, and what went wrong in it."""

from __future__ import annotations

import time
from collections.abc import Callable

from pvibr.core.counts import TOTAL
from pvibr.core.effect import switch_off
from pvibr.core.errors import ShaderError, warn
from pvibr.gl.feature import FeatureSet, has_text
from pvibr.gl.refused_shaders import REFUSED
from pvibr.things.frame import Frame
from pvibr.things.thing import Thing


class Turn:
    """One frame on its way through a pipeline, with what went wrong in it."""

    def __init__(self, frame, thread):
        if not thread.has_drawn:
            thread.begin()
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
            found = hook(*args)
            if REFUSED:
                self._refuse(entries)
            return found
        except Exception as error:  # noqa: BLE001, RUF100
            for entry in entries:
                self.fail(entry, error)
            return None
        finally:
            entries[0].row.ms += 1e3 * (time.perf_counter() - start)

    def fail(self, entry, error):
        """Disable the effect that raised an error."""
        self.failures.append(switch_off(entry.effect, error))
        entry.stop('off', f'{type(error).__name__}: {error}')

    def warn(self):
        """Say what went wrong, once; last, since a filter may turn a warning into an error."""
        if self.failures:
            warn('\n'.join(self.failures))

    def _refuse(self, entries):
        """Disable effects whose hook drew with shaders that do not compile; things see to it."""
        error = _error_of(*next(iter(REFUSED.items())))
        REFUSED.clear()
        for entry in entries:
            if not isinstance(entry.effect, Thing):
                self.fail(entry, error)

    def blame(self, refused, entries):
        """Disable the effects of features, each with the driver's log, that do not compile."""
        for name, log in refused:
            running = [e for e in entries if e.running]
            drawing = [e for e in running if _draws_by(e.effect, name)]
            for entry in drawing or [e for e in running if e.effect.surfaces]:
                if not entry.effect.mends_shaders:
                    self.fail(entry, _error_of(name, log))


def _error_of(name, log) -> ShaderError:
    return ShaderError(f'shader {name!r} does not compile: {log.splitlines()[0]}', log)


def _draws_by(effect, name) -> bool:
    """Return whether an effect has put the text of a feature on actors."""
    sets = [value for value in vars(effect).values() if isinstance(value, FeatureSet)]
    if any(features.has(name) for features in sets):
        return True
    actors = effect.shader_actors() if isinstance(effect, Thing) else effect.props
    return any(has_text(actor, name) for actor in actors if actor.IsA('vtkActor'))
