"""Processes that simplify blocks: the simplifier has global variables, so threads cannot."""

from __future__ import annotations

import contextlib
import os
import pickle
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor

from pvibr.core.arguments import checked_number
from pvibr.core.child_processes import ChildProcess, can_start, pipes_of_child, send
from pvibr.large.block import Block, SimplifiedBlock, simplified_block

#: Blocks beyond those being simplified that are held in memory, read or done.
_WAITING = 1
#: Processes at most, unless asked for: more wait for what this one reads and writes.
_MOST = 8
#: Blocks from which processes are worth their start.
_WORTHWHILE = 4


class Workers:
    """A number of processes; none where one is enough, which is then this one."""

    def __init__(self, count: int):
        self._count = count
        self._idle: deque[ChildProcess] = deque()
        self._all: list[ChildProcess] = []

    def __enter__(self) -> Workers:
        """Return these."""
        return self

    def __exit__(self, *error):
        """End all processes."""
        self._end()

    def _end(self):
        while self._all:
            self._all.pop().end()

    def simplified(self, loads: Iterable[Callable[[], Block]]) -> Iterator[SimplifiedBlock]:
        """Yield blocks simplified, in order, each read only when its turn comes."""
        loads = list(loads)
        if self._count < 2 or len(loads) < (2 if self._all else _WORTHWHILE):
            yield from (simplified_block(load()) for load in loads)
            return
        futures: deque[Future] = deque()
        threads = ThreadPoolExecutor(self._count)
        try:
            for load in loads:
                futures.append(threads.submit(self._simplify, load))
                if len(futures) > self._count + _WAITING:
                    yield futures.popleft().result()
            while futures:
                yield futures.popleft().result()
        except BaseException:
            self._end()  # which ends what the threads wait for
            raise
        finally:
            threads.shutdown(cancel_futures=True)

    def _simplify(self, load) -> SimplifiedBlock:
        block = load()
        try:
            child = self._idle.pop()
        except IndexError:
            child = ChildProcess(__name__)
            self._all.append(child)
        try:
            result = child.ask(block)
        except RuntimeError as error:
            raise RuntimeError(f'a block cannot be simplified: {error}') from error
        if isinstance(result, Exception):
            raise result
        self._idle.append(child)
        return result


def worker_count(workers) -> int:
    """Return the number of processes that an argument asks for, by default one per core."""
    if workers is not None:
        workers = int(checked_number('workers', workers, 1))
    elif hasattr(os, 'sched_getaffinity'):
        workers = min(len(os.sched_getaffinity(0)), _MOST)
    else:
        workers = min(os.cpu_count() or 1, _MOST)
    return workers if can_start() else 1


def main():
    """Simplify the blocks that the parent writes, until it is gone."""
    source, target = pipes_of_child()
    with contextlib.suppress(EOFError, BrokenPipeError):
        while True:
            block = pickle.load(source)  # noqa: S301 - from our parent
            result: SimplifiedBlock | Exception
            try:
                result = simplified_block(block)
            except Exception as error:
                result = error
            send(result, target)
