"""Binary glTF 2.0: a document, its buffer, and the file that holds both."""

from __future__ import annotations

import io
import json
import struct
from typing import Any

import numpy as np

from pvibr.core.files import replacing

_COMPONENTS = {'u1': 5121, 'u2': 5123, 'u4': 5125, 'f4': 5126}
_UNLIT = 'KHR_materials_unlit'
#: Of a sampler: GL enums CLAMP_TO_EDGE, NEAREST and LINEAR.
CLAMPED = {'wrapS': 33071, 'wrapT': 33071}
NEAREST, LINEAR = {'magFilter': 9728}, {'magFilter': 9729}
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

    def primitive(self, points, faces, *, normals=None, coordinates=None, **attributes) -> dict:
        """Add arrays of a mesh; return the part of a mesh that has them."""
        own = {'POSITION': self.accessor(points, limits=True)}
        if normals is not None:
            own['NORMAL'] = self.accessor(normals)
        if coordinates is not None:
            own['TEXCOORD_0'] = self.accessor(
                coordinates[:, :2] * [1, -1] + [0, 1]
            )  # rows go down
        indices = self.accessor(np.asarray(faces).astype(np.uint32).reshape(-1))
        own |= {name: self.accessor(values) for name, values in attributes.items()}
        return {'attributes': own, 'indices': indices}

    def texture(self, image, sampler=None, *, optimize=False):
        """Add an image as PNG and a texture of it; equal samplers are shared."""
        from PIL import Image

        stream = io.BytesIO()
        Image.fromarray(np.asarray(image)).save(stream, 'PNG', optimize=optimize)
        view = self.view(stream.getvalue())
        texture = {'source': self.add('images', {'bufferView': view, 'mimeType': 'image/png'})}
        if sampler is not None:
            known = self.document.get('samplers', [])
            shared = known.index(sampler) if sampler in known else self.add('samplers', sampler)
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
        """Add the scene that is shown, with these nodes at its root."""
        roots = {'nodes': nodes} if nodes else {}
        self.document['scene'] = self.add('scenes', roots | named)

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
