"""Files that are there whole, or as they were before."""

from __future__ import annotations

import contextlib
import errno
import os
import uuid
from pathlib import Path


@contextlib.contextmanager
def replacing(path):
    """Write a file under another name, and give it its own once it is whole.

    Parameters
    ----------
    path : str or pathlib.Path
        Where it shall be; the folder is made.

    Yields
    ------
    pathlib.Path
        Where to write it: beside, with the same ending. It is removed where the block raises, and
        what was at `path` stays.

    Raises
    ------
    OSError
        Where it cannot be written, such as on a full disk.

    Examples
    --------
    >>> import tempfile
    >>> from pvibr.files import replacing
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     with replacing(Path(folder) / 'note.txt') as file:
    ...         _ = file.write_text('whole')
    ...     [p.name for p in Path(folder).iterdir()]
    ['note.txt']
    """
    path = Path(path)
    part = path.with_name(f'.{uuid.uuid4().hex}{path.suffix}')
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        yield part
        with part.open('rb+') as file:
            os.fsync(file.fileno())
        part.replace(path)
    except OSError as error:
        why = 'the disk is full' if error.errno == errno.ENOSPC else error.strerror or error
        msg = f'{path} could not be written: {why}; what was there before is as it was.'
        raise OSError(error.errno, msg) from error
    finally:
        with contextlib.suppress(OSError):
            part.unlink()
