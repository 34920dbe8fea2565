"""Accessors of a glTF file as arrays."""

from __future__ import annotations

import numpy as np

from pvibr.io.gltf_file import GltfError, GltfFile, follow

_TYPES = {5120: '<i1', 5121: '<u1', 5122: '<i2', 5123: '<u2', 5125: '<u4', 5126: '<f4'}
#: Columns and rows of an element.
_SHAPES = {
    'SCALAR': (1, 1),
    'VEC2': (1, 2),
    'VEC3': (1, 3),
    'VEC4': (1, 4),
    'MAT2': (2, 2),
    'MAT3': (3, 3),
    'MAT4': (4, 4),
}


class Accessors:
    """The arrays of a file, each read once and cached."""

    def __init__(self, file: GltfFile):
        self._file = file
        self._raw: dict[int, np.ndarray] = {}
        self._floats: dict[int, np.ndarray] = {}

    def count(self, accessor_index, json_path) -> int:
        """Return the number of elements of an accessor."""
        return follow(self._file.document.accessors, accessor_index, json_path, 'accessors').count

    def is_empty(self, accessor_index, json_path) -> bool:
        """Return whether an accessor has no bytes of its own."""
        accessor = follow(self._file.document.accessors, accessor_index, json_path, 'accessors')
        return accessor.buffer_view is None and accessor.sparse is None

    def fill(self, index, elements, json_path):
        """Set the elements (n, c) of an accessor, decoded by an extension."""
        accessor = follow(self._file.document.accessors, index, json_path, 'accessors')
        shape = accessor.count, int(np.prod(_SHAPES.get(accessor.type, 0)))
        if elements.shape != shape:
            raise GltfError(
                f'{json_path} must have shape {shape} as accessors[{index}], got {elements.shape}'
            )
        if elements.dtype.itemsize > 4:
            elements = elements.astype(np.float32)
        self._raw.setdefault(index, elements)

    def floats(self, index, json_path, *types):
        """Return an accessor as floats, (n, c)."""
        self._check_type(index, json_path, types)
        if index not in self._floats:
            accessor = self._file.document.accessors[index]
            raw = self._elements(index)
            self._file.spend(8 * raw.size, f'accessors[{index}]')
            self._floats[index] = _as_floats(raw, accessor.normalized, f'accessors[{index}]')
        return self._floats[index]

    def integers(self, accessor_index, json_path, *types):
        """Return an accessor of unsigned integers, (n, c) int64."""
        accessor = self._check_type(accessor_index, json_path, types)
        if accessor.component_type not in (5121, 5123, 5125) or accessor.normalized:
            raise GltfError(f'{json_path} must be unsigned integers: accessors[{accessor_index}]')
        raw = self._elements(accessor_index)
        self._file.spend(8 * raw.size, f'accessors[{accessor_index}]')
        return raw.astype(np.int64)

    def _check_type(self, accessor_index, json_path, types):
        accessor = follow(self._file.document.accessors, accessor_index, json_path, 'accessors')
        if accessor.type not in types:
            actual_type, allowed = accessor.type[:40], ', '.join(types)
            raise GltfError(
                f'{json_path} must be {allowed}, got accessors[{accessor_index}] of {actual_type}'
            )
        return accessor

    def _elements(self, index):
        """Return the elements as stored, shape (n, c)."""
        if index in self._raw:
            return self._raw[index]
        accessor = self._file.document.accessors[index]
        json_path = f'accessors[{index}]'
        dtype, shape = np.dtype(_TYPES[accessor.component_type]), _SHAPES[accessor.type]
        if accessor.buffer_view is not None:
            views = self._file.document.buffer_views
            view = follow(views, accessor.buffer_view, f'{json_path}.bufferView', 'bufferViews')
            data = self._file.view(accessor.buffer_view, f'{json_path}.bufferView')
            start = accessor.byte_offset
            elements = _read(
                data, start, accessor.count, dtype, shape, view.byte_stride, json_path
            )
        else:
            self._file.spend(accessor.count * shape[0] * shape[1] * dtype.itemsize, json_path)
            elements = np.zeros((accessor.count, shape[0] * shape[1]), dtype)
        if accessor.sparse is not None:
            self._file.spend(elements.nbytes, f'{json_path}.sparse')
            elements = elements.copy()
            self._fill_sparse(elements, accessor.sparse, dtype, shape, f'{json_path}.sparse')
        self._raw[index] = elements
        return elements

    def _fill_sparse(self, elements, sparse, dtype, shape, json_path):
        if sparse.count > len(elements):
            raise GltfError(
                f'{json_path}.count must be below {len(elements) + 1}, got {sparse.count}'
            )
        where = f'{json_path}.indices'
        data = self._file.view(sparse.indices.buffer_view, f'{where}.bufferView')
        index_type = np.dtype(_TYPES[sparse.indices.component_type])
        start = sparse.indices.byte_offset
        indices = _read(data, start, sparse.count, index_type, (1, 1), None, where)
        indices = indices[:, 0].astype(np.int64)
        if indices[-1] >= len(elements) or (np.diff(indices) <= 0).any():
            raise GltfError(f'{where} must ascend and be below {len(elements)}')
        where = f'{json_path}.values'
        data = self._file.view(sparse.values.buffer_view, f'{where}.bufferView')
        start = sparse.values.byte_offset
        elements[indices] = _read(data, start, sparse.count, dtype, shape, None, where)


def _read(data, start, count, dtype, shape, stride, json_path):
    """Return elements of a buffer view, shape (count, c), without a copy if possible."""
    column_count, row_count = shape
    # Matrix columns are aligned to four bytes.
    column_stride = row_count * dtype.itemsize
    column_stride = -(-column_stride // 4) * 4 if column_count > 1 else column_stride
    element_size = column_count * column_stride
    stride = stride or element_size
    if stride < element_size:
        raise GltfError(f'{json_path}: byteStride must be at least {element_size}, got {stride}')
    end_byte = start + (count - 1) * stride + element_size
    if end_byte > len(data):
        raise GltfError(
            f'{json_path} must end within the {len(data)} bytes of its bufferView, got {end_byte}'
        )
    strides = (stride, column_stride, dtype.itemsize)
    array = np.ndarray((count, column_count, row_count), dtype, data, start, strides)
    return array.reshape(count, column_count * row_count)


def _as_floats(raw, normalized, json_path):
    float_type = np.float64 if raw.dtype.itemsize == 4 and raw.dtype.kind != 'f' else np.float32
    values = raw.astype(float_type)
    if raw.dtype.kind == 'f':
        not_finite = np.argwhere(~np.isfinite(values))
        if len(not_finite):
            element, component = not_finite[0].tolist()
            value = values[element, component]
            raise GltfError(f'{json_path}: element {element} must be finite, got {value}')
    elif normalized:
        values /= np.iinfo(raw.dtype).max
        np.maximum(values, -1, out=values)  # both -128 and -127 mean -1
    values.setflags(write=False)
    return values
