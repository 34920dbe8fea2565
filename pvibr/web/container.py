"""A scene as one HTML file: its tree as JSON, its arrays and images in checked binary chunks."""

from __future__ import annotations

import base64
import io
import json
import zlib
from dataclasses import dataclass
from typing import Any

import numpy as np

from pvibr.web.bundle import page_of

#: Types of arrays for which JavaScript has typed arrays; others become float32 or int32.
TYPES = ('uint8', 'int8', 'uint16', 'int16', 'uint32', 'int32', 'float32', 'float64')
#: Bytes of an array whose deflated size decides how it is filtered.
_TRIAL_BYTES = 1 << 17
_QUANTA = 65535


@dataclass(frozen=True)
class Points:
    """Points (n, 3), stored with 16 bits a coordinate within their bounds."""

    values: np.ndarray


@dataclass(frozen=True)
class Frames:
    """Vectors (n, frames, 3) over time, stored as points."""

    values: np.ndarray


@dataclass(frozen=True)
class Directions:
    """Unit vectors (n, 3), stored as octahedral coordinates of 16 bits."""

    values: np.ndarray


@dataclass(frozen=True)
class Image:
    """Pixels (height, width[, channels]) of 8 bits: as PNG, or as WebP with loss."""

    pixels: np.ndarray
    lossless: bool = True


class Container:
    """The chunks of a page while its scene is encoded."""

    def __init__(self, quality=90):
        #: Of images with loss, as WebP, 0 to 100.
        self.quality = quality
        self.chunks: list[bytes] = []

    def tree(self, value) -> Any:
        """Return a value as JSON in which arrays and images refer to chunks."""
        if isinstance(value, dict):
            if '$leaf' in value:
                raise ValueError("scene must have no key '$leaf', got one")
            return {str(key): self.tree(item) for key, item in value.items()}
        if isinstance(value, (list, tuple)):
            return [self.tree(item) for item in value]
        if isinstance(value, np.generic):
            return self.tree(value.item())
        if isinstance(value, float) and not np.isfinite(value):
            return {'$leaf': 'number', 'text': repr(value)}
        if isinstance(value, np.ndarray):
            return self._array(value)
        if isinstance(value, (Points, Frames)):
            return self._points(value.values)
        if isinstance(value, Directions):
            return self._directions(value.values)
        if isinstance(value, Image):
            return self._image(value)
        return value

    def _chunk(self, payload) -> int:
        self.chunks.append(payload)
        return len(self.chunks) - 1

    def _array(self, array):
        array = typed(array)
        packed, filtered = deflated(array)
        return {
            '$leaf': 'array',
            'chunk': self._chunk(packed),
            'type': array.dtype.name,
            'shape': array.shape,
            'filter': filtered,
        }

    def _points(self, points):
        points = np.ascontiguousarray(points, np.float64).reshape(-1, 3)
        if not len(points):
            return self._array(points.astype(np.float32))
        low, high = points.min(axis=0), points.max(axis=0)
        step = np.where(high > low, high - low, 1) / _QUANTA
        whole = np.rint((points - low) / step)
        leaf = self._array(whole.astype(np.uint16))
        return leaf | {'$leaf': 'points', 'low': low.tolist(), 'step': step.tolist()}

    def _directions(self, vectors):
        vectors = np.ascontiguousarray(vectors, np.float64).reshape(-1, 3)
        return self._array(octahedral(vectors)) | {'$leaf': 'directions'}

    def _image(self, image):
        pixels = np.ascontiguousarray(image.pixels)
        if pixels.dtype != np.uint8:
            raise TypeError(f'pixels must be uint8, got {pixels.dtype}')
        encoded = encoded_image(pixels, None if image.lossless else self.quality)
        kind = 'image/png' if image.lossless else 'image/webp'
        return {'$leaf': 'image', 'chunk': self._chunk(encoded), 'type': kind}


