"""Binary, text, JSON and XML files, with errors that name file and place."""

from __future__ import annotations

import json
import math
import mmap
import struct
from collections.abc import Callable
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from xml.parsers import expat

import numpy as np

from pvibr.maths.lens_camera import LensCamera
from pvibr.maths.lenses import Lens
from pvibr.maths.pinhole import Pinhole

_MAX_DEPTH = 100  # levels of elements of an XML file


def fault(path, where, problem) -> ValueError:
    """Return an error that names a file and a place in it."""
    return ValueError(f'{path}, {where}: {problem}'[:1000])


class Place:
    """A line or a byte of a file, for errors."""

    def __init__(self, path, where):
        self.path, self.where = path, where

    def error(self, problem) -> ValueError:
        """Return an error at this place."""
        return fault(self.path, self.where, problem)

    @contextmanager
    def named(self):
        """Add the place to ValueErrors."""
        try:
            yield
        except ValueError as error:
            raise self.error(error) from None


class Cursor:
    """Reads a little-endian binary file, never past its end."""

    def __init__(self, path):
        self.path, self.at = Path(path), 0
        with self.path.open('rb') as file:
            empty = not file.seek(0, 2)
            self.data = b'' if empty else mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ)

    @property
    def place(self) -> Place:
        """The current position."""
        return Place(self.path, f'byte {self.at}')

    def _need(self, size):
        if size > len(self.data) - self.at:
            raise self.place.error(
                f'the file is truncated: expected {size} bytes, got {len(self.data) - self.at}'
            )

    def take(self, struct_format):
        """Read numbers by a :mod:`struct` format; return a single one as a scalar."""
        self._need(struct.calcsize('<' + struct_format))
        numbers = struct.unpack_from('<' + struct_format, self.data, self.at)
        if not all(math.isfinite(x) for x in numbers):
            raise self.place.error(f'numbers must be finite, got {numbers}')
        self.at += struct.calcsize('<' + struct_format)
        return numbers if len(numbers) > 1 else numbers[0]

    def count(self, entry_size, struct_format='Q') -> int:
        """Read a count of entries of a minimum size in bytes, which must fit into the file."""
        place, number = self.place, self.take(struct_format)
        if number * entry_size > len(self.data) - self.at:
            raise place.error(f'{number} entries are declared, more than the file can contain')
        return number

    def skip(self, size):
        """Skip bytes."""
        self._need(size)
        self.at += size

    def text(self, size=None) -> str:
        """Read text of a size in bytes, or up to a zero byte."""
        place, start = self.place, self.at
        if size is None:
            end = self.data.find(b'\0', start)
            if end < 0:
                raise place.error('a string is not terminated')
            self.at = end + 1
        else:
            self.skip(size)
            end = self.at
        return bytes(self.data[start:end]).decode('utf-8', 'surrogateescape')


class Line(Place):
    """A line of a text file."""

    def __init__(self, path, line_number, text):
        super().__init__(path, f'line {line_number}')
        self.number, self.text = line_number, text

    def numbers(self, tokens, count=None, kind=float) -> list:
        """Return finite numbers, as many as required."""
        try:
            numbers = [kind(token) for token in tokens]
        except (ValueError, OverflowError):
            numbers = [math.nan]
        if not all(math.isfinite(x) for x in numbers) or count not in (None, len(numbers)):
            expected = 'finite numbers' if count is None else f'{count} finite numbers'
            raise self.error(f'values must be {expected}, got {" ".join(tokens)!r:.80}')
        return numbers


def lines_of(path):
    """Yield the lines of a text file."""
    with Path(path).open(encoding='utf-8-sig', errors='surrogateescape') as file:
        for line_number, text in enumerate(file, start=1):
            yield Line(path, line_number, text.strip())


def data_lines(path):
    """Yield the lines that are neither empty nor comments."""
    return (line for line in lines_of(path) if line.text and line.text[0] != '#')


