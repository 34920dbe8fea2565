"""Bakes in the background: jobs that child processes do in turn."""

from __future__ import annotations

import atexit
import contextlib
import json
import os
import shutil
import tempfile
import threading
import time
import weakref
from collections.abc import Callable
from enum import Enum
from pathlib import Path
from typing import Any

from pvibr.core import _vtk
from pvibr.core.child_processes import ChildProcess, can_start
from pvibr.core.errors import warn
from pvibr.instances.bake_jobs import write_job
from pvibr.instances.cache import AtlasCache
from pvibr.instances.levels import BakePlan

#: Processes at once: each bake has steps that use one core, and llvmpipe uses all.
PROCESSES = max(1, min(4, (os.cpu_count() or 1) // 2))
_JOB_FILE = 'bake.job'


class State(Enum):
    """Where a job is."""

    WAITING = 'waiting'
    RUNNING = 'running'
    DONE = 'done'
    FAILED = 'failed'


class Job:
    """One bake: its state, and the folder of its result."""

    def __init__(self, plan: BakePlan):
        self.plan, self.state, self.fraction = plan, State.WAITING, 0.0
        #: Why it failed.
        self.failure = ''
        #: Pixels of the largest instance in view: larger ones are baked first.
        self.priority = 0.0
        self.started: float | None = None
        self.result: AtlasCache | None = None
        #: File of the lighter meshes, as soon as they are there.
        self.levels: Path | None = None
        self._warnings: list[str] = []
        self.folder = Path(tempfile.mkdtemp(prefix='pvibr-'))
        # The file and what is unwritten go with the last who waits for the job.
        self._cleaner = weakref.finalize(self, shutil.rmtree, self.folder, ignore_errors=True)

    @property
    def is_over(self) -> bool:
        """Whether it is done or has failed."""
        return self.state in (State.DONE, State.FAILED)

    @property
    def seconds_left(self) -> float | None:
        """Estimate of the seconds until it is done, None before it has got anywhere."""
        if self.started is None or self.fraction <= 0:
            return None
        return (time.perf_counter() - self.started) * (1 / self.fraction - 1)

    def hear(self, news: dict[str, Any]):
        """Take in what the child tells."""
        self.fraction = news.get('fraction', self.fraction)
        if 'warning' in news:
            self._warnings.append(news['warning'])
        if 'levels' in news:
            self.levels = Path(news['levels'])
        if 'failure' in news:
            self.fail(news['failure'])
        if 'folder' in news:
            self.result, self.state = AtlasCache(news['folder']), State.DONE

    def fail(self, failure):
        """Note that no result will come."""
        self.failure, self.state = failure, State.FAILED

    def pass_warnings_on(self):
        """Warn of what the child was warned of."""
        while self._warnings:
            warn(self._warnings.pop(0))


class _Child:
    """A process that does one job at a time."""

    def __init__(self):
        self._job: Callable[[], Job | None] = _no_job
        self.is_idle = True
        self._process = ChildProcess('pvibr.instances.bake_child')
        self._listener = threading.Thread(target=self._listen, daemon=True)
        self._listener.start()

    @property
    def job(self) -> Job | None:
        """The job that it does, None if it has none or nobody waits for it any more."""
        return None if self.is_idle else self._job()

    @property
    def has_ended(self) -> bool:
        """Whether the process has ended and all its news are in."""
        return not self._listener.is_alive()

    def begin(self, job):
        """Do a job."""
        path = job.folder / _JOB_FILE
        write_job(job.plan, path)
        self.is_idle, self._job = False, weakref.ref(job)
        job.state, job.started = State.RUNNING, time.perf_counter()
        with contextlib.suppress(OSError):  # a broken pipe: the listener notices
            self._process.stdin.write(f'{json.dumps(str(path))}\n'.encode())
            self._process.stdin.flush()

    def _listen(self):
        """Pass news on to the job until the process ends."""
        for line in self._process.stdout or ():
            job = self._job()
            with contextlib.suppress(ValueError, TypeError):
                if job is not None:
                    job.hear(json.loads(line))
            if job is not None and job.is_over:
                self.is_idle = True
            del job  # not while waiting for the next line
        job = self._job()
        if not self.is_idle and job is not None:
            job.fail(self._process.last_words())

    def end(self):
        """End the process, whatever it does."""
        self._process.end()


class BakeQueue:
    """The jobs of this process, and the children that do them."""

    def __init__(self, processes=PROCESSES):
        self._processes = processes
        self._jobs: weakref.WeakValueDictionary[tuple, Job] = weakref.WeakValueDictionary()
        self._children: list[_Child] = []
        self._pid = os.getpid()
        atexit.register(self.end)

    def job(self, plan: BakePlan) -> Job:
        """Return the job of a bake; all who ask for the same bake share it."""
        folder = plan.cache and plan.cache.path
        job = self._jobs.get((plan.key, folder))
        if job is None or job.state is State.FAILED:
            job = self._jobs[plan.key, folder] = Job(plan)
        return job

    def poll(self):
        """Begin what waits, the largest on the screen first; end children without work."""
        if self._pid != os.getpid():  # children of the process that this was forked from
            self._children, self._pid = [], os.getpid()
        for child in [c for c in self._children if c.has_ended or _is_orphan(c)]:
            child.end()
            self._children.remove(child)
        waiting = [job for job in self._jobs.values() if job.state is State.WAITING]
        for job in sorted(waiting, key=lambda job: -job.priority):
            idle_child = self._idle_child()
            if idle_child is None:
                break
            self._begin(idle_child, job)
        if not waiting:
            for child in [c for c in self._children if c.is_idle]:
                child.end()
                self._children.remove(child)

    def _idle_child(self) -> _Child | None:
        for child in self._children:
            if child.is_idle:
                return child
        if len(self._children) == self._processes:
            return None
        try:
            self._children.append(_Child())
        except OSError as error:
            for job in self._jobs.values():
                if job.state is State.WAITING:
                    job.fail(f'no process can be started: {error}')
            return None
        return self._children[-1]

    @staticmethod
    def _begin(child, job):
        try:
            child.begin(job)
        except OSError as error:
            job.fail(f'its file cannot be written: {error.strerror or error}')

    def end(self):
        """End all children."""
        if self._pid == os.getpid():
            while self._children:
                self._children.pop().end()


def _no_job() -> None:
    """Return the job of a child that never had one."""


def _is_orphan(child) -> bool:
    """Return True if a child does what nobody waits for any more."""
    return not child.is_idle and child.job is None


def can_run() -> bool:
    """Return True if another Python can be started here, and VTK can write down actors."""
    return can_start() and hasattr(_vtk, 'vtkObjectManager')


QUEUE = BakeQueue()
