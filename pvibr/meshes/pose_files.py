"""Reading of instance poses and their scalars from files."""

from __future__ import annotations

import numpy as np

from pvibr.core.files import existing
from pvibr.formats.tables import table_of
from pvibr.maths.arguments import checked_each, naming
from pvibr.maths.transforms import trs
from pvibr.meshes.poses import as_poses

AXES = ('x', 'y', 'z')
QUATERNION = ('qw', 'qx', 'qy', 'qz')
AXIS_SCALES = ('sx', 'sy', 'sz')
#: Columns that a message lists.
_MOST_NAMES = 20


def read_poses(path, columns=None, *, others=None):
    r"""Read poses, and the scalars that come with them, from a file.

    Parameters
    ----------
    path : str or pathlib.Path
        A ``.npy`` file with an (n, 3) or (n, 4, 4) array; a text table (``.csv``, ``.tsv``,
        ``.txt``, each also with ``.gz``) delimited by comma, semicolon or tab, whose first line
        names its columns; a ``.parquet`` table (the extra ``parquet``); or a cloud of points,
        ``.las`` or ``.laz`` (the extra ``las``). Columns are, in upper or lower case: x, y, z;
        optionally qw, qx, qy, qz (rotation) and scale or sx, sy, sz; all others are returned.
    columns : sequence of three str or None, optional
        Names of the columns to take for x, y and z; ``None`` in it means 0.
    others : sequence of str, optional
        Names of the other columns to read; all of them by default.

    Returns
    -------
    poses : numpy.ndarray, shape (n, 3) or (n, 4, 4), float64
        As :func:`as_poses` returns them.
    columns : dict[str, numpy.ndarray]
        The other columns, each of shape (n,): float64 (NaN where empty or ``NA``), or str where
        the first value is no number; lists, times and the like are left out. Points of LAS files
        with colours have ``'rgb'``, (n, 3) uint8. Empty for a ``.npy`` file.

    Raises
    ------
    FileNotFoundError
        If there is no such file.
    ValueError
        If the file is empty, lacks a column or has a value that cannot be used; file, line,
        column and text are named.
    ImportError
        If the file needs an extra that is not installed.

    Examples
    --------
    >>> import pathlib, tempfile
    >>> from pvibr.meshes.pose_files import read_poses
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     file = pathlib.Path(folder) / 'trees.csv'
    ...     _ = file.write_text('x;y;z;height\n1;2;3;17.5\n')
    ...     read_poses(file)
    (array([[1., 2., 3.]]), {'height': array([17.5])})
    """
    path = existing(path, 'poses file')
    if path.suffix.lower() == '.npy':
        return _read_npy(path), {}
    return _poses_of(table_of(path), columns, others)


def read_poses_and(path, names):
    """Read poses and other columns, those of some names that the file has."""
    path = existing(path, 'poses file')
    if path.suffix.lower() == '.npy':
        return _read_npy(path), {}
    return table_poses(table_of(path), names)


def table_poses(table, names, columns=None, *, oriented=True):
    """Return poses of a table, and the other columns of some names that it has, by these."""
    there = [name for name in names if table.find(name) is not None]
    poses, found = _poses_of(table, columns, there, oriented=oriented)
    kept = {name: found.get(table.names[table.find(name)]) for name in there}
    return poses, {name: values for name, values in kept.items() if values is not None}


def _read_npy(path):
    try:
        # Mapped: a header may promise more than the file holds.
        array = np.load(path, mmap_mode='r', allow_pickle=False)
    except Exception as error:  # of its parser, too
        raise ValueError(f'{path}: not a readable .npy file of numbers ({error}).') from error
    try:
        return as_poses(np.array(array))
    except (TypeError, ValueError) as error:
        raise ValueError(f'{path}: {error}') from error


def _poses_of(table, columns, others, *, oriented=True):
    axes = _axis_columns(table, columns)
    spins, sizes = _orientation(table) if oriented else ([], [])
    used = [index for index in axes if index is not None] + spins + sizes
    wanted = _others(table, used, others)
    texts = [index for index in wanted if table.kind(index) == 'text']
    numbers = [index for index in wanted if table.kind(index) == 'number']
    values = table.numbers([*used, *numbers], set(used)).T
    known = dict(zip([*used, *numbers], values, strict=True))
    zeros = np.zeros(len(known[used[0]]))
    points = np.stack([zeros if index is None else known[index] for index in axes], axis=1)
    try:
        poses = _compose(points, [known[i] for i in spins], [known[i] for i in sizes])
        poses = as_poses(poses)
    except ValueError as error:
        raise ValueError(f'{table.path}: {error}') from error
    known |= dict(zip(texts, table.texts(texts) if texts else [], strict=True))
    found = {table.names[i]: np.ascontiguousarray(known[i]) for i in wanted if i in known}
    extras = table.extras()
    return poses, found | {k: v for k, v in extras.items() if others is None or k in others}


def _orientation(table):
    """Return the columns of rotations, and those of scales."""
    sizes = _group(table, AXIS_SCALES) or [i for i in [table.find('scale')] if i is not None]
    return _group(table, QUATERNION), sizes


def _others(table, used, names):
    """Return the indices of the other columns to read."""
    if names is None:
        return [index for index in range(len(table.names)) if index not in used]
    names = checked_each('others', names, lambda one: isinstance(one, str), 'names of columns')
    known = [*table.names, *table.extras()]
    unknown = [name for name in names if table.find(name) is None and name not in known]
    if unknown:
        msg = f'{table.path}: others has {unknown[0]!r}, which is no column; '
        msg += f'there are {_listed(known)}.'
        raise ValueError(msg)
    indices = [table.find(name) for name in names]
    return [index for index in indices if index is not None]


def _listed(names):
    """Return names for a message, abbreviated if many."""
    more = len(names) - _MOST_NAMES
    return f'{names}' if more <= 0 else f'{names[:_MOST_NAMES]} and {more} more'


def _axis_columns(table, columns):
    with naming('columns', columns):
        wanted = AXES if columns is None else tuple(columns)
    text = all(isinstance(name, str | None) for name in wanted)
    if len(wanted) != 3 or not text or not any(name is not None for name in wanted):
        raise ValueError(
            f'columns is {columns!r}; it must be three column names, for x, y and z, or None.'
        )
    indices = [None if name is None else table.find(name) for name in wanted]
    missing = [n for n, i in zip(wanted, indices, strict=True) if n is not None and i is None]
    if missing:
        raise ValueError(
            f'{table.path}: no column {missing[0]!r}; there are {_listed(table.names)}. '
            "Name the columns to use, for example columns=('east', 'north', None)."
        )
    return indices


def _group(table, names):
    """Return the indices of columns that belong together, or an empty list."""
    indices = [table.find(name) for name in names]
    if any(i is None for i in indices) and any(i is not None for i in indices):
        missing = names[indices.index(None)]
        raise ValueError(f'{table.path}: no column {missing!r}; {names} must come together.')
    return [index for index in indices if index is not None]


def _compose(points, spins, sizes):
    if not spins and not sizes:
        return points
    quaternions = np.stack(spins, axis=1) if spins else None
    return trs(points, quaternions, np.stack(sizes, axis=1) if sizes else None)
