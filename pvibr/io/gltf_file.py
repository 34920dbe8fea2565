"""A glTF file: its JSON, buffers and external files."""

from __future__ import annotations

import base64
import binascii
import re
import struct
import urllib.parse
from contextlib import contextmanager, suppress
from pathlib import Path

import msgspec

from pvibr.core.errors import PvibrError, warn
from pvibr.core.files import HEAD_BYTES, stand_in_of
from pvibr.io.gltf_schema import Asset, Gltf

_MAGIC, _JSON, _BIN = b'glTF', b'JSON', b'BIN\0'
#: An extension in use: an object whose name has a prefix in capitals; attributes are all capitals.
_EXTENSION = re.compile(rb'"([A-Z][A-Z0-9]{1,9}_[a-z][A-Za-z0-9_]{1,60})"\s*:\s*\{')
#: Memory budget of arrays and images: bytes, plus bytes per byte of the files, since accessors may
#: share bytes and plain images compress well.
_BASE_BUDGET, _BUDGET_PER_BYTE = 2**28, 64


class GltfError(PvibrError, ValueError):
    """A glTF file is broken or requires an unsupported feature; the message names the place.

    Parameters
    ----------
    message : str
        Place and problem; long messages are truncated.

    Examples
    --------
    >>> import pvibr
    >>> issubclass(pvibr.animation.GltfError, ValueError)
    True
    """

    def __init__(self, message):
        super().__init__(_clipped(message))


class TooLargeError(GltfError):
    """A glTF file requires far more memory than its size justifies."""


@contextmanager
def naming(json_path):
    """Turn ValueErrors into GltfErrors that name the place in the file."""
    try:
        yield
    except GltfError:
        raise
    except ValueError as error:
        raise GltfError(f'{json_path}: {error}') from error


def follow(things, index, json_path, kind):
    """Return the element that an index in the file refers to."""
    if index >= len(things):
        raise GltfError(f'{json_path} must be below {len(things)} ({kind}), got {index}')
    return things[index]


class GltfFile:
    """A glTF file: its validated JSON and its bytes."""

    def __init__(self, path):
        self.path = Path(path)
        data = self.path.read_bytes()
        if stand_in := stand_in_of(data[:HEAD_BYTES]):
            raise GltfError(f'it must be a glTF file, got {stand_in}: {str(path)!r}')
        json, self._blob = _chunks(data) if data[:4] == _MAGIC else (data, None)
        self._budget_left = self._budget = _BASE_BUDGET + _BUDGET_PER_BYTE * len(data)
        self._buffers: dict[int, memoryview] = {}
        self._unsupported: dict[str, str] = {}
        self._json = json
        self.document = _parsed(json)

    def extensions(self):
        """Return the names of all extensions in the JSON, declared or not."""
        return sorted({name.decode() for name in _EXTENSION.findall(self._json)})

    def spend(self, size, json_path):
        """Charge bytes to be allocated; raise an error beyond the budget."""
        self._budget_left -= size
        if self._budget_left < 0:
            needed_mib, allowed_mib = (self._budget - self._budget_left) >> 20, self._budget >> 20
            raise TooLargeError(
                f'{json_path} needs {needed_mib} MiB in all; a file of this size may need '
                f'{allowed_mib} MiB'
            )

    def leave_out(self, feature, json_path):
        """Record an unsupported feature."""
        self._unsupported.setdefault(feature, json_path)

    def warn(self):
        """Warn once of all unsupported features."""
        if self._unsupported:
            features = ', '.join(f'{name} ({place})' for name, place in self._unsupported.items())
            warn(_clipped(f'{self.path.name}: not supported and left out: {features}'))

    def view(self, view_index, json_path) -> memoryview:
        """Return the bytes of a buffer view."""
        view = follow(self.document.buffer_views, view_index, json_path, 'bufferViews')
        data = self._buffer(view.buffer, f'bufferViews[{view_index}].buffer')
        end = view.byte_offset + view.byte_length
        if end > len(data):
            raise GltfError(
                f'bufferViews[{view_index}] must end within the {len(data)} bytes of its buffer, '
                f'got {end}'
            )
        return data[view.byte_offset : end]

    def resource(self, uri, json_path, limit=None) -> bytes:
        """Return the bytes that a URI names."""
        if uri[:5].lower() == 'data:':
            return _decoded(uri, json_path)
        data = self._read(self._located(uri, json_path), json_path, limit)
        self._budget_left += _BUDGET_PER_BYTE * len(data)
        self._budget += _BUDGET_PER_BYTE * len(data)
        return data

    def _buffer(self, buffer_index, json_path):
        if buffer_index not in self._buffers:
            buffer = follow(self.document.buffers, buffer_index, json_path, 'buffers')
            data = self._bytes_of(buffer, f'buffers[{buffer_index}]', buffer_index)
            if len(data) < buffer.byte_length:
                raise GltfError(
                    f'buffers[{buffer_index}].byteLength must be at most {len(data)}, '
                    f'got {buffer.byte_length}'
                )
            self._buffers[buffer_index] = memoryview(data)[: buffer.byte_length]
        return self._buffers[buffer_index]

    def _bytes_of(self, buffer, json_path, buffer_index):
        if buffer.uri is not None:
            return self.resource(buffer.uri, f'{json_path}.uri', buffer.byte_length)
        if buffer_index or self._blob is None:
            raise GltfError(f'{json_path} must have a uri, as the file has no binary chunk for it')
        return self._blob

    def _located(self, uri, json_path) -> Path:
        """Return the file of a relative URI, which must be inside the folder."""
        name = urllib.parse.unquote(uri)
        # Before any file access; a colon marks a scheme or a Windows drive.
        if not name or any(sign in name for sign in ':\\\0') or name.startswith('/'):
            raise GltfError(f'{json_path} must be a data URI or relative path, got {_short(uri)}')
        folder = self.path.parent.resolve()
        try:
            path = (folder / name).resolve()
            is_inside = path.is_relative_to(folder)
            if is_inside and path.is_file():
                return path
        except (OSError, RuntimeError, ValueError):  # name too long; symbolic links in a cycle
            is_inside = True
        if is_inside:
            raise GltfError(f'{json_path}: no such file: {_short(uri)}')
        raise GltfError(f'{json_path} must not be outside the folder, got {_short(uri)}')

    def _read(self, path, json_path, limit):
        try:
            with path.open('rb') as file:
                # At most the file's size, as the JSON's limit may be wrong.
                size = path.stat().st_size
                return file.read(size if limit is None else min(limit, size))
        except OSError as error:
            raise GltfError(f'{json_path} cannot be read: {error.strerror}') from error


