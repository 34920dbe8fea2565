"""Named arrays of earlier runs, such as images and lighter meshes, kept on disk."""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
import re
import struct
import time
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

import filelock
import numpy as np
import platformdirs

from pvibr.core.errors import warn
from pvibr.core.files import replacing

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping

SUFFIX = '.atlas'
CAP_BYTES = 2 * 2**30
ABANDONED_SECONDS = 3600.0
#: Longest wait for another process, which may be suspended.
_LOCK_SECONDS = 120.0

_MAGIC = b'pvibrA01'
_HEAD = struct.Struct('<8s32s')
_LENGTH = struct.Struct('<Q')
_ALIGN = 64
_KEY = re.compile(r'[0-9a-f]{16,128}')

# What reading raises where a file holds other than it should, checksum or not.
_WRONG = (ArithmeticError, AttributeError, LookupError, MemoryError, TypeError, ValueError)
T = TypeVar('T')

# Folders that refused a write: said once, then left alone for as long as the process lives.
_given_up: set[Path] = set()


class Entry(dict[str, np.ndarray]):
    """The arrays of one entry by name, with metadata."""

    def __init__(self, arrays: Mapping[str, np.ndarray], meta: dict[str, object]) -> None:
        super().__init__(arrays)
        self.meta = meta


class AtlasCache:
    """A folder of entries, limited in size; the least recently used are removed first."""

    def __init__(
        self, path: str | os.PathLike[str] | None = None, cap_bytes: int = CAP_BYTES
    ) -> None:
        if cap_bytes < 0:
            raise ValueError(f'cap_bytes must be at least 0, got {cap_bytes}.')
        self.path = default_path() if path is None else Path(path).expanduser()
        self.cap_bytes = int(cap_bytes)

    def get(self, key: str) -> Entry | None:
        """Read one entry, and mark it as used."""
        file = self._file(key)
        try:
            raw = np.fromfile(file, np.uint8)
        except OSError:
            return None
        try:
            entry = unpack(raw)
        except _WRONG as error:
            _discard(file, error)
            return None
        with contextlib.suppress(OSError):
            os.utime(file)
        return entry

    def __contains__(self, key: str) -> bool:
        """Return True if there is such an entry."""
        return self._file(key).exists()

    def load(self, key: str, build: Callable[[Entry], T]) -> T | None:
        """Return what is built of an entry; None, and it is removed, where that fails."""
        entry = self.get(key)
        if entry is None:
            return None
        try:
            return build(entry)
        except _WRONG as error:
            _discard(self._file(key), error)
            return None

    def put(
        self, key: str, arrays: Mapping[str, np.ndarray], meta: dict[str, object] | None = None
    ) -> bool:
        """Write one entry atomically, then remove the oldest above the cap."""
        return self.put_packed(key, pack(arrays, meta or {}))

    def put_packed(self, key: str, chunks: list[bytes | memoryview]) -> bool:
        """Write one entry, the chunks of its file, as `put` does."""
        file = self._file(key)
        size = sum(len(chunk) for chunk in chunks)
        if size > self.cap_bytes or self.path in _given_up:
            return False
        try:
            self.path.mkdir(parents=True, exist_ok=True)
            # Room first: a disk may be full of what the cap lets go.
            self._make_room(size, keep=file)
            write_whole(file, chunks)
        except OSError as error:
            self._give_up(error)
            return False
        return True

    @contextlib.contextmanager
    def locked(self, key: str) -> Iterator[None]:
        """Let one process at a time make an entry; a folder that cannot be written has no lock."""
        lock = filelock.FileLock(self._file(key).with_name(f'.{key}.lock'), timeout=_LOCK_SECONDS)
        with contextlib.ExitStack() as stack:
            with contextlib.suppress(OSError):  # a timeout is one, too
                self.path.mkdir(parents=True, exist_ok=True)
                stack.enter_context(lock)
                # Those who wait for it look for the entry before they make it.
                stack.callback(_unlink, Path(lock.lock_file))
            yield

    def clear(self) -> None:
        """Remove every entry; leave the folder and any other file in it."""
        for file in self._entries():
            file.unlink(missing_ok=True)

    def nbytes(self) -> int:
        """Sum the sizes of all entries."""
        return sum(size for _, size, _ in self._ages())

    def _file(self, key: str) -> Path:
        # Only digits of a digest: no key can name a file outside the folder.
        if not isinstance(key, str) or not _KEY.fullmatch(key):
            raise ValueError(
                f'key must be 16 to 128 hexadecimal digits in lower case, got {key!r}.'
            )
        return self.path / f'{key}{SUFFIX}'

    def _entries(self) -> Iterator[Path]:
        return self.path.glob(f'[!.]*{SUFFIX}')

    def _ages(self) -> list[tuple[int, int, Path]]:
        """List last use (ns), size (bytes) and file of each entry, the oldest first."""
        ages = []
        for file in self._entries():
            # Another process may have removed it since the folder was listed.
            with contextlib.suppress(OSError):
                stat = file.stat()
                ages.append((stat.st_mtime_ns, stat.st_size, file))
        return sorted(ages)

    def _make_room(self, size: int, keep: Path) -> None:
        ages = [age for age in self._ages() if age[2] != keep]
        excess = sum(age[1] for age in ages) + size - self.cap_bytes
        for _, freed, file in ages:
            if excess <= 0:
                break
            file.unlink(missing_ok=True)
            excess -= freed
        self._sweep()

    def _sweep(self) -> None:
        """Remove temporary files of processes that were killed."""
        limit = time.time() - ABANDONED_SECONDS
        for file in self.path.glob(f'.*{SUFFIX}'):
            with contextlib.suppress(OSError):
                if file.stat().st_mtime < limit:
                    file.unlink()

    def _give_up(self, error: OSError) -> None:
        _given_up.add(self.path)
        warn(
            f'The atlas cache {str(self.path)!r} cannot be written ({error.strerror or error}); '
            'going on without it, so atlases are baked in every run. Free the disk, or set the '
            'environment variable PVIBR_CACHE to a folder that can be written.'
        )


