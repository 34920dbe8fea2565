"""Whether old files of VTK hold the cells that they declare: VTK's reader crashes if not."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from pvibr.io.ply_headers import Words

#: What precedes cells; since version 5 they are read as arrays, whose lengths VTK checks itself.
_KEYWORDS = b'VERTICES', b'LINES', b'POLYGONS', b'TRIANGLE_STRIPS', b'CELLS'
_COUNTS = re.compile(rb'[A-Z_]+[ \t]+(\d+)[ \t]+(\d+)[ \t]*\r?\n')
_VERSION = re.compile(rb'# vtk DataFile Version (\d+)\.')
_CHECKED_SINCE = 5


def check_legacy(path: Path):
    """Raise a ValueError unless the cells of a legacy VTK file are those that it declares."""
    with path.open('rb') as file:
        head = file.read(1024)
    version = _VERSION.match(head)
    if version is None:
        raise ValueError('it has no header of a VTK file')
    if int(version[1]) >= _CHECKED_SINCE:
        return
    content = path.read_bytes()
    is_text = b'ASCII' in b' '.join(head.upper().split(b'\n')[2:3])
    for keyword in _KEYWORDS:
        at = content.find(b'\n' + keyword)
        while at >= 0:
            counts = _COUNTS.match(content, at + 1)
            if counts:
                count, size = int(counts[1]), int(counts[2])
                if not _are_cells(_numbers(content, counts.end(), size, is_text), count, size):
                    raise ValueError(f'its {count} {keyword.decode().lower()} are cut, or wrong')
            at = content.find(b'\n' + keyword, at + 1)


def _numbers(content, start, size, is_text) -> np.ndarray:
    """Return whole numbers that start at a byte, fewer where there are not so many."""
    if not is_text:
        return np.frombuffer(content, '>i4', min(size, (len(content) - start) // 4), start)
    words = Words(np.frombuffer(content, np.uint8, offset=start))
    return words.integers(np.arange(min(size, words.counts.sum())))


def _are_cells(numbers, count, size) -> bool:
    """Return True if numbers are those of cells: of each its number of points, and these."""
    if len(numbers) != size:
        return False
    if count and size % count == 0 and (numbers[:: size // count] == size // count - 1).all():
        return True
    at, values = 0, numbers.tolist()
    for _ in range(count):
        if not 0 <= at < size or values[at] < 0:
            return False
        at += 1 + values[at]
    return at == size
