"""Textures of a glTF file: pictures, samplers, and wrap modes that differ between u and v."""

from __future__ import annotations

import io
import warnings
from typing import NamedTuple

import numpy as np
import pyvista as pv

from pvibr.formats.gltf_file import GltfError, GltfFile, TooLargeError, follow
from pvibr.formats.gltf_schema import Sampler, TextureInfo

_NEAREST = 9728
_MIPMAPS = (None, 9984, 9985, 9986, 9987)
_CLAMP, _MIRROR, _REPEAT = 33071, 33648, 10497
_WRAPS = {_CLAMP: 'CLAMP_TO_EDGE', _MIRROR: 'MIRRORED_REPEAT', _REPEAT: 'REPEAT'}
#: Image formats that Pillow may try; others are unsafe (EPS starts Ghostscript).
_PICTURES = ('PNG', 'JPEG', 'WEBP')
#: How files of formats begin that need a decoder of their own.
_OTHERS = {b'\xabKTX 20': 'KTX2', b'DDS ': 'DDS'}
#: Most copies of a picture that stand for a wrap mode.
_MOST_TILES = 16


class Tiles(NamedTuple):
    """Copies of pictures along one axis of the coordinates: VTK wraps both axes alike."""

    axis: int
    first: int
    copies: int

    def placed(self, coordinates):
        """Return coordinates (n, 2) in the tiled pictures."""
        placed = coordinates.copy()
        placed[:, self.axis] = (placed[:, self.axis] - self.first) / self.copies
        return placed

    def tiled(self, pixels, wrap):
        """Return a picture, top row first, with the copies that a wrap mode asks for."""
        rows = pixels[::-1] if self.axis else pixels.swapaxes(0, 1)  # along the axis
        parts = [_copy(rows, k, wrap) for k in range(self.first, self.first + self.copies)]
        rows = np.concatenate(parts)
        return rows[::-1] if self.axis else rows.swapaxes(0, 1)


