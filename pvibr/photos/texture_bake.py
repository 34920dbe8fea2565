"""Baked textures in memory, or in files written tile by tile."""

from __future__ import annotations

import warnings
from contextlib import ExitStack, contextmanager
from pathlib import Path

import numpy as np
import pyvista as pv

from pvibr.core.arguments import naming
from pvibr.core.errors import require
from pvibr.core.files import replacing
from pvibr.visibility.unwrap import checked_size, tiles_of, unwrapped

#: Texels along a side of the blocks of a TIFF; tiles are whole blocks.
_BLOCK = 512
#: Share of unwrapping in the progress.
_UNWRAPPING = 0.3


def baked_texture(mesh, size, painter, file, advance, *, side, maps=None):
    """Return a mesh with texture coordinates, its texture, and the images of maps, or their paths.

    painter(mesh) returns paint(tile, step), which returns images by name, '' for the texture.
    """
    size, start_progress = checked_size(size), 0.0
    if not isinstance(mesh, pv.PolyData) or mesh.active_texture_coordinates is None:
        start_progress = _UNWRAPPING
    mesh = unwrapped(mesh, size, lambda done: advance(start_progress * done))
    paint, shape = painter(mesh), size[::-1]
    tile_count = np.prod([-(-n // side) for n in size])
    with ExitStack() as stack:
        images = {'': stack.enter_context(_texture(file, (*shape, 4), np.uint8))}
        for name, kind in (maps or {}).items():
            images[name] = stack.enter_context(_texture(_beside(file, name), shape, *kind))
        for k, tile in enumerate(tiles_of(mesh, size, side)):

            def step(tile_share, k=k):
                advance(start_progress + (1 - start_progress) * (k + tile_share) / tile_count)

            for name, values in paint(tile, step).items():
                images[name][tile.where] = values
            step(1.0)
    if file is not None:
        images = {name: _beside(file, name) for name in images}
    image = images.pop('')
    return (mesh, image) if maps is None else (mesh, image, images)


def _beside(file, name):
    """Return the path of a map beside its texture."""
    return file and (file.with_stem(f'{file.stem}_{name}') if name else file)


def checked_file(file) -> Path | None:
    """Return the path of a texture file, validated."""
    if file is None:
        return None
    with naming('file', file):
        file = Path(file).expanduser()
    if file.suffix.lower() not in ('.npy', '.tif', '.tiff'):
        raise ValueError(f'file must end in .tif or .npy, got {str(file)!r}')
    if file.suffix.lower() != '.npy':
        require('rasterio', 'geo', 'TIFF files')
    return file


@contextmanager
def _texture(file, shape, dtype, empty=None):
    """Yield an array, or a file that takes its name once complete, to assign tiles to."""
    if file is None:
        yield np.zeros(shape, dtype)
        return
    with replacing(file) as part_path:
        if file.suffix.lower() == '.npy':
            with Path(part_path).open('wb') as array:
                yield _Npy(array, shape, np.dtype(dtype))
            return
        band_count = shape[2] if len(shape) == 3 else 1
        options = {'predictor': 3 if np.dtype(dtype).kind == 'f' else 2, 'nodata': empty}
        options |= {'photometric': 'RGB', 'alpha': 'UNSPECIFIED'} if band_count == 4 else {}
        with warnings.catch_warnings():
            warnings.simplefilter('ignore')  # of a missing georeference
            image = require('rasterio', 'geo', 'TIFF files').open(
                part_path,
                'w',
                driver='GTiff',
                height=shape[0],
                width=shape[1],
                count=band_count,
                dtype=dtype,
                tiled=True,
                blockxsize=_BLOCK,
                blockysize=_BLOCK,
                compress='deflate',
                bigtiff='IF_SAFER',
                **options,
            )
        with image:
            yield _Tiff(image)


class _Npy:
    """An .npy file whose rectangles can be assigned."""

    # Not a memory map, whose pages count as the process's memory, and raise SIGBUS on a full disk.

    def __init__(self, file, shape, dtype):
        self.file, self.dtype = file, dtype
        head = {'descr': dtype.str, 'fortran_order': False, 'shape': tuple(map(int, shape))}
        np.lib.format.write_array_header_1_0(file, head)
        self.start = file.tell()
        self.texel = dtype.itemsize * int(np.prod(shape[2:]))
        self.row = self.texel * shape[1]
        file.truncate(self.start + self.row * shape[0])

    def __setitem__(self, where, values):
        row_range, columns = where
        for row_index, row in enumerate(np.ascontiguousarray(values, self.dtype), row_range.start):
            self.file.seek(self.start + row_index * self.row + columns.start * self.texel)
            self.file.write(row)


class _Tiff:
    """A TIFF whose rectangles can be assigned."""

    def __init__(self, image):
        self.image = image

    def __setitem__(self, where, values):
        bands = np.moveaxis(values, 2, 0) if values.ndim == 3 else values[None]
        self.image.write(bands, window=tuple((part.start, part.stop) for part in where))
