"""Build a hierarchy in another process, while a draft is drawn."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tempfile
import threading
import weakref
from dataclasses import fields
from pathlib import Path

import numpy as np

from pvibr.instances.cache import AtlasCache
from pvibr.large.build import TriangleMesh, build_hierarchy
from pvibr.large.hierarchy import Hierarchy

_NAMES = tuple(field.name for field in fields(TriangleMesh))
_STDERR_BYTES = 2000
# Ctrl+C is for the parent, which decides.
_PROGRAM = (
    'import signal, sys; signal.signal(signal.SIGINT, signal.SIG_IGN); sys.path[:] = {path!r}; '
    'from pvibr.large.build_job import main; main({folder!r}, {cache!r}, {key!r})'
)


class BuildJob:
    """A process that builds the hierarchy of a mesh, into the cache or a folder of its own."""

    def __init__(self, mesh: TriangleMesh, key: str, cache: AtlasCache | None):
        self._key, self._cache = key, cache
        #: Why there is no process.
        self._failure = ''
        #: The process, once it was started; shared with the cleaner.
        self._processes: list[subprocess.Popen] = []
        self._folder = Path()
        try:
            self._folder = Path(tempfile.mkdtemp(prefix='pvibr-'))
            self._cleaner = weakref.finalize(self, _clean, self._processes, self._folder)
            # The mesh as it is now, of which the key is.
            for name in _NAMES:
                if getattr(mesh, name) is not None:
                    np.save(self._folder / f'{name}.npy', getattr(mesh, name))
        except OSError as error:
            self._failure = str(error)

    def start(self):
        """Start the process, once."""
        if self._processes or self._failure:
            return
        try:
            self._processes.append(self._started())
        except OSError as error:
            self._failure = str(error)

    def _started(self) -> subprocess.Popen:
        cache = None if self._cache is None else str(self._cache.path)
        program = _PROGRAM.format(
            path=sys.path, folder=str(self._folder), cache=cache, key=self._key
        )
        with (self._folder / 'stderr').open('wb') as stderr:
            return subprocess.Popen(
                [sys.executable, '-c', program],
                stdin=subprocess.PIPE,
                stdout=subprocess.DEVNULL,
                stderr=stderr,
                creationflags=getattr(subprocess, 'CREATE_NO_WINDOW', 0),
            )

    @property
    def is_over(self) -> bool:
        """Whether the process has ended, or could not be started."""
        if self._failure:
            return True
        return any(process.poll() is not None for process in self._processes)

    def wait(self, timeout=None) -> bool:
        """Wait for the end; return False if the time was too short."""
        self.start()
        try:
            for process in self._processes:
                process.wait(timeout)
        except subprocess.TimeoutExpired:
            return False
        return True

    def result(self) -> Hierarchy:
        """Return the hierarchy; raise a RuntimeError if there is none."""
        if self._failure:
            raise RuntimeError(self._failure)
        for cache in filter(None, (self._cache, AtlasCache(self._folder))):
            found = cache.load(self._key, Hierarchy.of_arrays)
            if found is not None:
                return found
        last_words = (self._folder / 'stderr').read_bytes()[-_STDERR_BYTES:]
        lines = last_words.decode('utf-8', 'replace').strip().splitlines()
        raise RuntimeError(lines[-1] if lines else 'the process ended without a result')

    def stop(self):
        """End the process; it may be started again."""
        _end(self._processes)


def _end(processes):
    while processes:
        with processes.pop() as process:
            process.kill()


def _clean(processes, folder):
    _end(processes)
    shutil.rmtree(folder, ignore_errors=True)


def main(folder, cache_path, key):
    """Build the hierarchy of the arrays in a folder: the child's program."""
    folder = Path(folder)
    threading.Thread(target=_end_with_parent, args=[folder], daemon=True).start()
    files = {name: folder / f'{name}.npy' for name in _NAMES}
    mesh = TriangleMesh(**{name: np.load(file) for name, file in files.items() if file.exists()})
    cache = None if cache_path is None else AtlasCache(cache_path)
    hierarchy = None if cache is None else cache.load(key, Hierarchy.of_arrays)
    if hierarchy is not None:
        return
    arrays = build_hierarchy(mesh).to_arrays()
    if cache is None or not cache.put(key, arrays):
        # Too large for the cache: for this run alone.
        AtlasCache(folder, sys.maxsize).put(key, arrays)


def _end_with_parent(folder):
    """End this process when its parent was killed, which closes the pipe to it."""
    os.read(0, 1)
    shutil.rmtree(folder, ignore_errors=True)
    os._exit(1)
