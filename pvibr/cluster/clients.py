"""The user's Dask client: jobs that it does, a few ahead, and what can be sent to its workers."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterable, Iterator
from itertools import islice
from pathlib import Path
from typing import Any

from pvibr.core.errors import PvibrError, require

#: Jobs that wait at each worker, besides the one that it does.
_AHEAD = 1
#: Names of errors of jobs whose workers died, again and again.
_LOST = 'KilledWorker', 'NoValidWorkerError'


class Cluster:
    """What pvibr asks of a Dask client."""

    def __init__(self, client):
        distributed = require('distributed', 'cluster', 'Clusters')
        if client is None:
            try:
                client = distributed.default_client()
            except ValueError:
                raise ValueError(
                    'client must be a distributed.Client, got None, and none is open: begin with '
                    'client = distributed.Client()'
                ) from None
        if not isinstance(client, distributed.Client):
            raise TypeError(
                f'client must be a distributed.Client, got {type(client).__name__}; '
                'Client(cluster) returns that of a cluster'
            )
        if client.asynchronous:
            raise ValueError('client must not be asynchronous, got asynchronous=True')
        if client.status != 'running':
            raise ValueError(f'client must be running, got one that is {client.status}')
        self.client = client
        self._config = require('dask', 'cluster', 'Clusters').config
        self._as_completed = distributed.as_completed
        self._cancelled = distributed.client.FutureCancelledError

    @property
    def worker_count(self) -> int:
        """Number of workers now, at least 1: others may come."""
        return max(1, len(self.client.scheduler_info(n_workers=-1)['workers']))

    def workers(self) -> list[str]:
        """Return the addresses of the workers that are there now."""
        return sorted(self.client.nthreads())

    def sent(self, name, value, remedy) -> bytes:
        """Return a value as it is sent to the workers; raise a TypeError if it cannot be."""
        from distributed.protocol.pickle import dumps

        try:
            return dumps(value)
        except Exception as error:
            reason = f'{type(error).__name__}: {error}'.partition('\n')[0]
            raise TypeError(f'{name} cannot be sent to workers ({reason}); {remedy}') from error

    def check_paths(self, name, values):
        """Raise a FileNotFoundError if a path among values is not there for each worker."""
        for path in (value for value in values if isinstance(value, Path)):
            found = self.client.run(_exists, str(path.absolute()))
            lacking = [worker for worker, is_there in found.items() if not is_there]
            if lacking:
                raise FileNotFoundError(
                    f'{name}: {str(path)!r} must be there for all workers, but is not for '
                    f'{lacking[0]}: copy it to them or to a folder that all share'
                )

    def results(
        self, function: Callable, jobs: Iterable[tuple], *shared: Any
    ) -> Iterator[tuple[tuple, Any]]:
        """Yield jobs and what a function of them and of shared values returns, as they are done.

        What a worker did when it died is done by another one.
        """
        sent = [self.submit(same, value) for value in shared]
        waiting, running = iter(jobs), {}
        done = self._as_completed()

        def submit(count):
            for job in islice(waiting, max(count, 0)):
                future = self.submit(function, *job, *sent)
                running[future.key] = future, job
                done.add(future)

        try:
            submit((1 + _AHEAD) * self.worker_count)
            while running:
                future = next(done)
                _, job = running[future.key]
                result = self._result(future, job)
                del running[future.key]
                submit((1 + _AHEAD) * self.worker_count - len(running))
                yield job, result
        finally:
            with contextlib.suppress(Exception):  # a cluster that is gone does nothing anyway
                self.client.cancel([future for future, _ in running.values()] + sent, force=True)

    def submit(self, function, *args, **options):
        """Submit a task whose result is not looked up by its arguments."""
        # Meshes go with their job, which is done again where it is lost: Dask warns of their size.
        with self._config.set({'distributed.admin.large-graph-warning-threshold': '1TiB'}):
            return self.client.submit(function, *args, pure=False, **options)

    def _result(self, future, job):
        try:
            return future.result()
        except self._cancelled as error:
            raise PvibrError(
                'the cluster no longer knows what it was asked for: its scheduler has gone'
            ) from error
        except Exception as error:
            if type(error).__name__ not in _LOST:
                raise
            raise PvibrError(
                f'{job}: its workers died again and again; they may lack memory: {error}'
            ) from error


def same(value):
    """Return a value: what a task returns is done again where it is lost."""
    return value


def _exists(path) -> bool:
    return Path(path).exists()
