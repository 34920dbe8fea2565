"""Build a hierarchy in another process, and before it a draft that is finer than the first."""

from __future__ import annotations

import contextlib
import pickle
import threading
import weakref
from typing import Any

import numpy as np

from pvibr.core.child_processes import (
    NICENESS,
    ChildProcess,
    end_with_parent,
    pipes_of_child,
    send,
)
from pvibr.core.errors import warn
from pvibr.instances.cache import AtlasCache
from pvibr.large.build import TriangleMesh, build_hierarchy
from pvibr.large.draft import FIRST_POINTS, NEXT_POINTS, build_draft
from pvibr.large.hierarchy import Hierarchy
from pvibr.large.stored import built
from pvibr.large.workers import worker_count


class BuildJob:
    """A process that builds the hierarchy of a mesh, and puts it into the cache."""

    def __init__(self, mesh: TriangleMesh, key: str, cache: AtlasCache | None):
        # The mesh as it is now, of which the key is.
        arrays: dict[str, Any] = {
            name: np.array(array) if isinstance(array, np.ndarray) else array
            for name, array in vars(mesh).items()
        }
        self._job = TriangleMesh(**arrays), key, cache
        self._work: _Work | None = None

    def start(self):
        """Start the process, once."""
        if self._work is None:
            self._work = _Work(self._job)
            self._cleaner = weakref.finalize(self, self._work.end)

    @property
    def is_over(self) -> bool:
        """Whether the process has ended, or could not be started."""
        return self._work is not None and self._work.is_over

    def wait(self, timeout=None) -> bool:
        """Wait for the end; return False if the time was too short."""
        self.start()
        return self._work is None or self._work.wait(timeout)

    @property
    def has_news(self) -> bool:
        """Whether `newest` returns something."""
        return self._work is not None and (self.is_over or self._work.draft is not None)

    def newest(self, name) -> Hierarchy | None:
        """Return the hierarchy of what has a name; before it is there a finer draft, once."""
        if self._work is None:
            return None
        if not self.is_over:
            draft, self._work.draft = self._work.draft, None
            return draft
        if self._work.hierarchy is None:
            warn(
                f'{name}: the process that builds its hierarchy failed ({self._work.failure}); '
                'it is built here instead'
            )
            return built(self._job[0], None)
        return self._work.hierarchy

    def stop(self):
        """End the process; it may be started again."""
        if self._work is not None:
            self._cleaner.detach()
            self._work.end()
            self._work = None


class _Work:
    """A process, and the thread that talks to it."""

    def __init__(self, job):
        self.hierarchy: Hierarchy | None = None
        #: What may be drawn until then, and was not taken yet.
        self.draft: Hierarchy | None = None
        #: Why there is none.
        self.failure = ''
        self.child: ChildProcess | None = None
        try:
            self.child = ChildProcess(__name__)
        except OSError as error:
            self.failure = str(error)
            return
        self._thread = threading.Thread(target=self._talk, args=[job], daemon=True)
        self._thread.start()

    def _talk(self, job):
        child: Any = self.child
        try:
            is_draft, arrays = child.ask(job)
            if is_draft:
                self.draft = Hierarchy(**arrays)
                _, arrays = child.answer()
            self.hierarchy, self.draft = Hierarchy(**arrays), None
        except (RuntimeError, TypeError) as error:
            self.failure = str(error)

    @property
    def is_over(self) -> bool:
        """Whether there is a result, or a failure."""
        return self.child is None or not self._thread.is_alive()

    def wait(self, timeout) -> bool:
        """Wait for the end; return False if the time was too short."""
        if self.child is not None:
            self._thread.join(timeout)
        return self.is_over

    def end(self):
        """End the process, whatever it does."""
        if self.child is not None:
            self.child.end()
            self._thread.join()


def main():
    """Build the hierarchy of the mesh that the parent writes: the child's program."""
    source, target = pipes_of_child(NICENESS)
    with contextlib.suppress(EOFError, BrokenPipeError):
        mesh, key, cache = pickle.load(source)  # noqa: S301 - from our parent
        end_with_parent()
        hierarchy = None if cache is None else cache.load(key, Hierarchy.of_arrays)
        if hierarchy is None:
            if len(mesh.points) > FIRST_POINTS:  # which are in the first draft
                send((True, build_draft(mesh, NEXT_POINTS).to_arrays()), target)
            hierarchy = build_hierarchy(mesh, workers=worker_count(None))
            if cache is not None:
                cache.put(key, hierarchy.to_arrays())
        send((False, hierarchy.to_arrays()), target)
