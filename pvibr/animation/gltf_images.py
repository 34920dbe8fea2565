"""Textures of a glTF file: pictures, samplers, and wrap modes that differ between u and v."""

from __future__ import annotations

import io
import warnings
from typing import NamedTuple

import numpy as np
import pyvista as pv

from pvibr.io.gltf_file import GltfError, GltfFile, TooLargeError, follow
from pvibr.io.gltf_schema import Sampler, TextureInfo

_NEAREST = 9728
_MIPMAPS = (None, 9984, 9985, 9986, 9987)
_CLAMP, _MIRROR, _REPEAT = 33071, 33648, 10497
_WRAPS = {_CLAMP: 'CLAMP_TO_EDGE', _MIRROR: 'MIRRORED_REPEAT', _REPEAT: 'REPEAT'}
#: Image formats that Pillow may try; others are unsafe (EPS starts Ghostscript).
_PICTURES = ('PNG', 'JPEG', 'WEBP')
#: Signatures of formats that need another decoder.
_OTHERS = {b'\xabKTX 20': 'KTX2', b'DDS ': 'DDS'}
#: Most copies of a picture that emulate a wrap mode.
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
        lines = pixels[::-1] if self.axis else pixels.swapaxes(0, 1)  # along the axis
        parts = [_tile_copy(lines, k, wrap) for k in range(self.first, self.first + self.copies)]
        lines = np.concatenate(parts)
        return lines[::-1] if self.axis else lines.swapaxes(0, 1)


