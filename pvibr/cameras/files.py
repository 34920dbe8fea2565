"""Binary, text, JSON and XML files whose errors name the file and the place in it."""

from __future__ import annotations

import json
import math
import mmap
import struct
from contextlib import contextmanager
from pathlib import Path
from xml.parsers import expat

_DEEPEST = 100  # levels of elements of an XML file


def fault(path, where, what) -> ValueError:
    """Return an error that names a file and a place in it."""
    return ValueError(f'{path}, {where}: {what}'[:1000])


class Place:
    """A line or a byte of a file, for errors."""

    def __init__(self, path, where):
        self.path, self.where = path, where

    def error(self, what) -> ValueError:
        """Return an error about what is here."""
        return fault(self.path, self.where, what)

    @contextmanager
    def named(self):
        """Have errors of values name the place."""
        try:
            yield
        except ValueError as error:
            raise self.error(error) from None


class Cursor:
    """Reads a binary little-endian file; never past its end, whatever its counts say."""

    def __init__(self, path):
        self.path, self.at = Path(path), 0
        with self.path.open('rb') as file:
            empty = not file.seek(0, 2)
            self.data = b'' if empty else mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ)

    @property
    def place(self) -> Place:
        """Where it is."""
        return Place(self.path, f'byte {self.at}')

    def _need(self, size):
        if size > len(self.data) - self.at:
            raise self.place.error(
                f'the file is cut: {size} bytes are expected, {len(self.data) - self.at} are left'
            )

    def take(self, form):
        """Return numbers by :mod:`struct`, a single one by itself."""
        self._need(struct.calcsize('<' + form))
        found = struct.unpack_from('<' + form, self.data, self.at)
        if not all(math.isfinite(x) for x in found):
            raise self.place.error(f'{found} has a number that is not finite')
        self.at += struct.calcsize('<' + form)
        return found if len(found) > 1 else found[0]

    def count(self, least, form='Q') -> int:
        """Return a count of things of at least some bytes, which must fit into the file."""
        place, number = self.place, self.take(form)
        if number * least > len(self.data) - self.at:
            raise place.error(
                f'{number} entries are announced, of which the file cannot hold as many'
            )
        return number

    def skip(self, size):
        """Move on by some bytes."""
        self._need(size)
        self.at += size

    def text(self, size=None) -> str:
        """Return text of a size in bytes, or up to a zero byte."""
        place, start = self.place, self.at
        if size is None:
            end = self.data.find(b'\0', start)
            if end < 0:
                raise place.error('a text has no end')
            self.at = end + 1
        else:
            self.skip(size)
            end = self.at
        return bytes(self.data[start:end]).decode('utf-8', 'surrogateescape')


class Line(Place):
    """A line of a text file."""

    def __init__(self, path, number, text):
        super().__init__(path, f'line {number}')
        self.number, self.text = number, text

    def numbers(self, tokens, count=None, kind=float) -> list:
        """Return finite numbers, as many as asked for."""
        try:
            found = [kind(token) for token in tokens]
        except (ValueError, OverflowError):
            found = [math.nan]
        if not all(math.isfinite(x) for x in found) or count not in (None, len(found)):
            raise self.error(f'{" ".join(tokens)!r:.80} should be {count or ""} finite numbers')
        return found


