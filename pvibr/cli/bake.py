"""``pvibr bake``: images of meshes, before they are needed."""

from __future__ import annotations

import sys
import time
from contextlib import contextmanager
from pathlib import Path

from pvibr.core.errors import PvibrError
from pvibr.instances import bake_queue
from pvibr.instances.bake_queue import Job, State
from pvibr.instances.levels import BakePlan, bake, plan_of
from pvibr.meshes.parts import as_parts

_POLL_SECONDS = 0.05


def save_atlas(mesh, out, sheet, looks):
    """Bake one mesh, and write its images to files."""
    atlas = bake(as_parts(mesh, **looks))
    if out is not None:
        atlas.save(out)
        size = out.stat().st_size
        print(f'wrote {out}: {atlas.views**2} views of {mesh}, {size / 1e6:.1f} MB')
    if sheet is not None:
        atlas.contact_sheet(sheet)
        print(f'wrote {sheet}')


def fill_cache(meshes, processes, looks) -> bool:
    """Bake meshes into the cache, several at a time; return True if all are there."""
    waiting, is_complete = list(meshes), True
    jobs: dict[Path, Job] = {}
    queue = bake_queue.BakeQueue(processes)
    with _ending(queue):
        while waiting or jobs:
            while waiting and len(jobs) < processes:
                mesh = waiting.pop(0)
                job = _job_of(queue, mesh, looks)
                if isinstance(job, Job):
                    jobs[mesh] = job
                else:
                    is_complete &= job
            queue.poll()
            for mesh, job in [(mesh, job) for mesh, job in jobs.items() if job.is_over]:
                del jobs[mesh]
                is_complete &= _say(mesh, job)
            time.sleep(_POLL_SECONDS)
    return is_complete


@contextmanager
def _ending(queue):
    try:
        yield
    finally:
        queue.end()


def _job_of(queue, mesh, looks) -> Job | bool:
    """Return the bake of a mesh, True if there is nothing to bake, False if it cannot be read."""
    try:
        plan = plan_of(as_parts(mesh, **looks))
    except (OSError, ValueError, ImportError, PvibrError) as error:
        print(f'{mesh}: {error}', file=sys.stderr)
        return False
    if isinstance(plan, BakePlan):
        return queue.job(plan)
    print(f'{mesh}: {plan.why_unbaked or "in the cache already"}')
    return not plan.why_unbaked


def _say(mesh: Path, job: Job) -> bool:
    job.pass_warnings_on()
    if job.state is State.DONE and job.plan.cache is not None and job.plan.key in job.plan.cache:
        print(f'{mesh}: baked in {time.perf_counter() - (job.started or 0):.1f} s')
        return True
    why = job.failure or 'the cache cannot be written'
    print(f'{mesh}: not baked: {why}', file=sys.stderr)
    return False