class Pictures:
    """The textures of a file, each read once; one that cannot be read is left out."""

    def __init__(self, gltf_file: GltfFile):
        self._file = gltf_file
        self._textures: dict[tuple, pv.Texture | None] = {}
        self._pixels_by_image: dict[int, np.ndarray | None] = {}

    def texture(self, texture_info: TextureInfo, opaque, srgb=False, channels='RGB', tiles=None):
        """Return a texture, or None if its picture is left out."""
        normal_scale = getattr(texture_info, 'scale', 1.0)
        cache_key = texture_info.index, opaque, srgb, channels, tiles, normal_scale
        if cache_key not in self._textures:
            self._textures[cache_key] = self._new_texture(*cache_key)
        return self._textures[cache_key]

    def tiles(self, texture_info: TextureInfo, coordinates):
        """Return the tiles that a texture needs for its coordinates (n, 2), or None."""
        sampler = self._sampler(texture_info.index)
        if sampler.wrap_s == sampler.wrap_t:
            return None
        first_tile = np.floor(coordinates.min(0))
        tile_counts = np.maximum(np.ceil(coordinates.max(0)) - first_tile, 1)
        tiled_axis = int(tile_counts.argmin())
        if tile_counts[tiled_axis] > _MOST_TILES:
            json_path = f'textures[{texture_info.index}].sampler'
            self._file.leave_out('wrapT different from wrapS', json_path)
            return None
        return Tiles(tiled_axis, int(first_tile[tiled_axis]), int(tile_counts[tiled_axis]))

    def _sampler(self, texture_index):
        document = self._file.document
        texture = follow(document.textures, texture_index, 'texture.index', 'textures')
        if texture.sampler is None:
            return Sampler()
        json_path = f'textures[{texture_index}].sampler'
        return follow(document.samplers, texture.sampler, json_path, 'samplers')

    def _new_texture(self, texture_index, opaque, srgb, channels, tiles, normal_scale):
        sampler = self._sampler(texture_index)
        pixels = self._pixels(texture_index)
        if pixels is None:
            return None
        if channels != 'RGB':
            pixels = pixels.copy()
            pixels[..., [i for i, name in enumerate('RGB') if name not in channels]] = 255
        if normal_scale != 1:
            pixels = _scaled_normals(pixels, normal_scale)
        wraps = sampler.wrap_s, sampler.wrap_t
        wrap = wraps[0]
        if tiles is not None:
            self._file.spend(pixels.nbytes * tiles.copies, f'textures[{texture_index}]')
            pixels, wrap = tiles.tiled(pixels, wraps[tiles.axis]), wraps[1 - tiles.axis]
        # OPAQUE means that alpha is ignored; VTK would blend it.
        texture = pv.Texture(np.ascontiguousarray(pixels[..., :3] if opaque else pixels))
        texture.SetUseSRGBColorSpace(srgb)
        texture.interpolate = sampler.mag_filter != _NEAREST
        texture.mipmap = sampler.min_filter in _MIPMAPS
        texture.wrap = pv.Texture.WrapType[_WRAPS[wrap]]
        return texture

    def _pixels(self, index):
        """Return the pixels of a texture, or None."""
        texture, document = self._file.document.textures[index], self._file.document
        webp = texture.extensions.webp
        image_index = texture.source if webp is None or webp.source is None else webp.source
        if image_index is None:
            self._file.leave_out(f'textures[{index}]', 'it has no PNG, JPEG or WebP picture')
            return None
        follow(document.images, image_index, f'textures[{index}].source', 'images')
        if image_index not in self._pixels_by_image:
            self._pixels_by_image[image_index] = self._read_or_leave_out(image_index)
        return self._pixels_by_image[image_index]

    def _read_or_leave_out(self, image_index):
        try:
            return self._read(image_index)
        except TooLargeError:
            raise
        except GltfError as error:  # models often come without their pictures
            self._file.leave_out(f'images[{image_index}]', str(error).rstrip('.'))
            return None

    def _read(self, image_index):
        image, json_path = self._file.document.images[image_index], f'images[{image_index}]'
        if image.buffer_view is not None:
            data = bytes(self._file.view(image.buffer_view, f'{json_path}.bufferView'))
        elif image.uri is not None:
            data = self._file.resource(image.uri, f'{json_path}.uri')
        else:
            raise GltfError(f'{json_path} must have uri or bufferView, got neither')
        return self._decoded(data, json_path)

    def _decoded(self, data, json_path):
        from PIL import Image, UnidentifiedImageError  # only textured files need it

        try:
            with warnings.catch_warnings(), io.BytesIO(data) as data_stream:
                warnings.simplefilter('ignore')  # about damaged metadata
                picture: Image.Image = Image.open(data_stream, formats=_PICTURES)
                width, height = picture.size
                self._file.spend(8 * width * height, json_path)
                if picture.mode.startswith('I'):  # 16-bit grey, which Pillow would clip
                    picture = Image.fromarray((np.asarray(picture) >> 8).astype(np.uint8))
                return np.asarray(picture.convert('RGBA'))
        except GltfError:
            raise
        except UnidentifiedImageError as error:
            names = (name for start, name in _OTHERS.items() if data.startswith(start))
            kind = next(names, 'another format')
            raise GltfError(f'{json_path} must be PNG, JPEG or WebP, got {kind}') from error
        except Exception as error:  # decoders raise any exception at broken bytes
            raise GltfError(f'{json_path} cannot be read: {error}') from error


def _scaled_normals(pixels, scale):
    """Return a normal map that leans more or less."""
    scaled = pixels.copy()
    leaning = (pixels[..., :2].astype(np.float32) - 127.5) * scale
    up = pixels[..., 2].astype(np.float32) - 127.5
    lengths = np.sqrt((leaning**2).sum(-1) + up**2)[..., None]
    unit_normals = np.concatenate([leaning, up[..., None]], -1) / np.maximum(lengths, 1e-6)
    scaled[..., :3] = np.clip(127.5 * unit_normals + 128.0, 0, 255).astype(np.uint8)
    return scaled


def _tile_copy(lines, tile_index, wrap_mode):
    """Return the copy of a picture at a whole number of coordinates."""
    if wrap_mode == _CLAMP and tile_index:
        return np.broadcast_to(lines[-1:] if tile_index > 0 else lines[:1], lines.shape)
    return lines[::-1] if wrap_mode == _MIRROR and tile_index % 2 else lines