# -- JSON -------------------------------------------------------------------------------------


class Node(Place):
    """A value of a JSON file."""

    def __init__(self, path, value, trail=()):
        self.path, self.value, self.trail = path, value, trail

    @property
    def where(self) -> str:
        """The line and the path of keys; computed only for errors."""
        key_path = ''.join(f'.{k}' if isinstance(k, str) else f'[{k}]' for k in self.trail)
        key_path = key_path[-80:].lstrip('.') or 'root'
        return f'line {_line_of(self.path, self.trail)} ({key_path})'

    def _is(self, kinds, type_name):
        if not isinstance(self.value, kinds) or (
            isinstance(self.value, bool) and kinds is not bool
        ):
            raise self.error(f'value must be {type_name}, got {self.value!r:.60}')
        return self.value

    def get(self, key):
        """Return the value of a key, or None."""
        child = self._is(dict, 'an object').get(key)
        return None if child is None else Node(self.path, child, (*self.trail, key))

    def __getitem__(self, key):
        child = self.get(key)
        if child is None:
            raise self.error(f'{key!r} is missing')
        return child

    def items(self):
        """Yield keys and values of an object."""
        members = self._is(dict, 'an object').items()
        return ((key, Node(self.path, value, (*self.trail, key))) for key, value in members)

    def __iter__(self):
        children = self._is(list, 'a list')
        return (Node(self.path, v, (*self.trail, i)) for i, v in enumerate(children))

    def number(self) -> float:
        """Return a finite number."""
        try:
            number = float(self._is((int, float), 'a number'))
        except OverflowError:
            number = math.inf
        if not math.isfinite(number):
            raise self.error(f'value must be finite, got {number}')
        return number

    def whole(self) -> int:
        """Return a whole number."""
        number = self._is((int, float), 'a whole number')
        if not math.isfinite(number) or number != int(number):
            raise self.error(f'value must be a whole number, got {number}')
        return int(number)

    def text(self) -> str:
        """Return a string."""
        return self._is(str, 'a string')

    def numbers(self, count=None) -> list[float]:
        """Return a list of numbers, flattened."""
        numbers = list(_nested_numbers(self, 3))
        if count not in (None, len(numbers)):
            raise self.error(f'value must have {count} numbers, got {len(numbers)}')
        return numbers

    def value_of(self, key, default=0.0) -> float:
        """Return the number of a key, or a default."""
        node = self.get(key)
        return default if node is None else node.number()


def _nested_numbers(node, max_depth):
    """Yield the numbers of nested lists."""
    for child in node:
        if isinstance(child.value, list) and max_depth > 1:
            yield from _nested_numbers(child, max_depth - 1)
        else:
            yield child.number()


def json_of(path) -> Node:
    """Return the content of a JSON file."""
    path = Path(path)
    try:
        return Node(path, json.loads(_text_of(path)))
    except json.JSONDecodeError as error:
        raise fault(path, f'line {error.lineno}', error.msg) from None
    except (ValueError, RecursionError) as error:
        raise fault(path, 'line 1', f'not JSON ({error})') from None


def _text_of(path):
    return path.read_bytes().decode('utf-8-sig', 'replace')


def _line_of(path, trail) -> int:
    """Return the line of a value in a valid JSON file."""
    text, offset, decoder = _text_of(path), 0, json.JSONDecoder()

    def after_space(offset):
        while text[offset] in ' \t\r\n':
            offset += 1
        return offset

    offset = after_space(0)
    for key in trail:
        is_object, index, value_offset = text[offset] == '{', 0, offset
        offset = after_space(offset + 1)
        while text[offset] not in ']}':
            child_key = index
            if is_object:
                child_key, offset = decoder.raw_decode(text, offset)
                offset = after_space(after_space(offset) + 1)
            if child_key == key:
                value_offset = offset  # the last of duplicate keys counts
            _, offset = decoder.raw_decode(text, offset)
            offset, index = after_space(offset), index + 1
            if text[offset] == ',':
                offset = after_space(offset + 1)
        offset = value_offset
    return text.count('\n', 0, offset) + 1


