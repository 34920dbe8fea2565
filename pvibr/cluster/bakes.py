"""Images and lighter meshes of many meshes, made by the workers of a Dask cluster."""

from __future__ import annotations

import tempfile
import time
import uuid
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pyvista as pv

from pvibr.cluster import stages
from pvibr.cluster.clients import Cluster
from pvibr.core.params import checked_flag
from pvibr.core.progress import baking
from pvibr.instances.bake_jobs import do_job, packed_job
from pvibr.instances.cache import SUFFIX, AtlasCache, pack
from pvibr.instances.levels import BakePlan, plan_of
from pvibr.large.build import build_hierarchy
from pvibr.large.sources import checked_texture, source_of
from pvibr.large.stored import cache_of, hierarchy_key
from pvibr.meshes.parts import as_parts

#: How names of files begin that tell whether a worker sees a folder.
_PROBE = '.probe-'


class Baked(NamedTuple):
    """What became of a mesh."""

    #: ``'baked'``, ``'in the cache'`` or ``'not baked'``.
    state: str
    #: Seconds of the worker.
    seconds: float = 0.0
    #: Why it was not baked.
    why: str = ''


def bake(meshes, *, client=None, large=False, cache=True, progress=None, **look) -> list[Baked]:
    """Bake images and lighter meshes of many meshes on a Dask cluster, into the cache.

    Plotters then find them in the cache of this process: see :meth:`plotter.ibr.add_instances`.
    Workers that see its folder write there; others return what they made. Equal meshes are baked
    once.

    Parameters
    ----------
    meshes : sequence of mesh or path
        Meshes as :meth:`plotter.ibr.add_instances` takes them.
    client : distributed.Client, optional
        The cluster, by default the client that is open.
    large : bool
        Build the hierarchies of :meth:`plotter.ibr.add_large_mesh` instead, for meshes without
        ``texture=``.
    cache : bool or path
        The folder of the cache, by default that of the user.
    progress : bool, optional
        Show a progress bar; by default in terminals and notebooks.
    **look
        As of :meth:`plotter.ibr.add_instances`: images depend on how meshes look.

    Returns
    -------
    list of tuple
        ``(state, seconds, why)`` of each mesh: ``'baked'``, ``'in the cache'`` or ``'not baked'``,
        the seconds that a worker needed, and why it was not baked.

    Raises
    ------
    TypeError, ValueError
        If an argument is invalid.
    OSError
        If a file cannot be read, or the cache cannot be written.
    ImportError
        If the extra ``cluster`` is not installed.

    Examples
    --------
    >>> import tempfile
    >>> import pyvista as pv
    >>> import pvibr.cluster
    >>> from distributed import Client
    >>> ball = pv.Sphere(theta_resolution=100, phi_resolution=100)
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     with Client(processes=False, n_workers=1, dashboard_address=':0') as client:
    ...         baked = pvibr.cluster.bake([ball, ball], client=client, large=True, cache=folder)
    >>> [one.state for one in baked]
    ['baked', 'baked']
    """
    cluster = Cluster(client)
    if checked_flag('large', large) and look:
        raise TypeError(f'large meshes are built without a look, got {", ".join(look)}')
    if isinstance(meshes, (str, Path, pv.DataObject)) or not np.iterable(meshes):
        raise TypeError(f'meshes must be a sequence of meshes or paths, got {meshes!r:.80}')
    store = _cache_of(cache)
    plan = partial(_large_plan, store) if large else partial(_plan, store, look)
    plans = [plan(mesh) for mesh in meshes]
    jobs = {job.key: job for job in plans if isinstance(job, _Job)}
    done: dict[str, Baked] = {}
    with baking(progress, 'Baking on the cluster') as advance, _probe(store) as probe:
        work = ((job.work, key, job.made()) for key, job in jobs.items())
        for (_, key, _), result in cluster.results(_do, work, (str(store.path), probe)):
            done[key] = _kept(store, key, *result)
            advance(len(done) / len(jobs))
    return [done[one.key] if isinstance(one, _Job) else one for one in plans]


def _cache_of(cache) -> AtlasCache:
    store = cache_of(cache)
    if store is None:
        raise ValueError('cache must be True or a folder, got False: what is baked goes there')
    return store


class _Job(NamedTuple):
    """What one worker does: `work` of what `made` returns, and of a folder."""

    key: str
    work: Callable[[Any, Path], bytes]
    made: Callable[[], Any]


def _plan(store, look, mesh) -> _Job | Baked:
    plan = plan_of(as_parts(mesh, **look), cache=store.path)
    if not isinstance(plan, BakePlan):
        why = plan.why_unbaked
        return Baked('not baked', why=why) if why else Baked('in the cache')
    # Workers have a cache of their own; what they made goes into the one that was asked for.
    job = replace(plan, cache=None)
    return _Job(plan.key, _bake, lambda: b''.join(packed_job(job)))


def _large_plan(store, mesh) -> _Job | Baked:
    triangles = checked_texture(source_of(mesh), False).mesh
    key = hierarchy_key(triangles)
    return Baked('in the cache') if key in store else _Job(key, _build, lambda: triangles)


def _kept(store, key, seconds, data, why) -> Baked:
    """Keep what a worker returned, if it could not write it itself."""
    if data is not None and not store.put_packed(key, [data]):
        why = f'the cache {str(store.path)!r} cannot be written, or is too small'
    return Baked('not baked' if why else 'baked', seconds, why)


@contextmanager
def _probe(store) -> Iterator[str]:
    """Yield the name of a file in the folder of the cache: who sees it can write there, too."""
    store.path.mkdir(parents=True, exist_ok=True)
    probe = store.path / f'{_PROBE}{uuid.uuid4().hex}'
    probe.touch()
    try:
        yield probe.name
    finally:
        probe.unlink(missing_ok=True)


def _do(work, key, job, shared) -> tuple[float, bytes | None, str]:
    """Do a job on a worker: return its seconds, the result if it is not in the cache, and why."""
    folder, probe = shared
    start = time.perf_counter()
    store = AtlasCache(folder) if (Path(folder) / probe).exists() else None
    if store is not None and key in store:  # another worker, before it died
        return 0.0, None, ''
    try:
        with tempfile.TemporaryDirectory(prefix='pvibr-') as own:
            data = stages.drawing(work, job, Path(own))
    except Exception as error:
        return time.perf_counter() - start, None, f'{type(error).__name__}: {error}'
    is_kept = store is not None and store.put_packed(key, [data])
    return time.perf_counter() - start, None if is_kept else data, ''


def _bake(job, folder) -> bytes:
    file = folder / 'bake.job'
    file.write_bytes(job)
    do_job(file, lambda fraction: None)
    return next(folder.glob(f'*{SUFFIX}')).read_bytes()


def _build(mesh, _folder) -> bytes:
    return b''.join(pack(build_hierarchy(mesh).to_arrays(), {}))
