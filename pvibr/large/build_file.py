"""Files of hierarchies, built out of core in a folder beside them, from which a build goes on."""

from __future__ import annotations

import contextlib
import errno
import shutil
from collections.abc import Iterator
from pathlib import Path

import filelock

from pvibr.core.arguments import checked_number
from pvibr.core.errors import warn
from pvibr.core.files import existing, in_a_folder, naming_file, with_suffix
from pvibr.core.progress import baking
from pvibr.instances.cache import key_of
from pvibr.large.build import Builder
from pvibr.large.checked_file import open_checked, write_checked
from pvibr.large.columns import Columns
from pvibr.large.pieces import digest_of, source_in_pieces
from pvibr.large.sources import Source, source_of
from pvibr.large.stored import SUFFIX, VERSION, arrays_of, hierarchy_key, meta_of
from pvibr.large.workers import worker_count

#: Memory of a build by default, GB.
MEMORY = 2.0
#: Of it, what Python and its modules take, and what each process takes for a block, bytes.
_BASE_BYTES, _WORKER_BYTES = 250e6, 150e6
#: Share of the memory from which it is told that a file is read whole.
_WHOLE_SHARE = 0.25
_WORK_SUFFIX = '.build'


def write_large(mesh, path, progress=None, workers=None, memory=None) -> Path:
    """Build the hierarchy of a mesh or of a file of one, and write it to a file."""
    path = in_a_folder('path', with_suffix(path, SUFFIX))
    memory_bytes = 1e9 * checked_number('memory', MEMORY if memory is None else memory, 0.5)
    workers = worker_count(workers)
    source, key = _source_and_key(mesh, memory_bytes)
    with _locked(path):
        if _key_of(path) != key:
            with naming_file(mesh):
                _build(source, path, key, progress, workers, memory_bytes)
    return path


def _source_and_key(mesh, memory_bytes) -> tuple[Source, str]:
    """Return the triangles of a mesh or a file, in pieces where that is possible, and a digest."""
    if isinstance(mesh, str | Path):
        file = existing(mesh, 'mesh file')
        source = source_in_pieces(file)
        if source is not None:
            return source, key_of(VERSION, digest_of(file))
        if file.stat().st_size > _WHOLE_SHARE * memory_bytes:
            warn(
                f'{str(mesh)!r} is read whole: only binary PLY of triangles, binary STL and '
                'GeoTIFF are read in pieces'
            )
    source = source_of(mesh)
    arrays = arrays_of(source).values()
    return source, key_of(hierarchy_key(source.mesh), meta_of(source), *arrays)


def _build(source, path, key, progress, workers, memory_bytes):
    folder = path.with_name(path.name + _WORK_SUFFIX)
    with _explained(path, folder):
        # What was begun for another mesh is of no use.
        for other in [o for o in folder.glob('*') if o.name != key]:
            shutil.rmtree(other)
        (folder / key).mkdir(parents=True, exist_ok=True)
        with baking(progress, 'Building the hierarchy of a large mesh') as advance:
            columns = Columns(folder / key, lambda: advance(None))
            fitting = max(int((memory_bytes - _BASE_BYTES) / 2 / _WORKER_BYTES), 1)
            builder = Builder(columns, advance, min(workers, fitting), memory_bytes / 2)
            try:
                arrays = builder.build(source.mesh)
                # Of corners, the points are those that were merged.
                count = source.point_count or columns.length('base.points')
                meta = meta_of(source) | {'point_count': count, 'key': key}
                parts = {name: [values] for name, values in arrays_of(source).items()}
                write_checked(path, arrays | parts, meta)
            except ValueError:  # the mesh cannot be built at all
                columns.close()
                shutil.rmtree(folder, ignore_errors=True)
                raise
            finally:
                columns.close()
    shutil.rmtree(folder, ignore_errors=True)


def _key_of(path) -> str | None:
    """Return the key of the mesh of a file that is there, None where it is damaged."""
    with contextlib.suppress(OSError, ValueError, LookupError, TypeError):
        return str(open_checked(path).meta['key'])
    return None


@contextlib.contextmanager
def _locked(path) -> Iterator[None]:
    """Let one process at a time build a file."""
    lock = filelock.FileLock(path.with_name(f'.{path.name}.lock'))
    with lock:
        try:
            yield
        finally:
            # Those who wait for it look for the file before they build it.
            with contextlib.suppress(OSError):
                Path(lock.lock_file).unlink(missing_ok=True)


@contextlib.contextmanager
def _explained(path, folder) -> Iterator[None]:
    """Say what remains where a disk is full."""
    try:
        yield
    except OSError as error:
        if error.errno != errno.ENOSPC:
            raise
        raise OSError(
            error.errno,
            f'cannot write {path}: the disk is full; what was built is kept in {folder}, and the '
            'same call goes on from there once there is room',
        ) from error
