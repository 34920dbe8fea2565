"""Primitives that Draco compresses (KHR_draco_mesh_compression), by DracoPy."""

from __future__ import annotations

import numpy as np

from pvibr.core.errors import require
from pvibr.formats.gltf_accessors import Accessors
from pvibr.formats.gltf_file import GltfError, GltfFile

_MAGIC, _HEADER = b'DRACO', 11
#: Bitstream of glTF, and its kinds of connectivity.
_VERSION, _SEQUENTIAL, _EDGEBREAKER = (2, 2), 0, 1
_METADATA = 0x8000
#: Bytes that the decoder needs for a vertex and a face.
_ROOM = 256


def unpack(file: GltfFile, accessors: Accessors, primitive, place):
    """Decode a primitive, if only Draco has its vertices; return True if it did."""
    draco = primitive.extensions.draco
    position = primitive.attributes['POSITION']
    if draco is None or not accessors.is_empty(position, f'{place}.attributes.POSITION'):
        return False
    place = f'{place}.extensions.KHR_draco_mesh_compression'
    if primitive.indices is None or not primitive.attributes.keys() >= draco.attributes.keys():
        raise GltfError(f'{place} needs indices, and accessors of all its attributes.')
    data = bytes(file.view(draco.buffer_view, f'{place}.bufferView'))
    counts = accessors.count(position, place), accessors.count(primitive.indices, place) // 3
    _check_header(data, counts, place)
    file.spend(_ROOM * sum(counts), place)
    mesh = _decoded(data, place)
    for name, number in draco.attributes.items():
        found = [a['data'] for a in mesh.attributes if a['unique_id'] == number]
        if not found:
            raise GltfError(
                f'{place}.attributes.{name} is {number}, which the compressed mesh lacks.'
            )
        accessors.fill(primitive.attributes[name], found[0], f'{place}.attributes.{name}')
    accessors.fill(primitive.indices, np.asarray(mesh.faces, np.uint32).reshape(-1, 1), place)
    return True


def _decoded(data, place):
    decoder = require('DracoPy', 'draco', 'Draco compressed meshes')
    try:
        return decoder.decode(data)
    except Exception as error:  # whatever a decoder raises at broken bytes
        raise GltfError(f'{place} cannot be decoded: {error}.') from error


def _check_header(data, counts, place):
    """Raise an error if a mesh says that it is larger than its accessors: memory follows it."""
    flags = int.from_bytes(data[9:11], 'little')
    if data[:5] != _MAGIC or tuple(data[5:7]) != _VERSION or data[7:8] != b'\1':
        raise GltfError(f'{place} is no Draco mesh of version 2.2.')
    if flags & _METADATA or data[8] not in (_SEQUENTIAL, _EDGEBREAKER):
        raise GltfError(f'{place} has metadata or another method, which is not read.')
    first, at = _varint(data, _HEADER + (data[8] == _EDGEBREAKER))
    second, _ = _varint(data, at)
    vertices, faces = (second, first) if data[8] == _SEQUENTIAL else (first, second)
    if vertices > counts[0] or faces > counts[1]:
        said = f'{vertices} vertices and {faces} faces, its accessors {counts[0]} and {counts[1]}'
        raise GltfError(f'{place} has {said}.')


def _varint(data, at):
    value = shift = 0
    while at < len(data):
        value |= (data[at] & 127) << shift
        at, shift, more = at + 1, shift + 7, data[at] & 128
        if not more or shift > 63:
            break
    return value, at