class Pictures:
    """The textures of a file, each read once; one that cannot be read is left out."""

    def __init__(self, file: GltfFile):
        self._file = file
        self._textures: dict[tuple, pv.Texture | None] = {}
        self._known: dict[int, np.ndarray | None] = {}

    def texture(self, info: TextureInfo, opaque, srgb=False, channels='RGB', tiles=None):
        """Return a texture, or None if its picture is left out."""
        scale = getattr(info, 'scale', 1.0)
        key = (info.index, opaque, srgb, channels, tiles, scale)
        if key not in self._textures:
            self._textures[key] = self._made(*key)
        return self._textures[key]

    def tiles(self, info: TextureInfo, coordinates):
        """Return the tiles that a texture needs for its coordinates (n, 2), or None."""
        sampler = self._sampler(info.index)
        if sampler.wrap_s == sampler.wrap_t:
            return None
        first = np.floor(coordinates.min(0))
        count = np.maximum(np.ceil(coordinates.max(0)) - first, 1)
        axis = int(count.argmin())
        if count[axis] > _MOST_TILES:
            place = f'textures[{info.index}].sampler'
            self._file.leave_out('wrapT other than wrapS', place)
            return None
        return Tiles(axis, int(first[axis]), int(count[axis]))

    def _sampler(self, index):
        document = self._file.document
        texture = follow(document.textures, index, 'texture.index', 'textures')
        if texture.sampler is None:
            return Sampler()
        place = f'textures[{index}].sampler'
        return follow(document.samplers, texture.sampler, place, 'samplers')

    def _made(self, index, opaque, srgb, channels, tiles, scale):
        sampler = self._sampler(index)
        pixels = self._pixels(index)
        if pixels is None:
            return None
        if channels != 'RGB':
            pixels = pixels.copy()
            pixels[..., [i for i, name in enumerate('RGB') if name not in channels]] = 255
        if scale != 1:
            pixels = _scaled_normals(pixels, scale)
        wraps = sampler.wrap_s, sampler.wrap_t
        wrap = wraps[0]
        if tiles is not None:
            self._file.spend(pixels.nbytes * tiles.copies, f'textures[{index}]')
            pixels, wrap = tiles.tiled(pixels, wraps[tiles.axis]), wraps[1 - tiles.axis]
        # OPAQUE means that alpha is ignored; VTK would blend it.
        made = pv.Texture(np.ascontiguousarray(pixels[..., :3] if opaque else pixels))
        made.SetUseSRGBColorSpace(srgb)
        made.interpolate = sampler.mag_filter != _NEAREST
        made.mipmap = sampler.min_filter in _MIPMAPS
        made.wrap = pv.Texture.WrapType[_WRAPS[wrap]]
        return made

    def _pixels(self, index):
        """Return the pixels of a texture, or None."""
        texture, document = self._file.document.textures[index], self._file.document
        webp = texture.extensions.webp
        source = texture.source if webp is None or webp.source is None else webp.source
        if source is None:
            self._file.leave_out(f'textures[{index}]', 'it has no PNG, JPEG or WebP picture')
            return None
        follow(document.images, source, f'textures[{index}].source', 'images')
        if source not in self._known:
            self._known[source] = self._or_left_out(source)
        return self._known[source]

    def _or_left_out(self, index):
        try:
            return self._read(index)
        except TooLargeError:
            raise
        except GltfError as error:  # models often come without their pictures
            self._file.leave_out(f'images[{index}]', str(error).rstrip('.'))
            return None

    def _read(self, index):
        image, place = self._file.document.images[index], f'images[{index}]'
        if image.buffer_view is not None:
            data = bytes(self._file.view(image.buffer_view, f'{place}.bufferView'))
        elif image.uri is not None:
            data = self._file.resource(image.uri, f'{place}.uri')
        else:
            raise GltfError(f'{place} has neither uri nor bufferView.')
        return self._decoded(data, place)

    def _decoded(self, data, place):
        from PIL import Image, UnidentifiedImageError  # only textured files need it

        try:
            with warnings.catch_warnings(), io.BytesIO(data) as held:
                warnings.simplefilter('ignore')  # of damage in what describes a picture
                picture: Image.Image = Image.open(held, formats=_PICTURES)
                width, height = picture.size
                self._file.spend(8 * width * height, place)
                if picture.mode.startswith('I'):  # 16-bit grey, which Pillow would clip
                    picture = Image.fromarray((np.asarray(picture) >> 8).astype(np.uint8))
                return np.asarray(picture.convert('RGBA'))
        except GltfError:
            raise
        except UnidentifiedImageError as error:
            known = (f'is {name}' for start, name in _OTHERS.items() if data.startswith(start))
            raise GltfError(
                f'{place} {next(known, "is in another format")}, not PNG, JPEG or WebP.'
            ) from error
        except Exception as error:  # decoders raise any exception at broken bytes
            raise GltfError(f'{place} cannot be read: {error}.') from error


def _scaled_normals(pixels, scale):
    """Return a normal map that leans more or less."""
    scaled = pixels.copy()
    leaning = (pixels[..., :2].astype(np.float32) - 127.5) * scale
    up = pixels[..., 2].astype(np.float32) - 127.5
    size = np.sqrt((leaning**2).sum(-1) + up**2)[..., None]
    whole = np.concatenate([leaning, up[..., None]], -1) / np.maximum(size, 1e-6)
    scaled[..., :3] = np.clip(127.5 * whole + 128.0, 0, 255).astype(np.uint8)
    return scaled


def _copy(rows, number, wrap):
    """Return the copy of a picture at a whole number of coordinates."""
    if wrap == _CLAMP and number:
        return np.broadcast_to(rows[-1:] if number > 0 else rows[:1], rows.shape)
    return rows[::-1] if wrap == _MIRROR and number % 2 else rows
