"""Files that are written completely or not at all."""

from __future__ import annotations

import contextlib
import errno
import os
import uuid
from collections.abc import Iterator
from pathlib import Path

from pvibr.core.arguments import naming
from pvibr.core.errors import PvibrError


def _as_path(path):
    with naming('path', path):
        return Path(path).expanduser()


#: Bytes of a file that tell whether it stands in for another.
HEAD_BYTES = 512
_LFS = b'version https://git-lfs.github.com/spec/'
_PAGES = b'<!doctype html', b'<html'


def existing(path, kind='file') -> Path:
    """Return the path of an existing file, which does not stand in for another."""
    path = _as_path(path)
    with naming('path', path):
        is_file = path.is_file()
    if not is_file:
        raise FileNotFoundError(f'path must be an existing {kind}, got {str(path)!r}')
    with path.open('rb') as file:
        stand_in = stand_in_of(file.read(HEAD_BYTES))
    if stand_in:
        raise ValueError(f'path must be a {kind}, got {stand_in}: {str(path)!r}')
    return path


def stand_in_of(head) -> str:
    """Return what was saved in place of a file, from its first bytes; empty for other content."""
    if head.startswith(_LFS):
        return 'a pointer of Git LFS (run `git lfs pull` in its repository)'
    if head.removeprefix(b'\xef\xbb\xbf').lstrip().lower().startswith(_PAGES):
        return 'a web page (download the file itself, not the page that shows it)'
    return ''


def in_a_folder(name, path) -> Path:
    """Return the path of a file to write, in an existing folder."""
    with naming(name, path):
        path = Path(path).expanduser()
        with contextlib.suppress(OSError):
            path.stat()  # raises for an invalid path
        if not path.absolute().parent.is_dir():
            raise FileNotFoundError(f'there is no folder {str(path.parent)!r}; create it first')
        if not path.name:
            raise ValueError('must end in a file name')
    return path


def with_suffix(path, suffix) -> Path:
    """Return a path that must have a suffix."""
    path = _as_path(path)
    if path.suffix.lower() != suffix:
        raise ValueError(f'path must end in {suffix}, got {str(path)!r}')
    return path


@contextlib.contextmanager
def replacing(path):
    """Write a temporary file, renamed to `path` once it is complete."""
    path = in_a_folder('path', path)
    temporary = path.with_name(f'.{uuid.uuid4().hex}{path.suffix}')
    try:
        yield temporary
        with temporary.open('rb+') as file:
            os.fsync(file.fileno())
        temporary.replace(path)
    except OSError as error:
        reason = 'the disk is full' if error.errno == errno.ENOSPC else error.strerror or error
        raise OSError(
            error.errno, f'cannot write {path}: {reason}; the existing file is unchanged'
        ) from error
    finally:
        with contextlib.suppress(OSError):
            temporary.unlink()


@contextlib.contextmanager
def naming_file(source, kind=ValueError) -> Iterator[None]:
    """Name the file in errors of a kind, if a source is a path."""
    try:
        yield
    except kind as error:
        if not isinstance(source, str | Path) or str(source) in str(error):
            raise
        own_kind = type(error) if isinstance(error, PvibrError) else ValueError
        raise own_kind(f'{source}: {error}') from error