def _chunks(data) -> tuple[bytes, bytes | None]:
    """Return the JSON and the binary chunk of a GLB."""
    if len(data) < 20:
        raise GltfError(f'the GLB is truncated at {len(data)} bytes')
    version, length = struct.unpack_from('<II', data, 4)
    if version != 2:
        raise GltfError(f'GLB version must be 2, got {version}')
    if not 20 <= length <= len(data):
        raise GltfError(f'the GLB is truncated: {length} bytes declared, {len(data)} present')
    chunks = list(_split(data[:length]))
    if chunks[0][0] != _JSON:
        raise GltfError(f'chunk 0 of the GLB must be {_JSON!r}, got {chunks[0][0]!r}')
    blob = chunks[1][1] if len(chunks) > 1 and chunks[1][0] == _BIN else None
    return chunks[0][1], blob


def _split(data):
    """Yield type and content of the first two chunks; later ones belong to extensions."""
    offset = 12
    for number in range(2):
        if offset + 8 > len(data):
            return
        size, kind = struct.unpack_from('<I4s', data, offset)
        offset += 8 + size
        if offset > len(data):
            raise GltfError(f'chunk {number} must end within the {len(data)} bytes, got {offset}')
        yield kind, data[offset - size : offset]


def _parsed(json) -> Gltf:
    json = json.removeprefix(b'\xef\xbb\xbf')
    try:
        document = _decoded_as(json, Gltf)
    except msgspec.ValidationError as error:
        with suppress(msgspec.DecodeError, RecursionError, UnicodeDecodeError):
            _check_version(_decoded_as(json, _Versioned).asset)
        fault, _, json_path = str(error).partition(' - at ')
        raise GltfError(
            f'{json_path.strip("`").removeprefix("$.") or "the file"}: {fault}'
        ) from None
    except RecursionError:
        raise GltfError('the JSON is nested too deeply') from None
    except ValueError as error:  # from msgspec, or for invalid UTF-8
        raise GltfError(f'the file is neither GLB nor JSON: {error}') from None
    _check_version(document.asset)
    return document


class _Versioned(msgspec.Struct):
    """A glTF file of any version."""

    asset: Asset = Asset('2.0')


def _decoded_as(json, kind):
    try:
        return msgspec.json.decode(json, type=kind)
    except msgspec.ValidationError as error:
        if 'Expected `int`, got `float`' not in str(error):
            raise
        # JSON does not distinguish integers: 1.0 is valid.
        return msgspec.convert(_integral(msgspec.json.decode(json)), kind)


def _integral(value):
    """Return JSON with whole floats as integers."""
    if isinstance(value, dict):
        return {key: _integral(member) for key, member in value.items()}
    if isinstance(value, list):
        return [_integral(member) for member in value]
    return int(value) if isinstance(value, float) and value.is_integer() else value


def _check_version(asset):
    if not asset.version.startswith('2.'):
        raise GltfError(f'asset.version must be 2.x, got {asset.version[:20]!r}')
    if asset.min_version not in (None, '2.0'):
        raise GltfError(f'asset.minVersion must be 2.0, got {asset.min_version[:20]!r}')


def _decoded(uri, json_path) -> bytes:
    media_type, comma, content = uri.partition(',')
    if not comma or not media_type.lower().endswith(';base64'):
        raise GltfError(f'{json_path} must be base64 if a data URI, got {_short(uri)}')
    try:
        return base64.b64decode(urllib.parse.unquote(content), validate=True)
    except (binascii.Error, ValueError) as error:
        raise GltfError(f'{json_path} must be valid base64: {error}') from None


def _short(text):
    return repr(_clipped(text, 80))


def _clipped(text, length=1000):
    """Return text truncated to a readable length."""
    return text if len(text) <= length else text[: length - 3] + '...'
