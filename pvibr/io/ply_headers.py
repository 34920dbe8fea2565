"""What the header of a PLY file declares, and whether the file holds it: VTK's reader crashes."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from struct import calcsize, unpack_from
from struct import error as struct_error

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
_OTHER_CORNERS = 'its faces must be of its {} points, got others'
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

    @property
    def n_points(self) -> int:
        """Number of points that faces may have as corners."""
        return sum(element.count for element in self.elements if element.name == 'vertex')


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
    content, at = np.memmap(path, mode='r'), header.size
    for element in header.elements:
        at = _end_of(content, at, element, header)


def _end_of(content, start, element, header) -> int:
    """Return where the records of an element end, once they are found to be right."""
    record = _record_at(content, start, element, header.order)
    end = start + element.count * record.itemsize
    if element.count and record.itemsize and end <= len(content):
        rows = np.frombuffer(content, record, element.count, start)
        if _are_alike(rows):  # as in most files
            _check_corners(rows, element, header.n_points)
            return end
    return _end_of_each(content.data, start, element, header)


def _end_of_each(content, start, element, header) -> int:
    """Return the same of records of several sizes."""
    steps = [
        (
            [header.order + np.dtype(PLY_TYPES[n]).char for n in words[words[0] == 'list' : -1]],
            words[0] == 'list',
            header.n_points if element.name == 'face' and words[-1] in CORNERS else None,
        )
        for words in element.properties
    ]
    at = start
    try:
        for _ in range(element.count):
            for kinds, is_list, n_points in steps:
                count = unpack_from(kinds[0], content, at)[0] if is_list else 1
                at += calcsize(kinds[0]) * is_list
                items = unpack_from(f'{kinds[-1][:1]}{count}{kinds[-1][1:]}', content, at)
                at += calcsize(kinds[-1]) * count
                if n_points is not None and items and not 0 <= min(items) <= max(items) < n_points:
                    raise ValueError(_OTHER_CORNERS.format(n_points))
    except struct_error as error:
        size = len(content)
        message = f'it is cut: its {size} bytes end before its last {element.name}'
        raise ValueError(message) from error
    return at


def _record_at(content, at, element, order) -> np.dtype:
    """Return the type of the record at a place; of size 0 if it is not whole."""
    fields: list[tuple] = []
    size = 0
    for words in element.properties:
        kinds = [np.dtype(order + PLY_TYPES[name]) for name in words[words[0] == 'list' : -1]]
        if words[0] != 'list':
            fields.append((words[-1], kinds[0]))
            size += kinds[0].itemsize
            continue
        if at + size + kinds[0].itemsize > len(content):
            return np.dtype([])
        count = int(np.frombuffer(content, kinds[0], 1, at + size)[0])
        if count < 0:
            raise ValueError(f'a list of a {element.name} has {count} items')
        size += kinds[0].itemsize + count * kinds[1].itemsize
        if at + size > len(content):
            return np.dtype([])
        fields += [(f'number of {words[-1]}', kinds[0]), (words[-1], kinds[1], (count,))]
    return np.dtype(fields)


def _are_alike(rows) -> bool:
    """Return True if the lists of all records are as long as those of the first one."""
    return all(
        (rows[name] == rows.dtype[name.removeprefix('number of ')].shape[0]).all()
        for name in rows.dtype.names
        if name.startswith('number of ')
    )


def _check_corners(rows, element, n_points):
    for name in {*CORNERS} & {*rows.dtype.names} if element.name == 'face' else ():
        corners = rows[name]
        if corners.size and not 0 <= corners.min() <= corners.max() < n_points:
            raise ValueError(_OTHER_CORNERS.format(n_points))


def _check_lines(path, header):
    with path.open('rb') as file:
        file.seek(header.size)
        for element in header.elements:
            read = 0
            for line in islice(file, element.count):
                read += 1
                if not _holds(line.split(), element, header.n_points):
                    raise ValueError(f'{element.name} {read - 1} is wrong: {line[:60]!r}')
            if read < element.count:
                raise ValueError(f'it is cut: it has {read} of {element.count} {element.name}')


def _holds(words, element, n_points) -> bool:
    """Return True if the words of a line are the values of an element."""
    at = 0
    try:
        for own in element.properties:
            count = int(words[at]) if own[0] == 'list' else 0
            items = words[at : at + 1 + count]
            at += 1 + count
            if count < 0 or len(items) <= count:
                return False
            if own[-1] in CORNERS:
                if not all(0 <= int(corner) < n_points for corner in items[1:]):
                    return False
            else:
                for item in items:
                    float(item)
    except (IndexError, ValueError):
        return False
    return True
