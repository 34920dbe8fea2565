"""Poses of instances and their scalars from files."""

from __future__ import annotations

import numpy as np

from pvibr.core.arguments import checked_each, naming
from pvibr.core.files import existing
from pvibr.core.nan_rows import advising, filled
from pvibr.io.tables import table_of
from pvibr.maths.transforms import AXES, AXIS_SCALES, QUATERNION, trs
from pvibr.meshes.poses import as_poses

_MAX_LISTED = 20  # column names in a message


def read_poses(path, columns=None, *, others=None):
    r"""Read poses and other columns from a file.

    Parameters
    ----------
    path : str or pathlib.Path
        A ``.npy`` file with an (n, 3) or (n, 4, 4) array; a text table (``.csv``, ``.tsv``,
        ``.txt``, each also with ``.gz``) delimited by comma, semicolon or tab, whose first line
        names its columns; a ``.parquet`` table (extra ``parquet``); or a point cloud, ``.las`` or
        ``.laz`` (extra ``las``). Columns are, in any case: x, y, z; optionally qw, qx, qy, qz
        (rotation) and scale or sx, sy, sz; all others are returned.
    columns : sequence of three str or None, optional
        Names of the columns for x, y and z; a ``None`` in it means 0.
    others : sequence of str, optional
        Names of the other columns to read; by default all.

    Returns
    -------
    poses : numpy.ndarray, shape (n, 3) or (n, 4, 4), float64
        As :func:`as_poses` returns them.
    columns : dict[str, numpy.ndarray]
        The other columns, shape (n,) each: float64 (NaN where empty or ``NA``), or str if the
        first value is not a number; lists, times and the like are left out. LAS files with colours
        have ``'rgb'``, (n, 3) uint8. Empty for a ``.npy`` file.

    Raises
    ------
    FileNotFoundError
        If there is no such file.
    ValueError
        If the file is empty, lacks a column or has an invalid value; the message names file, line,
        column and text.
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


def read_poses_and(path, names, nan_rows=None):
    """Read poses, and those of the named columns that the file has."""
    path = existing(path, 'poses file')
    if path.suffix.lower() == '.npy':
        return _read_npy(path, nan_rows), {}
    return table_poses(table_of(path), names, nan_rows=nan_rows)


def table_poses(table, names, columns=None, *, oriented=True, nan_rows=None):
    """Return poses of a table, and those of the named columns that it has, by these names."""
    present = [name for name in names if table.find(name) is not None]
    reading = {'oriented': oriented, 'nan_rows': nan_rows}
    poses, columns_by_name = _poses_of(table, columns, present, **reading)
    requested = {name: columns_by_name.get(table.names[table.find(name)]) for name in present}
    return poses, {name: values for name, values in requested.items() if values is not None}


def _read_npy(path, nan_rows=None):
    try:
        # Memory-mapped: a header may declare more than the file holds.
        array = np.load(path, mmap_mode='r', allow_pickle=False)
    except Exception as error:  # its parser raises various kinds
        raise ValueError(f'{path}: not a readable .npy file of numbers ({error})') from error
    try:
        return as_poses(np.array(array), nan_rows)
    except (TypeError, ValueError) as error:
        raise ValueError(f'{path}: {error}') from error


def _poses_of(table, columns, other_names, *, oriented=True, nan_rows=None):
    axes = _axis_columns(table, columns)
    spin_columns, scale_columns = _orientation(table) if oriented else ([], [])
    pose_columns = [index for index in axes if index is not None] + spin_columns + scale_columns
    other_indices = _others(table, pose_columns, other_names)
    text_columns = [index for index in other_indices if table.kind(index) == 'text']
    number_columns = [index for index in other_indices if table.kind(index) == 'number']
    finite_columns = () if nan_rows is not None and nan_rows.hides else pose_columns
    with advising(nan_rows):
        values = table.numbers([*pose_columns, *number_columns], set(finite_columns)).T
    columns_read = dict(zip([*pose_columns, *number_columns], values, strict=True))
    zeros = np.zeros(len(columns_read[pose_columns[0]]))
    points = np.stack([zeros if index is None else columns_read[index] for index in axes], axis=1)
    spins, scales = ([columns_read[i] for i in ids] for ids in (spin_columns, scale_columns))
    try:
        poses = as_poses(_compose(points, spins, scales, nan_rows), nan_rows)
    except ValueError as error:
        raise ValueError(f'{table.path}: {error}') from error
    texts = table.texts(text_columns) if text_columns else []
    columns_read |= dict(zip(text_columns, texts, strict=True))
    read_others = [i for i in other_indices if i in columns_read]
    other_columns = {table.names[i]: np.ascontiguousarray(columns_read[i]) for i in read_others}
    for name, values in table.extras().items():
        if other_names is None or name in other_names:
            other_columns[name] = values
    return poses, other_columns


def _orientation(table):
    """Return the column indices of rotations and of scales."""
    return _group(table, QUATERNION), _group(table, AXIS_SCALES) or _group(table, ('scale',))


def _others(table, pose_columns, names):
    """Return the indices of the other columns to read."""
    if names is None:
        return [index for index in range(len(table.names)) if index not in pose_columns]
    names = checked_each('others', names, lambda name: isinstance(name, str), 'names of columns')
    available = [*table.names, *table.extras()]
    unknown = [name for name in names if table.find(name) is None and name not in available]
    if unknown:
        raise ValueError(
            f'{table.path}: others must be columns, got {unknown[0]!r}; there are '
            f'{_listed(available)}'
        )
    indices = [table.find(name) for name in names]
    return [index for index in indices if index is not None]


def _listed(names):
    """Return names for a message, abbreviated if there are many."""
    more = len(names) - _MAX_LISTED
    return f'{names}' if more <= 0 else f'{names[:_MAX_LISTED]} and {more} more'


def _axis_columns(table, columns):
    with naming('columns', columns):
        axis_names = AXES if columns is None else tuple(columns)
    are_names = all(isinstance(name, str | None) for name in axis_names)
    if len(axis_names) != 3 or not are_names or not any(name is not None for name in axis_names):
        raise ValueError(f'columns must be three names, or None, for x, y and z, got {columns!r}')
    indices = [None if name is None else table.find(name) for name in axis_names]
    missing = [n for n, i in zip(axis_names, indices, strict=True) if n is not None and i is None]
    if missing:
        raise ValueError(
            f'{table.path}: no column {missing[0]!r} among {_listed(table.names)}; '
            "name the columns to use: columns=('east', 'north', None)"
        )
    return indices


def _group(table, names):
    """Return the indices of columns that belong together, empty without any of them."""
    indices = [table.find(name) for name in names]
    if any(i is None for i in indices) and any(i is not None for i in indices):
        missing = names[indices.index(None)]
        raise ValueError(f'{table.path}: no column {missing!r}; {names} must come together')
    return [index for index in indices if index is not None]


def _compose(points, quaternion_parts, scale_parts, nan_rows):
    if not quaternion_parts and not scale_parts:
        return points
    quaternions = None
    if quaternion_parts:
        quaternions = filled(nan_rows, 'quaternions', np.stack(quaternion_parts, axis=1))
    return trs(points, quaternions, np.stack(scale_parts, axis=1) if scale_parts else None)
