"""The process that bakes while its parent draws: jobs come in by stdin, news go out by stdout."""

from __future__ import annotations

import contextlib
import io
import json
import os
import queue
import threading
import warnings
from pathlib import Path

from pvibr.core.child_processes import NICENESS, pipes_of_child

_PATIENCE = 30.0  # seconds without a job, after which it ends


def main():
    """Do the jobs whose paths the parent writes, a line each; end with the parent."""
    source, target = pipes_of_child(NICENESS)
    news = io.TextIOWrapper(target, encoding='utf-8')
    jobs: queue.SimpleQueue = queue.SimpleQueue()
    threading.Thread(target=_listen, args=(source, jobs), daemon=True).start()
    with contextlib.suppress(queue.Empty):
        while True:
            _do(jobs.get(timeout=_PATIENCE), news)


def _listen(source, jobs):
    for line in source:
        jobs.put(Path(json.loads(line)))
    os._exit(0)  # the parent is gone, or no longer needs what is being done


def _do(path, news):
    from pvibr.instances.bake_jobs import do_job

    def tell(**values):
        print(json.dumps(values), file=news, flush=True)

    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter('always')
        try:
            folder = do_job(
                path,
                lambda fraction: tell(fraction=fraction),
                lambda levels_path: tell(levels=str(levels_path)),
            )
        except Exception as error:
            tell(failure=f'{type(error).__name__}: {error}')
            return
    for warning in caught:
        tell(warning=str(warning.message))
    tell(folder=str(folder))