def halved(pixels) -> np.ndarray:
    """Return an image of half the sides, each pixel the mean of four."""
    height, width = (side // 2 for side in pixels.shape[:2])
    blocks = pixels.reshape(height, 2, width, 2, -1).astype('u2')
    return ((blocks.sum((1, 3)) + 2) >> 2).astype('u1')


def typed(array) -> np.ndarray:
    """Return an array, little-endian and contiguous, of a type that JavaScript has."""
    array = np.asarray(array)
    if array.dtype == bool:
        array = array.astype(np.uint8)
    if array.dtype.name not in TYPES:
        if array.dtype.kind not in 'iuf':
            raise TypeError(f'arrays must be numbers, got {array.dtype}')
        array = array.astype(np.float32 if array.dtype.kind == 'f' else np.int32)
    return np.ascontiguousarray(array, array.dtype.newbyteorder('<'))


def deflated(array) -> tuple[bytes, str]:
    """Return an array deflated, and its filter: '' or 'delta', whichever is smaller."""
    rows = max(1, _TRIAL_BYTES // max(1, array[:1].nbytes)) if array.ndim else 1
    trial = array[:rows] if array.ndim else array
    plain, delta = (len(zlib.compress(f(trial), 1)) for f in (bytes_of, delta_planes))
    kind, make = ('delta', delta_planes) if delta < plain else ('', bytes_of)
    return zlib.compress(make(array), 6 if array.nbytes < 1 << 24 else 4), kind


def bytes_of(array) -> bytes:
    """Return the bytes of an array as they lie in memory."""
    return array.tobytes()


def delta_planes(array) -> bytes:
    """Return differences of following rows, as integers that wrap, by planes of bytes."""
    # Neighbours differ little, so that high bytes repeat and deflate well.
    if not array.size:
        return b''
    width = array.dtype.itemsize
    whole = array.view(f'<u{width}').reshape(len(array) if array.ndim else 1, -1)
    delta = whole.copy()
    delta[1:] -= whole[:-1]
    # Signs in the lowest bit, so that small negative differences have zeros above too.
    top = delta >> (8 * width - 1)
    delta = (delta << 1) ^ (0 - top)
    return delta.astype(f'<u{width}').T.copy().view(np.uint8).reshape(-1, width).T.tobytes()


def octahedral(vectors) -> np.ndarray:
    """Return octahedral coordinates (n, 2) int16 of unit vectors (Cigolle et al. 2014)."""
    length = np.abs(vectors).sum(axis=1, keepdims=True)
    x, y, z = (vectors / np.where(length > 0, length, 1)).T
    folded = np.where(z < 0, 1 - np.abs(y), x), np.where(z < 0, 1 - np.abs(x), y)
    signed = [np.where((z < 0) & (c < 0), -1, 1) * f for c, f in zip((x, y), folded, strict=True)]
    return np.rint(np.clip(np.column_stack(signed), -1, 1) * 32767).astype(np.int16)


def encoded_image(pixels, quality) -> bytes:
    """Return pixels as a file: PNG, or WebP of a quality."""
    from PIL import Image as Picture

    file = io.BytesIO()
    picture = Picture.fromarray(pixels)
    if quality is None:
        picture.save(file, 'PNG', compress_level=6)
    else:
        # Colours under transparent pixels matter: filters mix them in.
        picture.save(file, 'WEBP', quality=quality, method=2, exact=True)
    return file.getvalue()


def written(scene, container, title) -> str:
    """Return the text of a page."""
    tree = container.tree(scene)
    chunks = container.chunks
    manifest = {
        'scene': tree,
        'chunks': [{'bytes': len(c), 'crc': zlib.crc32(c)} for c in chunks],
    }
    texts = [json.dumps(manifest, ensure_ascii=True, allow_nan=False).replace('<', '\\u003c')]
    texts += [base64.b64encode(chunk).decode('ascii') for chunk in chunks]
    return page_of(title, texts)
