"""What the header of a PLY file declares, and whether the file holds it: VTK's reader crashes."""

from __future__ import annotations

import mmap
from dataclasses import dataclass
from itertools import islice
from pathlib import Path

import numpy as np

#: Names of types in PLY headers, old and new, as numpy's.
PLY_TYPES = {
    'char': 'i1', 'uchar': 'u1', 'short': 'i2', 'ushort': 'u2', 'int': 'i4', 'uint': 'u4',
    'float': 'f4', 'double': 'f8', 'int8': 'i1', 'uint8': 'u1', 'int16': 'i2', 'uint16': 'u2',
    'int32': 'i4', 'uint32': 'u4', 'float32': 'f4', 'float64': 'f8',
}  # fmt: skip
_ORDERS = {'binary_little_endian': '<', 'binary_big_endian': '>', 'ascii': ''}
#: Bytes at most in which a header ends.
_HEADER_BYTES = 1 << 16
#: Names of the list of a face's corners.
CORNERS = 'vertex_indices', 'vertex_index'


@dataclass
class PlyElement:
    """Records of one kind that a file declares."""

    name: str
    count: int
    #: The words of each property: type and name, or list, types of count and items, and name.
    properties: list[list[str]]

    @property
    def is_valid(self) -> bool:
        """Whether all properties are of types that there are."""
        return all(
            len(words) == (4 if words[0] == 'list' else 2)
            and {*words[words[0] == 'list' : -1]} <= {*PLY_TYPES}
            for words in self.properties
        )


@dataclass
class PlyHeader:
    """What a PLY file declares."""

    #: numpy's sign of the order of bytes, empty for text.
    order: str
    elements: list[PlyElement]
    #: Bytes of the header.
    size: int


def ply_header(path: Path) -> PlyHeader:
    """Return the header of a PLY file; raise a ValueError if there is none."""
    with path.open('rb') as file:
        head = file.read(_HEADER_BYTES)
    mark = head.find(b'end_header')
    end = head.find(b'\n', mark) + 1
    rows = [line.split() for line in head[: max(mark, 0)].decode('latin-1').splitlines()]
    rows = [words for words in rows if words]
    if mark < 0 or not end or rows[0] != ['ply']:
        raise ValueError('it has no header of a PLY file')
    order: str | None = None
    elements: list[PlyElement] = []
    for words in rows[1:]:
        if words[0] == 'format' and len(words) > 1:
            order = _ORDERS.get(words[1])
        elif words[0] == 'element' and len(words) == 3 and words[2].isdecimal():
            elements.append(PlyElement(words[1], int(words[2]), []))
        elif words[0] == 'property' and len(words) > 2 and elements:
            elements[-1].properties.append(words[1:])
        elif words[0] not in ('comment', 'obj_info'):
            raise ValueError(f'its header has a line that is wrong: {" ".join(words)!r}')
    if order is None or not all(element.is_valid for element in elements):
        raise ValueError('its header has no format, or properties of unknown types')
    return PlyHeader(order, elements, end)


def check_ply(path: Path):
    """Raise a ValueError unless a PLY file holds what it declares."""
    header = ply_header(path)
    for element in header.elements:
        lists = [words[-1] for words in element.properties if words[0] == 'list']
        if element.name == 'face' and not {*lists} & {*CORNERS}:
            raise ValueError('its faces have no list vertex_indices')
    if header.order:
        _check_bytes(path, header)
    else:
        _check_lines(path, header)


def _check_bytes(path, header):
    with path.open('rb') as file, mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as content:
        size, at = len(content), header.size
        for element in header.elements:
            at = _end_of(content, at, element, header.order)
            if at > size:
                raise ValueError(
                    f'it is cut: it has {size} bytes, too few for each {element.name}'
                )


def _end_of(content, start, element, order) -> int:
    """Return where the records of an element end, or a place beyond the file."""
    # Between lists, the bytes of other properties; a list is the type of its count, and a size.
    steps, gap, size = [], 0, len(content)
    for words in element.properties:
        if words[0] == 'list':
            count_type = np.dtype(order + PLY_TYPES[words[1]])
            steps.append((gap, count_type, np.dtype(PLY_TYPES[words[2]]).itemsize))
            gap = 0
        else:
            gap += np.dtype(PLY_TYPES[words[0]]).itemsize
    if not steps:
        return start + element.count * gap
    at = start
    for _ in range(element.count):
        for before, count_type, item_bytes in steps:
            at += before
            if at + count_type.itemsize > size:
                return size + 1
            if count_type.itemsize == 1:
                count = content[at]
            else:
                count = int(np.frombuffer(content[at : at + count_type.itemsize], count_type)[0])
            if count < 0:
                raise ValueError(f'a list of a {element.name} has {count} items')
            at += count_type.itemsize + count * item_bytes
        at += gap
    return at


def _check_lines(path, header):
    with path.open('rb') as file:
        file.seek(header.size)
        for element in header.elements:
            read = 0
            for line in islice(file, element.count):
                read += 1
                if not _holds(line.split(), element.properties):
                    raise ValueError(f'{element.name} {read - 1} is wrong: {line[:60]!r}')
            if read < element.count:
                raise ValueError(f'it is cut: it has {read} of {element.count} {element.name}')


def _holds(words, properties) -> bool:
    """Return True if the words of a line are the values of properties."""
    at = 0
    try:
        for own in properties:
            count = int(words[at]) if own[0] == 'list' else 0
            at += 1 + count
            if count < 0:
                return False
        for word in words[:at]:
            float(word)
    except (IndexError, ValueError):
        return False
    return at <= len(words)
