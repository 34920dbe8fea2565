"""Files of named arrays, written in pieces and mapped into memory, each with its checksum."""

from __future__ import annotations

import json
import struct
import zlib
from pathlib import Path
from typing import Any

import numpy as np

from pvibr.core.files import replacing
from pvibr.instances.cache import Entry
from pvibr.large.columns import PIECE_BYTES

_MAGIC = b'pvibrL01'
#: Of the magic, place, length and checksum of the table.
_HEAD = struct.Struct('<8sQQI')
_ALIGN = 64


def write_checked(path: Path, arrays: dict[str, list], meta: dict[str, Any]):
    """Write arrays by name, each the rows of several one after the other, and metadata."""
    table = {}
    with replacing(path) as part, part.open('xb') as file:
        file.write(bytes(_ALIGN))
        for name, parts in arrays.items():
            file.write(bytes(-file.tell() % _ALIGN))
            table[name] = _written(file, parts)
        place = file.tell()
        header = json.dumps({'arrays': table, 'meta': meta}).encode()
        file.write(header)
        file.seek(0)
        file.write(_HEAD.pack(_MAGIC, place, len(header), zlib.crc32(header)))


def _written(file, parts) -> tuple:
    """Write an array; return its type, shape, place and checksum."""
    place, checksum, length, first = file.tell(), 0, 0, np.asarray(parts[0][:0])
    row_bytes = first.dtype.itemsize * int(np.prod(first.shape[1:], dtype=np.int64))
    step = max(PIECE_BYTES // max(row_bytes, 1), 1)
    for rows in parts:
        for start in range(0, len(rows), step):
            piece = np.ascontiguousarray(rows[start : start + step])
            content = piece.reshape(-1).view(np.uint8).data
            checksum = zlib.crc32(content, checksum)
            file.write(content)
        length += len(rows)
    return first.dtype.str, (length, *first.shape[1:]), place, checksum


def open_checked(path: Path) -> Entry:
    """Return the arrays of a file, mapped into memory, once each was read and found whole."""
    header = _table_of(path)
    with path.open('rb') as file:
        for name, (dtype, shape, place, checksum) in header['arrays'].items():
            size = np.dtype(dtype).itemsize * int(np.prod(shape, dtype=np.int64))
            if _checksum_of(file, place, size) != checksum:
                raise ValueError(f'its array {name!r} is damaged: its checksum differs')
    return map_arrays(path)


def map_arrays(path: Path) -> Entry:
    """Return the arrays of a file, mapped into memory."""
    header = _table_of(path)
    arrays = {
        name: _mapped(path, np.dtype(dtype), place, tuple(shape))
        for name, (dtype, shape, place, _) in header['arrays'].items()
    }
    return Entry(arrays, header['meta'])


def _mapped(path, dtype, place, shape) -> np.ndarray:
    if not np.prod(shape):  # nothing cannot be mapped
        return np.zeros(shape, dtype)
    return np.memmap(path, dtype, 'r', place, shape)


def _checksum_of(file, place, size) -> int:
    checksum = 0
    file.seek(place)
    while size > 0:
        content = file.read(min(size, PIECE_BYTES))
        if not content:
            return -1
        checksum, size = zlib.crc32(content, checksum), size - len(content)
    return checksum


def _table_of(path) -> dict[str, Any]:
    """Return the table of a file, and its metadata."""
    size = path.stat().st_size
    with path.open('rb') as file:
        head = file.read(_HEAD.size)
        if len(head) < _HEAD.size:
            raise ValueError(f'it is cut: it has {size} bytes')
        magic, place, length, checksum = _HEAD.unpack(head)
        if magic != _MAGIC:
            raise ValueError('it is not a file of this version of pvibr')
        if place + length != size:
            raise ValueError(f'it has {size} bytes instead of {place + length}: it is cut')
        file.seek(place)
        header = file.read(length)
    if zlib.crc32(header) != checksum:
        raise ValueError('its table of arrays is damaged: its checksum differs')
    return dict(json.loads(header))
