"""Files that are there whole, or as they were before."""

from __future__ import annotations

import contextlib
import errno
import os
import uuid
from pathlib import Path

from pvibr.core.arguments import naming


def _as_path(path):
    with naming('path', path):
        return Path(path).expanduser()


def existing(path, what='file') -> Path:
    """Return the path of a file that must be there."""
    path = _as_path(path)
    if not path.is_file():
        raise FileNotFoundError(f'there is no {what} at the path {str(path)!r}')
    return path


def in_a_folder(name, path) -> Path:
    """Return the path of a file to write, in a folder that is there."""
    with naming(name, path):
        path = Path(path).expanduser()
        with contextlib.suppress(OSError):
            path.stat()  # raises if it is no path at all
        if not path.absolute().parent.is_dir():
            raise FileNotFoundError(f'there is no folder {str(path.parent)!r}: make it first')
        if not path.name:
            raise ValueError('it must end in the name of a file')
    return path


def with_suffix(path, suffix) -> Path:
    """Return a path that must end in a suffix."""
    path = _as_path(path)
    if path.suffix.lower() != suffix:
        raise ValueError(f'path is {str(path)!r}; it must end in {suffix}')
    return path


@contextlib.contextmanager
def replacing(path):
    """Write a file under another name, and give it its own once it is whole."""
    path = in_a_folder('path', path)
    part = path.with_name(f'.{uuid.uuid4().hex}{path.suffix}')
    try:
        yield part
        with part.open('rb+') as file:
            os.fsync(file.fileno())
        part.replace(path)
    except OSError as error:
        why = 'the disk is full' if error.errno == errno.ENOSPC else error.strerror or error
        raise OSError(
            error.errno, f'{path} could not be written: {why}; what was there before is as it was.'
        ) from error
    finally:
        with contextlib.suppress(OSError):
            part.unlink()
