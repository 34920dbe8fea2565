"""Where instances stand: poses as arrays, checked, and read from files."""

from __future__ import annotations

import csv
import gzip
from pathlib import Path

import numpy as np

from pvibr.maths.transforms import trs

AXES = ('x', 'y', 'z')
QUATERNION = ('qw', 'qx', 'qy', 'qz')
AXIS_SCALES = ('sx', 'sy', 'sz')
MISSING = frozenset({'', 'na', 'n/a', 'null', 'none'})

#: Smallest |det| / (product of the column lengths) of a matrix that counts as invertible. It is
#: relative, so that a scale of 1e-9 passes and only axes that collapse onto each other fail.
SINGULAR = 1e-12


def as_poses(poses):
    """Return poses as a checked float64 array.

    Points stay points (24 bytes each): they are not blown up to matrices (128 bytes each). The
    array given is not copied where it is already float64.

    Parameters
    ----------
    poses : array_like or pyvista.DataSet
        (n, 3) points, one (3,) point, (n, 4, 4) matrices, one (4, 4) matrix, or a dataset whose
        points are taken. World units; a matrix is ``world_from_model`` and may rotate, scale
        per axis and mirror.

    Returns
    -------
    numpy.ndarray, shape (n, 3) or (n, 4, 4), float64
        The poses; n may be zero.

    Raises
    ------
    TypeError
        If the values are not numbers.
    ValueError
        If the shape is another one, a value is NaN or infinite, a matrix has a last row other
        than (0, 0, 0, 1) or has no inverse. The row is named.

    Examples
    --------
    >>> from pvibr.actors.poses import as_poses
    >>> as_poses([1, 2, 3])
    array([[1., 2., 3.]])
    >>> as_poses([]).shape
    (0, 3)
    """
    array = _as_array(getattr(poses, 'points', poses))
    _check_finite(array)
    if array.ndim == 3:
        _check_matrices(array)
    return array


def read_poses(path, columns=None):
    r"""Read poses, and the scalars that come with them, from a file.

    Parameters
    ----------
    path : str or pathlib.Path
        A ``.npy`` file with an (n, 3) or (n, 4, 4) array, or a text table (``.csv``, ``.tsv``,
        ``.txt``, each also with ``.gz``) delimited by comma, semicolon or tab. The table's first
        line names its columns, in upper or lower case: x, y, z; optionally qw, qx, qy, qz
        (rotation) and scale or sx, sy, sz; all others are returned as scalars.
    columns : sequence of three str or None, optional
        Names of the columns to take for x, y and z; ``None`` in it means 0.

    Returns
    -------
    poses : numpy.ndarray, shape (n, 3) or (n, 4, 4), float64
        As :func:`as_poses` returns them.
    columns : dict[str, numpy.ndarray]
        The other columns, each of shape (n,): float64 (NaN where empty or ``NA``), or str where
        the first value is no number. Empty for a ``.npy`` file.

    Raises
    ------
    FileNotFoundError
        If there is no such file.
    ValueError
        If the file is empty, lacks a column or has a value that cannot be used; file, line,
        column and text are named.

    Examples
    --------
    >>> import pathlib, tempfile
    >>> from pvibr.actors.poses import read_poses
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     file = pathlib.Path(folder) / 'trees.csv'
    ...     _ = file.write_text('x;y;z;height\n1;2;3;17.5\n')
    ...     read_poses(file)
    (array([[1., 2., 3.]]), {'height': array([17.5])})
    """
    path = Path(path)
    if path.suffix.lower() == '.npy':
        return _read_npy(path), {}
    table = _Table(path)
    return _poses_of(table, columns)


def _as_array(poses):
    try:
        array = np.asarray(poses, dtype=np.float64)
    except (TypeError, ValueError) as error:
        msg = f'poses must be an array of numbers, (n, 3) or (n, 4, 4); {error}.'
        raise TypeError(msg) from error
    if array.size == 0 and array.ndim <= 2 and array.shape[-1] in (0, 3):
        return array.reshape(0, 3)
    if array.shape in ((3,), (4, 4)):
        array = array[None]
    if array.shape[1:] not in ((3,), (4, 4)):
        msg = f'poses has shape {np.shape(poses)}; it must be (n, 3) points or (n, 4, 4) matrices.'
        raise ValueError(msg)
    return array


