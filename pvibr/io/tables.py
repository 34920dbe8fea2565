"""Tables: delimited text, Parquet, point clouds, and columns in memory."""

from __future__ import annotations

import csv
import gzip
import zlib
from collections import Counter
from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np

from pvibr.core.errors import require
from pvibr.io.las_headers import check_las, check_laz, check_points

#: Longest line of a table, characters.
_MAX_LINE = 2**22
MISSING = frozenset({'', 'na', 'n/a', 'null', 'none'})


def table_of(path):
    """Return the reader of a file by its suffix."""
    return _READERS.get(path.suffix.lower(), _TextTable)(path)


class Table:
    """A file with named columns, read on demand."""

    path: Path | str
    names: list[str]

    def find(self, name):
        """Return the index of a column, or None."""
        lower_names = [name_of_column.lower() for name_of_column in self.names]
        return lower_names.index(name.lower()) if name.lower() in lower_names else None

    def kind(self, column_index):
        """Return 'number', 'text' or 'other'."""
        raise NotImplementedError

    def numbers(self, column_indices, finite_columns):
        """Return columns as (n, len(indices)) float64; `finite_columns` must be finite."""
        for index in column_indices:
            if self.kind(index) != 'number':
                raise ValueError(f'{self.path}: column {self.names[index]!r} must hold numbers')
        values = np.stack(self._floats(column_indices), axis=1)
        for position, index in enumerate(column_indices):
            bad = np.flatnonzero(~np.isfinite(values[:, position]))
            if index in finite_columns and len(bad):
                place = f'{self.path}, row {bad[0]}, column {self.names[index]!r}'
                raise ValueError(f'{place}: must be finite, got {values[bad[0], position]}')
        return values

    def _floats(self, column_indices) -> list:
        raise NotImplementedError

    def texts(self, column_indices):
        """Return columns as arrays of str; missing values are empty."""
        raise NotImplementedError

    def extras(self) -> dict:
        """Return arrays composed of several columns."""
        return {}


class _TextTable(Table):
    """A delimited text file."""

    def __init__(self, path):
        self.path = path
        lines = (line for line in self._lines() if line.strip())
        header, first_line = next(lines, ''), next(lines, '')
        lines.close()
        if not header:
            raise ValueError(f'{path}: must name the columns x, y, z, got an empty file')
        self.delimiter = max(',;\t', key=header.count)
        header_rows = self._split(line.rstrip('\r\n') for line in (header, first_line) if line)
        self.names = [name.strip() for name in next(header_rows)[1]]
        self._first: list[str] = next(header_rows, (0, [''] * len(self.names)))[1]
        self.empty = not first_line
        duplicates = [name for name, count in Counter(self.names).items() if name and count > 1]
        if duplicates:
            column = len(self.names) - self.names[::-1].index(duplicates[0])
            raise ValueError(f'{path}, line 1, column {column}: {duplicates[0]!r} occurs twice')

    def _lines(self):
        """Yield the lines of the file."""
        line_number = 1
        try:
            with _open(self.path) as file:
                while line := file.readline(_MAX_LINE):
                    if len(line) == _MAX_LINE:
                        place = f'{self.path}, line {line_number}, column {_columns_of(line)}'
                        raise ValueError(f'{place}: more than {_MAX_LINE:,} characters')
                    yield line
                    line_number += 1
        except (gzip.BadGzipFile, EOFError, zlib.error) as error:
            raise ValueError(
                f'{self.path}: not a readable gzip file from line {line_number} on ({error})'
            ) from error

    def _split(self, lines):
        """Yield (number of the last line, fields) of the records in lines."""
        record_lines: list[str] = []
        reader = csv.reader(_recording(lines, record_lines), delimiter=self.delimiter)
        try:
            for row in reader:
                yield reader.line_num, row
                record_lines.clear()
        except csv.Error as error:
            sizes = [len(text) for text in record_lines[0].split(self.delimiter)]
            column = len(sizes) if len(record_lines) > 1 else 1 + sizes.index(max(sizes))
            first_line = reader.line_num - len(record_lines) + 1
            raise ValueError(
                f'{self.path}, line {first_line}, column {column}: {error}; is a quote left open?'
            ) from error

    def kind(self, column_index):
        """Return 'text' if the first value is neither a number nor missing, else 'number'."""
        value = self._first[column_index] if column_index < len(self._first) else ''
        return 'number' if value.strip().lower() in MISSING or _is_number(value) else 'text'

    def numbers(self, column_indices, finite_columns):
        """Return columns as (n, len(indices)) float64; `finite_columns` must be finite."""
        if self.empty:
            return np.empty((0, len(column_indices)))
        self._check_counts()
        try:
            values = self._load_fast(column_indices)
        except ValueError:
            # A broken line, or only an empty value; the slow reader finds where.
            return self._load_slow(column_indices, finite_columns)
        must_be_finite = [
            position for position, index in enumerate(column_indices) if index in finite_columns
        ]
        if not np.isfinite(values[:, must_be_finite]).all():
            return self._load_slow(column_indices, finite_columns)
        return values

    def _check_counts(self):
        """Check the number of fields of all lines, even if only some columns are read."""
        delimiters = len(self.names) - 1
        for line in self._lines():
            if '"' in line or (line.count(self.delimiter) != delimiters and line.strip()):
                for _ in self._rows():  # raises with the place
                    pass
                return

    def _load_fast(self, column_indices):
        all_columns = len(column_indices) == len(self.names)
        values = np.loadtxt(
            str(self.path),
            delimiter=self.delimiter,
            comments=None,
            quotechar='"',
            encoding='utf-8-sig',
            usecols=None if all_columns else column_indices,
            skiprows=self._lines_before_data(),
            ndmin=2,
        )
        return values[:, column_indices] if all_columns else values

    def _lines_before_data(self):
        return next(number for number, line in enumerate(self._lines(), 1) if line.strip())

    def _load_slow(self, column_indices, finite_columns):
        return np.array(
            [
                [
                    self._number(line, index, row[index], index in finite_columns)
                    for index in column_indices
                ]
                for line, row in self._rows()
            ]
        )

    def _number(self, line_number, column_index, text, is_needed):
        if text.strip().lower() in MISSING and not is_needed:
            return np.nan
        if not _is_number(text) or (is_needed and not np.isfinite(float(text))):
            expected = 'a finite number' if is_needed else 'a number'
            raise ValueError(
                f'{self._place(line_number, column_index)}: must be {expected}, got {text!r}'
            )
        return float(text)

    def _place(self, line_number, index):
        return f'{self.path}, line {line_number}, column {index + 1} ({self.names[index]!r})'

    def _rows(self):
        """Yield (line number, fields) of the data, with checked field counts."""
        records = self._split(self._lines())
        data_rows = ((line, row) for line, row in records if any(map(str.strip, row)))
        next(data_rows)
        for line, row in data_rows:
            if len(row) != len(self.names):
                raise ValueError(
                    f'{self.path}, line {line}, column {min(len(row), len(self.names)) + 1}: '
                    f'row must have {len(self.names)} values, as the header, got {len(row)}: '
                    f'{self.delimiter.join(row)!r:.200}'
                )
            yield line, row

    def texts(self, column_indices):
        """Return columns as arrays of str; missing values are empty."""
        records = [] if self.empty else [row for _, row in self._rows()]
        return [
            np.array([row[index].strip() for row in records], dtype=str)
            for index in column_indices
        ]