# -- XML --------------------------------------------------------------------------------------


class Element(Line):
    """An element of an XML file."""

    def __init__(self, path, line_number, tag, attributes):
        super().__init__(path, line_number, '')
        self.tag, self.attributes, self.children = tag, attributes, []

    def find(self, tag):
        """Return the first child of a tag, or None."""
        return next((child for child in self.children if child.tag == tag), None)

    def all(self, tag):
        """Yield elements of a tag at any depth."""
        for child in self.children:
            if child.tag == tag:
                yield child
            yield from child.all(tag)

    def value(self, tag, default=0.0) -> float:
        """Return the number of a child."""
        child = self.find(tag)
        return default if child is None else child.numbers(child.text.split(), 1)[0]

    def values(self, count) -> list[float]:
        """Return the numbers in its text."""
        return self.numbers(self.text.split(), count)

    def get(self, name) -> str:
        """Return an attribute."""
        if name not in self.attributes:
            raise self.error(f'<{self.tag}> has no {name!r}')
        return self.attributes[name]


def xml_of(path) -> Element:
    """Return the root of an XML file; document types, and so entities, are refused."""
    path = Path(path)
    document = Element(path, 1, '', {})
    open_elements, parser = [document], expat.ParserCreate()
    parser.buffer_text = True

    def start(tag, attributes):
        element = Element(path, parser.CurrentLineNumber, tag, attributes)
        if len(open_elements) > _MAX_DEPTH:
            raise element.error(f'elements must be nested at most {_MAX_DEPTH} deep')
        open_elements[-1].children.append(element)
        open_elements.append(element)

    def end(_tag):
        open_elements.pop()

    def text(part):
        open_elements[-1].text += part

    def refuse(*_):
        raise fault(path, f'line {parser.CurrentLineNumber}', 'document types are not allowed')

    parser.StartElementHandler, parser.EndElementHandler = start, end
    parser.CharacterDataHandler, parser.StartDoctypeDeclHandler = text, refuse
    try:
        parser.Parse(path.read_bytes(), True)
    except expat.ExpatError as error:
        raise fault(path, f'line {error.lineno}', expat.errors.messages[error.code]) from None
    except (LookupError, ValueError) as error:
        if isinstance(error, ValueError) and str(path) in str(error):
            raise
        raise fault(path, 'line 1', f'not XML ({error})') from None
    return document.children[0]


def similarity(matrix, name):
    """Return the rotation nearest to a matrix, and its uniform scale."""
    u, s, vt = np.linalg.svd(matrix)
    if not s[2] > 0 or s[0] / s[2] - 1 > 2e-3 or np.linalg.det(u @ vt) < 0:
        raise ValueError(f'{name} must be a rotation, perhaps scaled, got {matrix.tolist()}')
    return u @ vt, float(np.cbrt(s.prod()))


def camera_of(place, K, pose, size, distortion=(), lens: Lens | None = None):
    """Return the camera of a file's numbers; errors name the place."""
    R, t = pose
    with place.named():
        R, _ = similarity(R, 'the rotation')
        if lens is None:
            return Pinhole(K, R, t, size, distortion)
        return LensCamera(K, R, t, size, lens)


def pinhole_matrix(fx, fy, cx, cy, skew=0.0) -> np.ndarray:
    """Return K."""
    return np.array([[fx, skew, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]])


def posed(place, R, position):
    """Return rotation and translation of a camera at a position; errors name the place."""
    with place.named():
        R, _ = similarity(np.reshape(R, (3, 3)), 'the rotation')
    return R, -R @ np.asarray(position, float)


@dataclass(frozen=True)
class Entry:
    """A camera in a file; `make` returns it for the size of its picture."""

    place: Place
    name: str
    size: tuple | None
    make: Callable[[tuple], Any]
    crs: str | None = None