def _check_finite(array):
    # The sum over everything is NaN or infinite when any value is: one cheap pass, no copy. It
    # may also overflow, and then the thorough test decides.
    with np.errstate(over='ignore', invalid='ignore'):
        if np.isfinite(array.sum()):
            return
    good = np.isfinite(array).reshape(len(array), -1).all(axis=1)
    _complain(array, ~good, 'it must be finite')


def _check_matrices(array):
    _complain(
        array, (array[:, 3] != (0, 0, 0, 1)).any(axis=1), 'its last row must be (0, 0, 0, 1)'
    )
    linear = array[:, :3, :3]
    lengths = np.linalg.norm(linear, axis=1)
    # Columns of length one first: the determinant of tiny or huge scales stays in range.
    unit = linear / np.where(lengths > 0, lengths, 1)[:, None, :]
    singular = ~(np.abs(np.linalg.det(unit)) > SINGULAR)
    _complain(array, singular, 'it must have an inverse (no axis scaled to zero)')


def _complain(array, bad, demand):
    rows = np.flatnonzero(bad)
    if rows.size:
        msg = f'poses[{rows[0]}] is {array[rows[0]].tolist()}; {demand} ({rows.size} such rows).'
        raise ValueError(msg)


def _read_npy(path):
    try:
        array = np.load(path, allow_pickle=False)
    except (ValueError, EOFError) as error:
        msg = f'{path}: not a readable .npy file of numbers ({error}).'
        raise ValueError(msg) from error
    try:
        return as_poses(array)
    except (TypeError, ValueError) as error:
        msg = f'{path}: {error}'
        raise ValueError(msg) from error


class _Table:
    """A delimited text file: its header at once, its columns on demand."""

    def __init__(self, path):
        self.path = path
        with _open(path) as file:
            header = next((line for line in file if line.strip()), '')
            first = next((line for line in file if line.strip()), '')
        if not header:
            msg = f'{path}: the file is empty; its first line must name the columns x, y, z.'
            raise ValueError(msg)
        self.delimiter = max(',;\t', key=header.count)
        self.names = [name.strip() for name in self._split(header)]
        self._first = self._split(first) if first else [''] * len(self.names)
        self.empty = not first

    def _split(self, line):
        return next(csv.reader([line.rstrip('\r\n')], delimiter=self.delimiter))

    def find(self, name):
        """Return the index of a column, or None."""
        lower = [known.lower() for known in self.names]
        return lower.index(name.lower()) if name.lower() in lower else None

    def is_text(self, index):
        """Return whether the first value of a column is neither a number nor missing."""
        value = self._first[index] if index < len(self._first) else ''
        return value.strip().lower() not in MISSING and not _is_number(value)

    def numbers(self, indices, needed):
        """Return columns as (n, len(indices)) float64; those in `needed` must be finite."""
        if self.empty:
            return np.empty((0, len(indices)))
        try:
            values = self._load_fast(indices)
        except ValueError:
            # Something that the fast reader does not like: a broken line, or only an empty
            # scalar. The slow reader knows the difference and the place.
            return self._load_slow(indices, needed)
        must = [position for position, index in enumerate(indices) if index in needed]
        if not np.isfinite(values[:, must]).all():
            return self._load_slow(indices, needed)
        return values

    def _load_fast(self, indices):
        every = len(indices) == len(self.names)
        values = np.loadtxt(
            str(self.path),
            delimiter=self.delimiter,
            comments=None,
            quotechar='"',
            encoding='utf-8-sig',
            usecols=None if every else indices,
            skiprows=self._lines_before_data(),
            ndmin=2,
        )
        return values[:, indices] if every else values

    def _lines_before_data(self):
        with _open(self.path) as file:
            return next(number for number, line in enumerate(file, 1) if line.strip())

    def _load_slow(self, indices, needed):
        return np.array(
            [
                [self._number(line, index, row[index], index in needed) for index in indices]
                for line, row in self._rows()
            ]
        )

    def _number(self, line, index, text, is_needed):
        if text.strip().lower() in MISSING and not is_needed:
            return np.nan
        if not _is_number(text) or (is_needed and not np.isfinite(float(text))):
            what = 'a finite number' if is_needed else 'a number'
            msg = f'{self._place(line, index)}: {text!r} is not {what}.'
            raise ValueError(msg)
        return float(text)

    def _place(self, line, index):
        return f'{self.path}, line {line}, column {index + 1} ({self.names[index]!r})'

    def _rows(self):
        """Yield (line number, fields) of the data, each with as many fields as the header."""
        with _open(self.path) as file:
            reader = csv.reader(file, delimiter=self.delimiter)
            rows = ((reader.line_num, row) for row in reader if any(map(str.strip, row)))
            next(rows)
            for line, row in rows:
                if len(row) != len(self.names):
                    msg = (
                        f'{self.path}, line {line}, column {min(len(row), len(self.names)) + 1}: '
                        f'{len(row)} values, but the header names {len(self.names)} columns: '
                        f'{self.delimiter.join(row)!r}.'
                    )
                    raise ValueError(msg)
                yield line, row

    def texts(self, indices):
        """Return the named columns as arrays of str."""
        rows = [] if self.empty else [row for _, row in self._rows()]
        return [np.array([row[index].strip() for row in rows], dtype=str) for index in indices]