def _recording(lines, record_lines):
    """Yield lines and append them to a list."""
    for line in lines:
        record_lines.append(line)
        yield line


def _columns_of(line) -> int:
    return 1 + max(map(line.count, ',;\t'))


def _open(path):
    opener = gzip.open if path.suffix.lower() == '.gz' else open
    return opener(path, 'rt', encoding='utf-8-sig', errors='replace', newline='')


def _is_number(text):
    try:
        float(text)
    except ValueError:
        return False
    return True


class _ParquetTable(Table):
    """A Parquet file, read by pyarrow."""

    def __init__(self, path):
        self._parquet = require('pyarrow.parquet', 'parquet', 'Parquet files')
        self.path = path
        self._schema = self._read(self._parquet.read_schema)
        self.names = list(self._schema.names)
        self._kinds = [self._kind(kind) for kind in self._schema.types]

    def _read(self, read, **options):
        try:
            return read(str(self.path), **options)
        except (ValueError, OSError) as error:  # pyarrow's errors are both
            raise ValueError(f'{self.path}: not a readable Parquet file ({error})') from error

    def kind(self, column_index):
        """Return 'number', 'text', or 'other' for lists, times, bytes and the like."""
        return self._kinds[column_index]

    @staticmethod
    def _kind(arrow_type):
        types = require('pyarrow', 'parquet', 'Parquet files').types
        if types.is_dictionary(arrow_type):
            arrow_type = arrow_type.value_type
        texts = types.is_string, types.is_large_string, getattr(types, 'is_string_view', None)
        if any(is_it(arrow_type) for is_it in texts if is_it is not None):
            return 'text'
        numeric = (types.is_integer, types.is_floating, types.is_boolean, types.is_decimal)
        return 'number' if any(is_it(arrow_type) for is_it in numeric) else 'other'

    def _columns(self, column_indices):
        # A name may occur twice, and a column may be requested twice.
        names = [self.names[index] for index in column_indices]
        counts = Counter(self.names)
        duplicates = [name for name in names if counts[name] > 1]
        if duplicates:
            raise ValueError(f'{self.path}: two columns are named {duplicates[0]!r}')
        return self._read(self._parquet.read_table, columns=list(dict.fromkeys(names))), names

    def _floats(self, column_indices):
        table, names = self._columns(column_indices)
        return [table.column(name).cast('float64', safe=False).to_numpy() for name in names]

    def texts(self, column_indices):
        """Return columns as arrays of str; missing values are empty."""
        table, names = self._columns(column_indices)
        return [
            np.array([text or '' for text in table.column(name).to_pylist()], dtype=str)
            for name in names
        ]


