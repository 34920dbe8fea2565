"""What the header of a PLY file declares, and whether the file holds it: VTK's reader crashes."""

from __future__ import annotations

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
_OTHER_CORNERS = 'its faces must be of its {} points, got others'
#: Whether each byte may be of the text of numbers: NaN and infinity are.
_OF_NUMBERS = np.zeros(256, bool)
_OF_NUMBERS[[*b'0123456789+-.eEnNaAiIfFtTyY \t\r\n']] = True
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
    return _end_of_each(content, start, element, header)


def _end_of_each(content, start, element, header) -> int:
    """Return the same of records of several sizes."""
    lists, last_bytes = _lists_of(element, header.order)
    at, data, order = start, content.data, {'<': 'little', '>': 'big'}[header.order]
    steps = [(*own[:3], own[4].append) for own in lists]
    try:
        for _ in range(element.count):
            for bytes_before, width, item_bytes, note in steps:
                at += bytes_before
                note(at)
                count = data[at] if width == 1 else _integer(data, at, width, order)
                at += width + count * item_bytes
            at += last_bytes
        is_cut = at > len(data)
    except IndexError:
        is_cut = True
    if is_cut:
        raise ValueError(f'it is cut: its {len(data)} bytes end before its last {element.name}')
    for _, width, _, words, places in lists:
        kinds = [header.order + PLY_TYPES[name] for name in words[1:3]]
        places = np.array(places, np.int64)
        counts = _at(content, places, kinds[0])
        if len(counts) and counts.min() < 0:
            raise ValueError(f'a list of a {element.name} has {counts.min()} items')
        if element.name == 'face' and words[-1] in CORNERS:
            for k in range(int(counts.max(initial=0))):
                own = places[counts > k] + width + k * np.dtype(kinds[1]).itemsize
                _check_range(_at(content, own, kinds[1]), header.n_points)
    return at


def _lists_of(element, order) -> tuple[list[tuple], int]:
    """Return the lists of a record, and the bytes that follow the last one."""
    # Of each the bytes before it, those of its number of items and of an item, its words, and
    # where it starts in each record.
    lists: list[tuple] = []
    size = 0
    for words in element.properties:
        sizes = [
            np.dtype(order + PLY_TYPES[name]).itemsize for name in words[words[0] == 'list' : -1]
        ]
        if words[0] == 'list':
            lists.append((size, *sizes, words, []))
            size = 0
        else:
            size += sizes[0]
    return lists, size


def _integer(data, at, width, order) -> int:
    """Return a number of items; none is negative."""
    if at + width > len(data):
        raise IndexError
    return int.from_bytes(data[at : at + width], order)


def _at(content, places, kind) -> np.ndarray:
    """Return the numbers of a kind that start at some bytes."""
    count = len(content) - np.dtype(kind).itemsize + 1
    return np.ndarray((max(count, 0),), kind, content, strides=(1,))[places]


def _check_range(corners, n_points):
    if corners.size and not 0 <= corners.min() <= corners.max() < n_points:
        raise ValueError(_OTHER_CORNERS.format(n_points))


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
        _check_range(rows[name], n_points)


class Words:
    """The words of a text, by lines."""

    def __init__(self, text):
        self._text = np.append(text, np.uint8(10))
        is_word = np.concatenate([[False], self._text > 32])  # the last is a line's end
        changes = np.flatnonzero(is_word[1:] != is_word[:-1])
        self._starts, self._ends = changes[::2], changes[1::2]
        ends = np.flatnonzero(self._text == 10)
        #: Number of the first word of each line, and how many it has.
        self.first = np.searchsorted(self._starts, np.append(0, ends[:-1] + 1))
        self.counts = np.diff(np.append(self.first, len(self._starts)))
        #: Whether each line may be one of numbers.
        self.are_numbers = np.ones(len(ends), bool)
        self.are_numbers[np.searchsorted(ends, np.flatnonzero(~_OF_NUMBERS[text]))] = False

    def integers(self, words, digits=10) -> np.ndarray:
        """Return whole numbers, -1 for words that are none below a power of ten."""
        starts, lengths = self._starts[words], self._ends[words] - self._starts[words]
        numbers = np.where(lengths > digits, -1, 0)
        for k in range(min(int(lengths.max(initial=0)), digits)):
            is_digit = lengths > k
            own = self._text[np.minimum(starts + k, len(self._text) - 1)].astype(np.int64) - 48
            is_wrong = is_digit & ((own < 0) | (own > 9))
            numbers = np.where(is_digit & (numbers >= 0), 10 * numbers + own, numbers)
            numbers[is_wrong] = -1
        return numbers


def _check_lines(path, header):
    text = np.fromfile(path, np.uint8, offset=header.size)
    words, line = Words(text), 0
    line_count = len(words.counts) - (not words.counts[-1])
    for element in header.elements:
        count = min(element.count, line_count - line)
        is_right = _are_whole(words, slice(line, line + count), element, header.n_points)
        if not is_right.all():
            at = int(is_right.argmin())
            with path.open('rb') as file:
                file.seek(header.size)
                own = next(islice(file, line + at, None))
            raise ValueError(f'{element.name} {at} is wrong: {own[:60]!r}')
        if count < element.count:
            raise ValueError(f'it is cut: it has {count} of {element.count} {element.name}')
        line += count


def _are_whole(words, lines, element, n_points) -> np.ndarray:
    """Return whether lines have the values of an element."""
    first, counts = words.first[lines], words.counts[lines]
    read, is_right = np.zeros(len(first), np.int64), words.are_numbers[lines].copy()
    for own in element.properties:
        if own[0] != 'list':
            read += 1
            continue
        is_right &= read < counts
        items = np.zeros(len(first), np.int64)
        items[is_right] = words.integers(first[is_right] + read[is_right])
        is_right &= (items >= 0) & (read + items < counts)
        if own[-1] in CORNERS:
            for k in range(int(items[is_right].max(initial=0))):
                rows = np.flatnonzero(is_right & (items > k))
                corners = words.integers(first[rows] + read[rows] + 1 + k)
                is_right[rows] &= (corners >= 0) & (corners < n_points)
        read += 1 + items
    return is_right & (read <= counts)
