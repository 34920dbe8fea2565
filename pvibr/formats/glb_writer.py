"""Binary glTF 2.0: a document, its buffer, and the file that holds both."""

from __future__ import annotations

import json
import struct
from typing import Any

import numpy as np

from pvibr.core.files import replacing

_COMPONENTS = {'u1': 5121, 'u2': 5123, 'u4': 5125, 'f4': 5126}
_TYPES = {1: 'SCALAR', 2: 'VEC2', 3: 'VEC3', 4: 'VEC4', 16: 'MAT4'}


class GlbWriter:
    """A document that is filled part by part and written at once."""

    def __init__(self):
        self.document: dict[str, Any] = {'asset': {'version': '2.0', 'generator': 'pvibr'}}
        self._buffer = bytearray()

    def add(self, kind, thing):
        """Add something to one of the document's lists."""
        things = self.document.setdefault(kind, [])
        things.append(thing)
        return len(things) - 1

    def view(self, data):
        """Add bytes to the buffer."""
        start = len(self._buffer)
        self._buffer += data + bytes(-len(data) % 4)
        return self.add('bufferViews', {'buffer': 0, 'byteOffset': start, 'byteLength': len(data)})

    def accessor(self, values, limits=False):
        """Add an array."""
        values = np.asarray(values)
        values = values if values.dtype.kind == 'u' else values.astype(np.float32)
        accessor = _described(values)
        # Each vertex starts at a multiple of four bytes.
        padded = _padded(values)
        view = self.view(padded.tobytes())
        if padded.shape != values.shape:
            self.document['bufferViews'][view]['byteStride'] = padded[0].nbytes
        if limits:
            accessor |= _limits(values)
        return self.add('accessors', accessor | {'bufferView': view})

    def sparse(self, where, values, n):
        """Add an array that is zero but in some rows."""
        values = np.asarray(values, dtype=np.float32)
        rows = np.zeros((0 if len(values) == n else 1, values.shape[1]), np.float32)
        accessor = _described(values) | {'count': n} | _limits(np.concatenate([values, rows]))
        if len(values):
            indices = self.view(np.asarray(where).astype('<u4').tobytes())
            accessor['sparse'] = {
                'count': len(values),
                'indices': {'bufferView': indices, 'componentType': _COMPONENTS['u4']},
                'values': {'bufferView': self.view(values.tobytes())},
            }
        return self.add('accessors', accessor)

    def write(self, path):
        """Write the file, under another name first."""
        if self._buffer:
            self.document['buffers'] = [{'byteLength': len(self._buffer)}]
        text = json.dumps(self.document, separators=(',', ':'), allow_nan=False).encode()
        chunks = _chunk(b'JSON', text + b' ' * (-len(text) % 4))
        if self._buffer:
            chunks += _chunk(b'BIN\0', bytes(self._buffer))
        with replacing(path) as part:
            part.write_bytes(struct.pack('<4sII', b'glTF', 2, 12 + len(chunks)) + chunks)


def _described(values):
    width = 1 if values.ndim == 1 else values.shape[1]
    component = _COMPONENTS[values.dtype.str[1:]]
    return {'componentType': component, 'count': len(values), 'type': _TYPES[width]}


def _limits(values):
    rows = values.reshape(len(values), -1)
    return {'min': rows.min(0).tolist(), 'max': rows.max(0).tolist()}


def _padded(values):
    extra = -values.itemsize * values.shape[-1] % 4 if values.ndim == 2 else 0
    return np.pad(values, [(0, 0), (0, extra // values.itemsize)]) if extra else values


def _chunk(kind, data):
    return struct.pack('<I4s', len(data), kind) + data
