"""Image databases of views in the layout of Cinema, specification D: a table, and HDF5 files."""

from __future__ import annotations

import csv
import io
from pathlib import Path

import numpy as np

from pvibr.core.errors import require
from pvibr.core.files import replacing

TABLE, FILE = 'data.csv', 'FILE'
_PARAMETERS = 'time', 'phi', 'theta'
#: Steps of depth in the size of the scene, and of normals: finer ones only cost bytes.
_DEPTH_STEPS, _NORMAL_STEPS = 2**13, 63


def write_row(path, channels, meta):
    """Write the channels of a picture, top row first, under a temporary name until complete."""
    # gzip is part of every HDF5 library; readers without hdf5plugin cannot read lz4.
    h5py = require('h5py', 'cluster', 'Image databases')
    with replacing(path) as part, h5py.File(part, 'w') as file:
        for group, arrays in (('channels', channels), ('meta', meta)):
            file.create_group(group)
            for name, array in arrays.items():
                array = np.asarray(array)
                packing = {'compression': 'gzip', 'compression_opts': 6, 'shuffle': True}
                file[group].create_dataset(name, data=array, **(packing if array.ndim else {}))


def read_row(path) -> tuple[dict, dict]:
    """Return the channels and what else is known of a picture."""
    h5py = require('h5py', 'cluster', 'Image databases')
    # HDF5 raises various kinds for a damaged file.
    try:
        with h5py.File(path, 'r') as file:
            channels, meta = (
                {k: np.asarray(v) for k, v in file[g].items()} for g in ('channels', 'meta')
            )
    except FileNotFoundError:
        raise
    except Exception as error:
        raise ValueError(f'{path}: not a readable picture of a database ({error})') from error
    return channels, meta


def rounded_depth(depth, size) -> np.ndarray:
    """Return depths in steps of a scene's size, infinite where there is nothing."""
    step = size / _DEPTH_STEPS
    return (np.rint(depth / step) * step).astype(np.float32)


def rounded_normal(normal) -> np.ndarray:
    """Return normals in whole steps."""
    return (np.rint(normal * _NORMAL_STEPS) / _NORMAL_STEPS).astype(np.float32)


def write_table(folder, rows):
    """Write the table, in place of the one there: a row a picture."""
    text = io.StringIO()
    table = csv.writer(text, lineterminator='\n')
    table.writerow([*_PARAMETERS, FILE])
    table.writerows(sorted(rows))
    with replacing(Path(folder) / TABLE) as part:
        part.write_text(text.getvalue())


def read_table(folder) -> list[tuple[float, float, float, str]]:
    """Return time, azimuth and elevation in degrees, and the file of each picture."""
    path = Path(folder) / TABLE
    if not path.exists():
        raise FileNotFoundError(f'path must be a folder with {TABLE}, got {str(folder)!r}')
    try:
        with path.open(newline='', encoding='utf-8') as file:
            head, *rows = list(csv.reader(file))
        return _checked_rows(path, head, rows)
    except (ValueError, csv.Error) as error:
        raise ValueError(f'{path}: {error}') from error


def _checked_rows(path, head, rows) -> list[tuple[float, float, float, str]]:
    """Return the rows of a table, whose files are in its folder."""
    if head != [*_PARAMETERS, FILE]:
        raise ValueError(
            f'{TABLE} must have the columns {", ".join([*_PARAMETERS, FILE])}, got {head}'
        )
    root = path.parent.resolve()
    for *_, name in rows:
        if not (root / name).resolve().is_relative_to(root):
            raise ValueError(f'{FILE} must be of files in the folder, got {name!r}')
    return [(float(t), float(phi), float(theta), name) for t, phi, theta, name in rows]