def _open(path):
    opener = gzip.open if path.suffix.lower() == '.gz' else open
    return opener(path, 'rt', encoding='utf-8-sig', errors='replace', newline='')


def _is_number(text):
    try:
        float(text)
    except ValueError:
        return False
    return True


def _poses_of(table, columns):
    axes = _axis_columns(table, columns)
    spins = _group(table, QUATERNION)
    sizes = _group(table, AXIS_SCALES) or [i for i in [table.find('scale')] if i is not None]
    used = [index for index in axes if index is not None] + spins + sizes
    others = [index for index in range(len(table.names)) if index not in used]
    texts = [index for index in others if table.is_text(index)]
    indices = used + [index for index in others if index not in texts]
    values = dict(zip(indices, table.numbers(indices, set(used)).T, strict=True))
    zeros = np.zeros(len(values[used[0]]))
    points = np.stack([zeros if index is None else values[index] for index in axes], axis=1)
    try:
        poses = _compose(points, [values[i] for i in spins], [values[i] for i in sizes])
        poses = as_poses(poses)
    except ValueError as error:
        msg = f'{table.path}: {error}'
        raise ValueError(msg) from error
    values |= dict(zip(texts, table.texts(texts) if texts else [], strict=True))
    return poses, {table.names[i]: np.ascontiguousarray(values[i]) for i in others}


def _axis_columns(table, columns):
    wanted = AXES if columns is None else tuple(columns)
    if len(wanted) != 3 or all(name is None for name in wanted):
        msg = f'columns is {columns!r}; it must be three column names, for x, y and z, or None.'
        raise ValueError(msg)
    indices = [None if name is None else table.find(name) for name in wanted]
    missing = [n for n, i in zip(wanted, indices, strict=True) if n is not None and i is None]
    if missing:
        msg = (
            f'{table.path}: no column {missing[0]!r}; the first line names {table.names}. '
            "Name the columns to use, for example columns=('east', 'north', None)."
        )
        raise ValueError(msg)
    return indices


def _group(table, names):
    """Return the indices of columns that come together, or an empty list."""
    indices = [table.find(name) for name in names]
    if any(i is None for i in indices) and any(i is not None for i in indices):
        missing = names[indices.index(None)]
        msg = f'{table.path}: no column {missing!r}; {names} must come together.'
        raise ValueError(msg)
    return [index for index in indices if index is not None]


def _compose(points, spins, sizes):
    if not spins and not sizes:
        return points
    quaternions = np.stack(spins, axis=1) if spins else None
    return trs(points, quaternions, np.stack(sizes, axis=1) if sizes else None)