class _PointCloud(Table):
    """A LAS or LAZ file, read by laspy; its colours are also available as ``rgb``."""

    def __init__(self, path):
        laspy = require('laspy', 'las', 'LAS and LAZ files')
        self.path = path
        # Any error of a third-party reader means an unreadable file; a panic is no Exception.
        try:
            self._points = laspy.read(path, laz_backend=_laz_backend(laspy, path))
        except BaseException as error:
            if not isinstance(error, Exception) and type(error).__name__ != 'PanicException':
                raise
            raise ValueError(f'{path}: not a readable LAS or LAZ file ({error})') from error
        dimension_names = self._points.point_format.dimension_names
        self.names = ['x', 'y', 'z', *(name for name in dimension_names if name not in 'XYZ')]

    def kind(self, column_index):
        """Return 'number', or 'other' for dimensions of several values."""
        return 'number' if np.ndim(self._points[self.names[column_index]]) == 1 else 'other'

    def _floats(self, column_indices):
        return [np.asarray(self._points[self.names[i]], np.float64) for i in column_indices]

    def extras(self):
        """Return the colours, (n, 3) uint8, if there are any."""
        if self.find('red') is None:
            return {}
        colors = np.stack([self._points[name] for name in ('red', 'green', 'blue')], axis=1)
        # LAS colours are 16-bit, but many files hold 8-bit values.
        deep = colors.size and colors.max() > 255
        return {'rgb': (colors >> 8 if deep else colors).astype(np.uint8)}


def _laz_backend(laspy, path):
    """Return what unpacks a file, which holds what its header promises."""
    check_las(path)
    with laspy.open(path) as reader:
        header = reader.header
    check_points(path, header)
    if not header.are_points_compressed or check_laz(path, header):
        return laspy.LazBackend.detect_available()
    return laspy.LazBackend.Lazrs  # not in parallel, which takes memory for whole chunks


class _Columns(Table):
    """Columns in memory that NumPy converts: a DataFrame, dict or structured array."""

    def __init__(self, columns, names):
        self.path = type(columns).__name__
        self.names, self._held = names, {}
        for name in names:
            array = np.asarray(columns[name])
            if not array.ndim:
                raise ValueError(
                    f'{self.path}: column {name!r} must be an array, got {array.item()!r:.80}'
                )
            self._held[name] = _as_numbers(array) if array.dtype.kind == 'O' else array
        lengths = {name: len(array) for name, array in self._held.items()}
        if len(set(lengths.values())) > 1:
            raise ValueError(f'{self.path}: columns must have equal lengths, got {lengths}')

    def kind(self, column_index):
        """Return 'number', 'text', or 'other' for times, lists and the like."""
        array = self._held[self.names[column_index]]
        if array.ndim != 1:
            return 'other'
        kinds = {'f': 'number', 'i': 'number', 'u': 'number', 'b': 'number', 'U': 'text'}
        texts = array.dtype.kind == 'O' and all(isinstance(v, str | None) for v in array)
        return 'text' if texts else kinds.get(array.dtype.kind, 'other')

    def _floats(self, column_indices):
        return [self._held[self.names[i]].astype(float) for i in column_indices]

    def texts(self, column_indices):
        """Return columns as arrays of str; missing values are empty."""
        columns = [self._held[self.names[i]] for i in column_indices]
        return [np.array([text or '' for text in column], dtype=str) for column in columns]


def columns_table(columns) -> Table | None:
    """Return the reader of named columns in memory, None for anything else."""
    names = _column_names(columns)
    if names is None and hasattr(columns, '__arrow_c_stream__'):
        columns = require('pyarrow', 'parquet', 'Arrow streams').table(columns)
        names = columns.column_names
    return None if names is None else _Columns(columns, names)


def _column_names(columns) -> list[str] | None:
    names = getattr(columns, 'column_names', getattr(columns, 'columns', None))
    if isinstance(columns, Mapping):
        names = columns
    elif isinstance(columns, np.ndarray):
        names = columns.dtype.names
    elif names is None or callable(names):
        return None
    names = [] if names is None else list(names)
    return names if names and all(isinstance(name, str) for name in names) else None


def _as_numbers(array):
    """Return objects as numbers with NaN for None, unchanged if impossible."""
    try:
        return np.array([np.nan if value is None else value for value in array], float)
    except (TypeError, ValueError):
        return array


_READERS: dict[str, Callable[[Path], Table]] = {
    '.parquet': _ParquetTable,
    '.pq': _ParquetTable,
    '.las': _PointCloud,
    '.laz': _PointCloud,
}