def default_path() -> Path:
    """Return the folder of atlases: ``PVIBR_CACHE``, or the platform's own."""
    override = os.environ.get('PVIBR_CACHE')
    if override:
        return Path(override).expanduser()
    return platformdirs.user_cache_path('pvibr', appauthor=False)


def key_of(*values: object) -> str:
    """Digest arrays and settings by their content."""
    text = json.dumps(values, sort_keys=True, default=_digest)
    return hashlib.blake2b(text.encode(), digest_size=20).hexdigest()


def pack(arrays: Mapping[str, np.ndarray], meta: dict[str, object]) -> list[bytes | memoryview]:
    """Return arrays and metadata as the chunks of one file."""
    table: dict[str, tuple[str, tuple[int, ...], int]] = {}
    data: list[bytes | memoryview] = []
    end = 0
    for name, array in ((name, np.asarray(array)) for name, array in arrays.items()):
        content = _bytes_of(array, name)
        table[name] = (array.dtype.str, array.shape, end)
        data += [content, bytes(-len(content) % _ALIGN)]
        end += len(content) + len(data[-1])
    header = json.dumps({'arrays': table, 'meta': meta}).encode()
    header += b' ' * (-(_HEAD.size + _LENGTH.size + len(header)) % _ALIGN)
    checked = [_LENGTH.pack(len(header)), header, *data]
    digest = hashlib.sha256()
    for chunk in checked:
        digest.update(chunk)
    return [_HEAD.pack(_MAGIC, digest.digest()), *checked]


def unpack(raw: np.ndarray) -> Entry:
    """Read a file of :func:`pack`, its checksum verified."""
    buffer = raw.data
    if len(buffer) < _HEAD.size:
        raise ValueError('it is truncated')
    magic, digest = _HEAD.unpack_from(buffer)
    if magic != _MAGIC:
        raise ValueError('it is not an atlas of this version of pvibr')
    if hashlib.sha256(buffer[_HEAD.size :]).digest() != digest:
        raise ValueError('it is truncated or altered: its checksum differs')
    (length,) = _LENGTH.unpack_from(buffer, _HEAD.size)
    body = buffer[_HEAD.size + _LENGTH.size :]
    header = json.loads(bytes(body[:length]))
    table = header['arrays'].items()
    return Entry({name: _view(body[length:], *place) for name, place in table}, header['meta'])


def _bytes_of(array: np.ndarray, name: str) -> memoryview:
    if array.dtype.kind not in 'biufcUS':
        raise TypeError(
            f'{name} must hold numbers, booleans or text, got an array of {array.dtype}.'
        )
    return np.ascontiguousarray(array).reshape(-1).view(np.uint8).data


def _view(data: memoryview, dtype: str, shape: list[int], offset: int) -> np.ndarray:
    count = int(np.prod(shape, dtype=np.int64))
    return np.frombuffer(data, np.dtype(dtype), count, offset).reshape(shape)


def _digest(value: object) -> list:
    """Represent an array in JSON by type, shape and digest."""
    if not isinstance(value, (np.ndarray, np.generic)):
        raise TypeError(
            f'A key is made of arrays and of what JSON holds, got a {type(value).__name__}.'
        )
    array = np.asarray(value)
    content = hashlib.blake2b(_bytes_of(array, 'An array in a key'), digest_size=20)
    return ['ndarray', array.dtype.str, array.shape, content.hexdigest()]


def write_whole(file: Path, chunks: list[bytes | memoryview]) -> None:
    """Write a temporary file, then rename it: readers see all or nothing."""
    with replacing(file) as part, part.open('xb') as stream:
        stream.writelines(chunks)


def _unlink(file: Path) -> None:
    with contextlib.suppress(OSError):
        file.unlink(missing_ok=True)


def _discard(file: Path, error: Exception) -> None:
    _unlink(file)
    reason = str(error) if isinstance(error, ValueError) else f'its content is wrong ({error!r})'
    warn(f'Removed the cached atlas {str(file)!r}, because {reason}; it will be baked again.')
