"""Draco-compressed primitives (KHR_draco_mesh_compression), decoded by DracoPy."""

from __future__ import annotations

import numpy as np

from pvibr.core.errors import require
from pvibr.io.gltf_accessors import Accessors
from pvibr.io.gltf_file import GltfError, GltfFile

_MAGIC, _HEADER = b'DRACO', 11
#: Bitstream version of glTF, and connectivity methods.
_VERSION, _SEQUENTIAL, _EDGEBREAKER = (2, 2), 0, 1
_METADATA = 0x8000
#: Memory that the decoder needs per vertex or face, bytes.
_BYTES_PER_ELEMENT = 256


def unpack(file: GltfFile, accessors: Accessors, primitive, json_path):
    """Decode a primitive whose vertices are only in Draco data; return whether it did."""
    draco = primitive.extensions.draco
    position = primitive.attributes['POSITION']
    if draco is None or not accessors.is_empty(position, f'{json_path}.attributes.POSITION'):
        return False
    json_path = f'{json_path}.extensions.KHR_draco_mesh_compression'
    if primitive.indices is None or not primitive.attributes.keys() >= draco.attributes.keys():
        raise GltfError(f'{json_path} must have indices and accessors of all its attributes')
    data = bytes(file.view(draco.buffer_view, f'{json_path}.bufferView'))
    counts = (
        accessors.count(position, json_path),
        accessors.count(primitive.indices, json_path) // 3,
    )
    _check_header(data, counts, json_path)
    file.spend(_BYTES_PER_ELEMENT * sum(counts), json_path)
    mesh = _decoded(data, json_path)
    for name, unique_id in draco.attributes.items():
        arrays = [a['data'] for a in mesh.attributes if a['unique_id'] == unique_id]
        if not arrays:
            raise GltfError(f'{json_path}.attributes.{name} {unique_id} is missing')
        accessors.fill(primitive.attributes[name], arrays[0], f'{json_path}.attributes.{name}')
    accessors.fill(primitive.indices, np.asarray(mesh.faces, np.uint32).reshape(-1, 1), json_path)
    return True


def _decoded(data, json_path):
    decoder = require('DracoPy', 'draco', 'Draco compressed meshes')
    try:
        return decoder.decode(data)
    except Exception as error:  # broken bytes raise anything
        raise GltfError(f'{json_path} cannot be decoded: {error}') from error


def _check_header(data, counts, json_path):
    """Check that a mesh is not larger than its accessors, as the decoder allocates its size."""
    flags = int.from_bytes(data[9:11], 'little')
    if data[:5] != _MAGIC or tuple(data[5:7]) != _VERSION or data[7:8] != b'\1':
        raise GltfError(f'{json_path} must be a Draco mesh of version 2.2')
    if flags & _METADATA or data[8] not in (_SEQUENTIAL, _EDGEBREAKER):
        raise GltfError(f'{json_path} has metadata or a connectivity method that is not supported')
    first_count, offset = _varint(data, _HEADER + (data[8] == _EDGEBREAKER))
    second_count, _ = _varint(data, offset)
    vertices, faces = first_count, second_count
    if data[8] == _SEQUENTIAL:
        vertices, faces = faces, vertices
    if vertices > counts[0] or faces > counts[1]:
        raise GltfError(
            f'{json_path} must have at most the {counts[0]} vertices and {counts[1]} faces of its '
            f'accessors, got {vertices} and {faces}'
        )


def _varint(data, offset):
    value = shift = 0
    while offset < len(data):
        value |= (data[offset] & 127) << shift
        offset, shift, has_more = offset + 1, shift + 7, data[offset] & 128
        if not has_more or shift > 63:
            break
    return value, offset
