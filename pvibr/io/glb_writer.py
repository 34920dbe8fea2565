"""Writing of binary glTF 2.0."""

from __future__ import annotations

import io
import json
import struct
from typing import Any

import numpy as np

from pvibr.core.files import replacing

_COMPONENTS = {'u1': 5121, 'u2': 5123, 'u4': 5125, 'f4': 5126}
_UNLIT = 'KHR_materials_unlit'
#: Sampler settings, as GL enums CLAMP_TO_EDGE, NEAREST and LINEAR.
CLAMPED = {'wrapS': 33071, 'wrapT': 33071}
NEAREST, LINEAR = {'magFilter': 9728}, {'magFilter': 9729}
_TYPES = {1: 'SCALAR', 2: 'VEC2', 3: 'VEC3', 4: 'VEC4', 16: 'MAT4'}


class GlbWriter:
    """A document and its buffer, filled incrementally and written at once."""

    def __init__(self):
        self.document: dict[str, Any] = {'asset': {'version': '2.0', 'generator': 'pvibr'}}
        self._buffer = bytearray()

    def add(self, list_name, item):
        """Append an item to a list of the document; return its index."""
        items = self.document.setdefault(list_name, [])
        items.append(item)
        return len(items) - 1

    def view(self, data):
        """Add a buffer view of bytes; return its index."""
        start = len(self._buffer)
        self._buffer += data + bytes(-len(data) % 4)
        return self.add('bufferViews', {'buffer': 0, 'byteOffset': start, 'byteLength': len(data)})

    def accessor(self, values, limits=False):
        """Add an array; return its index."""
        values = np.asarray(values)
        values = values if values.dtype.kind == 'u' else values.astype(np.float32)
        accessor = _described(values)
        # Vertices must start at multiples of four bytes.
        padded = _padded(values)
        view = self.view(padded.tobytes())
        if padded.shape != values.shape:
            self.document['bufferViews'][view]['byteStride'] = padded[0].nbytes
        if limits:
            accessor |= _limits(values)
        return self.add('accessors', accessor | {'bufferView': view})

    def primitive(self, points, faces, *, normals=None, coordinates=None, **attributes) -> dict:
        """Add the arrays of a primitive; return it."""
        arrays = {'POSITION': self.accessor(points, limits=True)}
        if normals is not None:
            arrays['NORMAL'] = self.accessor(normals)
        if coordinates is not None:  # glTF's v points down
            arrays['TEXCOORD_0'] = self.accessor(coordinates[:, :2] * [1, -1] + [0, 1])
        indices = self.accessor(np.asarray(faces).astype(np.uint32).reshape(-1))
        arrays |= {name: self.accessor(values) for name, values in attributes.items()}
        return {'attributes': arrays, 'indices': indices}

    def texture(self, image, sampler=None, *, optimize=False):
        """Add an image as PNG and its texture; equal samplers are shared."""
        from PIL import Image

        stream = io.BytesIO()
        Image.fromarray(np.asarray(image)).save(stream, 'PNG', optimize=optimize)
        view = self.view(stream.getvalue())
        texture = {'source': self.add('images', {'bufferView': view, 'mimeType': 'image/png'})}
        if sampler is not None:
            known_samplers = self.document.get('samplers', [])
            shared = (
                known_samplers.index(sampler)
                if sampler in known_samplers
                else self.add('samplers', sampler)
            )
            texture['sampler'] = shared
        return self.add('textures', texture)

    def material(
        self, reflection, *, cutoff=None, blends=False, two_sided=False, lit=True, **textures
    ):
        """Add a metallic-roughness material."""
        material = {'pbrMetallicRoughness': reflection, **textures}
        if cutoff is not None:
            material |= {'alphaMode': 'MASK', 'alphaCutoff': float(cutoff)}
        elif blends:
            material['alphaMode'] = 'BLEND'
        if two_sided:
            material['doubleSided'] = True
        if not lit:
            material['extensions'] = {_UNLIT: {}}
            self.document['extensionsUsed'] = [_UNLIT]
        return self.add('materials', material)

    def scene(self, nodes, **named):
        """Add the default scene, with root nodes."""
        self.document['scene'] = self.add('scenes', ({'nodes': nodes} if nodes else {}) | named)

    def sparse(self, where, values, n):
        """Add an array of n rows that is zero except in the rows `where`."""
        values = np.asarray(values, dtype=np.float32)
        zero_row = np.zeros((0 if len(values) == n else 1, values.shape[1]), np.float32)
        accessor = _described(values) | {'count': n} | _limits(np.concatenate([values, zero_row]))
        if len(values):
            indices = self.view(np.asarray(where).astype('<u4').tobytes())
            accessor['sparse'] = {
                'count': len(values),
                'indices': {'bufferView': indices, 'componentType': _COMPONENTS['u4']},
                'values': {'bufferView': self.view(values.tobytes())},
            }
        return self.add('accessors', accessor)

    def write(self, path):
        """Write the file atomically."""
        if self._buffer:
            self.document['buffers'] = [{'byteLength': len(self._buffer)}]
        text = json.dumps(self.document, separators=(',', ':'), allow_nan=False).encode()
        chunks = _chunk(b'JSON', text + b' ' * (-len(text) % 4))
        if self._buffer:
            chunks += _chunk(b'BIN\0', bytes(self._buffer))
        with replacing(path) as part_path:
            part_path.write_bytes(struct.pack('<4sII', b'glTF', 2, 12 + len(chunks)) + chunks)


def _described(values):
    width = 1 if values.ndim == 1 else values.shape[1]
    component = _COMPONENTS[values.dtype.str[1:]]
    return {'componentType': component, 'count': len(values), 'type': _TYPES[width]}


def _limits(values):
    value_rows = values.reshape(len(values), -1)
    return {'min': value_rows.min(0).tolist(), 'max': value_rows.max(0).tolist()}


def _padded(values):
    extra = -values.itemsize * values.shape[-1] % 4 if values.ndim == 2 else 0
    return np.pad(values, [(0, 0), (0, extra // values.itemsize)]) if extra else values


def _chunk(chunk_type, data):
    return struct.pack('<I4s', len(data), chunk_type) + data