def lines_of(path):
    """Yield the lines of a text file."""
    with Path(path).open(encoding='utf-8-sig', errors='surrogateescape') as file:
        for number, text in enumerate(file, start=1):
            yield Line(path, number, text.strip())


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
        """The line and the way to it; looked up only for errors."""
        way = ''.join(f'.{k}' if isinstance(k, str) else f'[{k}]' for k in self.trail)
        return f'line {_line_of(self.path, self.trail)} ({way[-80:].lstrip(".") or "the whole"})'

    def _is(self, kinds, what):
        if not isinstance(self.value, kinds) or (
            isinstance(self.value, bool) and kinds is not bool
        ):
            raise self.error(f'{self.value!r:.60} should be {what}')
        return self.value

    def get(self, key):
        """Return the value of a key, or None."""
        found = self._is(dict, 'an object').get(key)
        return None if found is None else Node(self.path, found, (*self.trail, key))

    def __getitem__(self, key):
        found = self.get(key)
        if found is None:
            raise self.error(f'there is no {key!r}')
        return found

    def items(self):
        """Yield keys and values of an object."""
        return ((key, Node(self.path, v, (*self.trail, key))) for key, v in self._object().items())

    def _object(self):
        return self._is(dict, 'an object')

    def __iter__(self):
        found = self._is(list, 'a list')
        return (Node(self.path, v, (*self.trail, i)) for i, v in enumerate(found))

    def number(self) -> float:
        """Return a finite number."""
        try:
            found = float(self._is((int, float), 'a number'))
        except OverflowError:
            found = math.inf
        if not math.isfinite(found):
            raise self.error(f'{found} should be finite')
        return found

    def whole(self) -> int:
        """Return a whole number."""
        found = self._is((int, float), 'a whole number')
        if not math.isfinite(found) or found != int(found):
            raise self.error(f'{found} should be a whole number')
        return int(found)

    def text(self) -> str:
        """Return a text."""
        return self._is(str, 'a text')

    def numbers(self, count=None) -> list[float]:
        """Return a list of numbers, nested ones in a row."""
        found = list(_flat(self, 3))
        if count not in (None, len(found)):
            raise self.error(f'there are {len(found)} numbers; {count} are needed')
        return found

    def value_of(self, key, default=0.0) -> float:
        """Return the number of a key, or a default."""
        node = self.get(key)
        return default if node is None else node.number()


def _flat(node, deep):
    """Yield the numbers of nested lists."""
    for child in node:
        if isinstance(child.value, list) and deep > 1:
            yield from _flat(child, deep - 1)
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
        raise fault(path, 'line 1', f'it is no JSON ({error})') from None


def _text_of(path):
    return path.read_bytes().decode('utf-8-sig', 'replace')


def _line_of(path, trail) -> int:
    """Return the line of a value of a JSON file that can be read."""
    text, at, decoder = _text_of(path), 0, json.JSONDecoder()

    def after_space(at):
        while text[at] in ' \t\r\n':
            at += 1
        return at

    at = after_space(0)
    for key in trail:
        inside, at, index, found = text[at] == '{', after_space(at + 1), 0, at
        while text[at] not in ']}':
            name = index
            if inside:
                name, at = decoder.raw_decode(text, at)
                at = after_space(after_space(at) + 1)
            if name == key:
                found = at  # of equal keys the last counts
            _, at = decoder.raw_decode(text, at)
            at, index = after_space(at), index + 1
            if text[at] == ',':
                at = after_space(at + 1)
        at = found
    return text.count('\n', 0, at) + 1


# -- XML --------------------------------------------------------------------------------------


class Element(Line):
    """An element of an XML file."""

    def __init__(self, path, number, tag, attributes):
        super().__init__(path, number, '')
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
        """Return its numbers."""
        return self.numbers(self.text.split(), count)

    def get(self, name) -> str:
        """Return an attribute."""
        if name not in self.attributes:
            raise self.error(f'<{self.tag}> has no {name!r}')
        return self.attributes[name]


def xml_of(path) -> Element:
    """Return the root of an XML file; one that declares entities or a document type is refused."""
    path = Path(path)
    top = Element(path, 1, '', {})
    open_, parser = [top], expat.ParserCreate()
    parser.buffer_text = True

    def start(tag, attributes):
        element = Element(path, parser.CurrentLineNumber, tag, attributes)
        if len(open_) > _DEEPEST:
            raise element.error(f'elements are nested deeper than {_DEEPEST}')
        open_[-1].children.append(element)
        open_.append(element)

    def end(_tag):
        open_.pop()

    def text(part):
        open_[-1].text += part

    def refuse(*_):
        raise fault(path, f'line {parser.CurrentLineNumber}', 'it declares a document type')

    parser.StartElementHandler, parser.EndElementHandler = start, end
    parser.CharacterDataHandler, parser.StartDoctypeDeclHandler = text, refuse
    try:
        parser.Parse(path.read_bytes(), True)
    except expat.ExpatError as error:
        raise fault(path, f'line {error.lineno}', expat.errors.messages[error.code]) from None
    except (LookupError, ValueError) as error:
        if isinstance(error, ValueError) and str(path) in str(error):
            raise
        raise fault(path, 'line 1', f'it is no XML ({error})') from None
    return top.children[0]
