"""glTF files written by hand, so that tests know every byte."""

import json
import struct

import numpy as np
import pytest

from tests.refusals import refused  # noqa: F401

KINDS = {'b': 5120, 'B': 5121, 'h': 5122, 'H': 5123, 'I': 5125, 'f': 5126}
TYPES = {1: 'SCALAR', 2: 'VEC2', 3: 'VEC3', 4: 'VEC4', 16: 'MAT4'}
SQUARE = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]


class Glb:
    """A glTF file that grows: things are added to `json` and `blob`."""

    def __init__(self, folder):
        self.folder = folder
        self.json = {'asset': {'version': '2.0'}}
        self.blob = b''

    def add(self, kind, **thing):
        """Append a thing and return its number."""
        things = self.json.setdefault(kind, [])
        things.append(thing)
        return len(things) - 1

    def view(self, data, **more):
        self.blob += b'\0' * (-len(self.blob) % 4)
        start, self.blob = len(self.blob), self.blob + bytes(data)
        return self.add('bufferViews', buffer=0, byteOffset=start, byteLength=len(data), **more)

    def array(self, values, kind='f', **more):
        """Append an accessor of values of shape (n,) or (n, c)."""
        values = np.array(values, dtype=f'<{np.dtype(kind).str[1:]}')
        rows = values.reshape(len(values), -1)
        return self.add(
            'accessors',
            **{'type': TYPES[rows.shape[1]]} | more,
            bufferView=self.view(values.tobytes()),
            componentType=KINDS[kind],
            count=len(values),
        )

    def primitive(self, points=SQUARE, corners=(0, 1, 2, 0, 2, 3), **more):
        """Return a primitive with the normals +z."""
        attributes = {
            'POSITION': self.array(points),
            'NORMAL': self.array(np.tile([0, 0, 1], (len(points), 1))),
        }
        attributes |= more.pop('attributes', {})
        attributes = {name: index for name, index in attributes.items() if index is not None}
        if corners is not None:
            more['indices'] = self.array(corners, 'H')
        return {'attributes': attributes, **more}

    def shown(self, *primitives, mesh=None, **node):
        """Append a mesh and a node that shows it; return the node's number."""
        mesh = self.add('meshes', primitives=list(primitives), **mesh or {})
        return self.add('nodes', mesh=mesh, **node)

    def animate(self, node, path, times, values, interpolation='LINEAR', kind='f', **more):
        """Append a clip that drives one thing."""
        sampler = {
            'input': self.array(times),
            'output': self.array(values, kind, **more),
            'interpolation': interpolation,
        }
        channel = {'sampler': 0, 'target': {'node': node, 'path': path}}
        return self.add('animations', channels=[channel], samplers=[sampler])

    def bytes(self):
        document = dict(self.json)
        if self.blob and 'buffers' not in document:
            document['buffers'] = [{'byteLength': len(self.blob)}]
        text = json.dumps(document).encode()
        text += b' ' * (-len(text) % 4)
        blob = self.blob + b'\0' * (-len(self.blob) % 4)
        chunks = struct.pack('<I4s', len(text), b'JSON') + text
        if blob:
            chunks += struct.pack('<I4s', len(blob), b'BIN\0') + blob
        return struct.pack('<4sII', b'glTF', 2, 12 + len(chunks)) + chunks

    def write(self, name='figure.glb'):
        """Write the file as GLB, or as JSON with the bytes beside it; return its path."""
        path = self.folder / name
        if path.suffix == '.glb':
            path.write_bytes(self.bytes())
            return path
        buffer = {'uri': 'its%20bytes.bin', 'byteLength': len(self.blob)}
        (self.folder / 'its bytes.bin').write_bytes(self.blob)
        path.write_text(json.dumps({'buffers': [buffer], **self.json}), encoding='utf-8')
        return path


def document(path):
    """Return the JSON of a GLB file, and its bytes."""
    data = path.read_bytes()
    (size,) = struct.unpack_from('<I', data, 12)
    return json.loads(data[20 : 20 + size]), data[28 + size :]


@pytest.fixture
def glb(tmp_path):
    return Glb(tmp_path)
