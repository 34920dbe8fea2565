"""Growing arrays by name, in memory or in the files of a folder, from which work goes on."""

from __future__ import annotations

import contextlib
import json
import zlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

#: Bytes that are read at once where files are checked or copied.
PIECE_BYTES = 1 << 24
_JOURNAL = 'journal.json'
_SUFFIX = '.column'
_FIRST_ROWS = 1024


class _InMemory:
    """A growing array in memory."""

    def __init__(self, like):
        self._array = np.empty((0, *like.shape[1:]), like.dtype)
        self.length = 0

    def append(self, rows):
        """Add rows at the end."""
        end = self.length + len(rows)
        if end > len(self._array):
            size = max(end, 2 * len(self._array), _FIRST_ROWS)
            larger = np.empty((size, *self._array.shape[1:]), self._array.dtype)
            larger[: self.length] = self._array[: self.length]
            self._array = larger
        self._array[self.length : end] = rows
        self.length = end

    def __len__(self) -> int:
        """Return the number of rows."""
        return self.length

    def __getitem__(self, rows: slice) -> np.ndarray:
        """Return rows, which are not to be changed."""
        return self._array[: self.length][rows]

    def take(self, places) -> np.ndarray:
        """Return the rows of places."""
        return self._array[places]

    def close(self):
        """Let go of the rows."""


class _InFile:
    """A growing array in a file, known by its checksum."""

    def __init__(self, path, dtype, shape, length=0, checksum=0):
        self.path, self.dtype, self.shape = path, np.dtype(dtype), tuple(shape)
        self.length, self.checksum = length, checksum
        # Unbuffered: what a full disk refuses is refused at once.
        self._file = path.open('r+b' if path.exists() else 'x+b', buffering=0)
        self._file.truncate(length * self.row_bytes)
        self._file.seek(0, 2)

    @property
    def row_bytes(self) -> int:
        """Bytes of a row."""
        return self.dtype.itemsize * int(np.prod(self.shape, dtype=np.int64))

    def append(self, rows):
        """Add rows at the end."""
        rows = np.ascontiguousarray(rows, self.dtype)
        content = rows.reshape(-1).view(np.uint8).data
        rest = content
        while len(rest):
            rest = rest[self._file.write(rest) :]
        self.checksum = zlib.crc32(content, self.checksum)
        self.length += len(rows)

    def __len__(self) -> int:
        """Return the number of rows."""
        return self.length

    def __getitem__(self, rows: slice) -> np.ndarray:
        """Read rows."""
        start, stop, _ = rows.indices(self.length)
        count = max(stop - start, 0)
        size = count * self.row_bytes // self.dtype.itemsize
        found = np.fromfile(self.path, self.dtype, size, offset=start * self.row_bytes)
        return found.reshape(-1, *self.shape)

    def take(self, places) -> np.ndarray:
        """Read the rows of places."""
        if not len(places):
            return np.empty((0, *self.shape), self.dtype)
        # Mapped for this call alone: what was read does not stay in memory.
        mapped = np.memmap(self.path, self.dtype, 'r', shape=(self.length, *self.shape))
        return np.asarray(mapped[places])

    def reserve(self, count):
        """Let the file have so many rows of zeros."""
        with self.path.open('r+b') as file:
            file.truncate(count * self.row_bytes)

    def is_whole(self) -> bool:
        """Return True if the file holds what was written."""
        checksum = 0
        step = max(PIECE_BYTES // max(self.row_bytes, 1), 1)
        for start in range(0, self.length, step):
            rows = self[start : start + step]
            checksum = zlib.crc32(rows.reshape(-1).view(np.uint8).data, checksum)
        return checksum == self.checksum

    def close(self):
        """Close the file."""
        self._file.close()


class Columns:
    """Arrays that grow by rows."""

    def __init__(self, folder: Path | None = None, tick: Callable[[], Any] = lambda: None):
        self.folder = folder
        #: Called before rows are added; it may raise.
        self._tick = tick
        self._columns: dict[str, Any] = {}
        #: Names of columns in the journal, and the files of those of them that were dropped since.
        self._noted: set[str] = set()
        self._dropped: dict[str, Path] = {}

    def __contains__(self, name) -> bool:
        """Return True if there is such a column."""
        return name in self._columns

    def __getitem__(self, name) -> Any:
        """Return a column."""
        return self._columns[name]

    def length(self, name) -> int:
        """Return the number of rows of a column, 0 where there is none."""
        return self._columns[name].length if name in self._columns else 0

    def append(self, name, rows):
        """Add rows to a column, of the kind of the first."""
        self._tick()
        if name not in self._columns:
            self._columns[name] = self._new(name, rows)
        self._columns[name].append(rows)

    def _new(self, name, rows):
        if self.folder is None:
            return _InMemory(rows)
        path = self.folder / f'{name}{_SUFFIX}'
        self._dropped.pop(name, None)
        path.unlink(missing_ok=True)
        return _InFile(path, rows.dtype, rows.shape[1:])

    def scratch(self, name, count, dtype) -> np.ndarray:
        """Return an array of zeros to write to, which `drop` lets go of."""
        if self.folder is None:
            return np.zeros(count, dtype)
        self.append(name, np.zeros(0, dtype))
        path = self[name].path
        self[name].reserve(count)
        return np.memmap(path, dtype, 'r+', shape=(count,))

    def all_of(self, name) -> np.ndarray:
        """Return all rows of a column."""
        return self[name][:]

    def drop(self, *names):
        """Let go of columns, where they are; of those in the journal once the next is written."""
        for name in names:
            column = self._columns.pop(name, None)
            if column is not None:
                column.close()
                if name in self._noted:  # from which the work may have to go on
                    self._dropped[name] = column.path
                elif self.folder is not None:
                    _unlink(column.path)

    def commit(self, state: dict[str, Any]):
        """Note how far the work is: it goes on from here."""
        if self.folder is None:
            return
        columns = {
            name: (c.dtype.str, c.shape, c.length, c.checksum) for name, c in self._columns.items()
        }
        journal = self.folder / _JOURNAL
        temporary = journal.with_suffix('.new')
        temporary.write_text(json.dumps({'state': state, 'columns': columns}))
        temporary.replace(journal)
        self._noted = {*columns}
        for path in self._dropped.values():
            _unlink(path)
        self._dropped.clear()

    def resumed(self) -> dict[str, Any] | None:
        """Return the state that was committed last, with the columns as they were, else None."""
        if self.folder is None:
            return None
        state = None
        with contextlib.suppress(OSError, ValueError, TypeError, LookupError, AttributeError):
            state = self._read_journal(self.folder)
        if state is None:
            self.close()
        self._noted = {*self._columns}
        # What came after it is done again.
        for path in self.folder.glob(f'*{_SUFFIX}'):
            if path.name.removesuffix(_SUFFIX) not in self._columns:
                path.unlink()
        return state

    def _read_journal(self, folder) -> dict[str, Any] | None:
        journal = json.loads((folder / _JOURNAL).read_text())
        for name, (dtype, shape, length, checksum) in journal['columns'].items():
            path = folder / f'{name}{_SUFFIX}'
            size = path.stat().st_size  # raises where there is no file
            column = self._columns[name] = _InFile(path, dtype, shape, length, checksum)
            if size < length * column.row_bytes or not column.is_whole():
                return None
        return dict(journal['state'])

    def close(self):
        """Close all files."""
        for column in self._columns.values():
            column.close()
        self._columns.clear()


def _unlink(path):
    with contextlib.suppress(OSError):  # mapped, on Windows
        path.unlink()
