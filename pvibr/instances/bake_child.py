"""The process that bakes while its parent draws: jobs come in by stdin, news go out by stdout."""

from __future__ import annotations

import contextlib
import json
import os
import queue
import sys
import threading
import warnings
from pathlib import Path

#: Frames of the parent come first: a tenth longer where these take all processors.
_NICENESS = 12
_PATIENCE = 30.0  # seconds without a job, after which it ends


def main():
    """Do the jobs whose paths the parent writes, a line each; end with the parent."""
    news = os.fdopen(os.dup(1), 'w', encoding='utf-8')
    os.dup2(2, 1)  # what libraries print is no news
    if hasattr(os, 'nice'):
        os.nice(_NICENESS)
    jobs: queue.SimpleQueue = queue.SimpleQueue()
    threading.Thread(target=_listen, args=(jobs,), daemon=True).start()
    with contextlib.suppress(queue.Empty):
        while True:
            _do(jobs.get(timeout=_PATIENCE), news)


def _listen(jobs):
    for line in sys.stdin:
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
