"""Orthophotos: GeoTIFF, and pictures with world files.

A world file refers to the centre of the first pixel, a GeoTIFF by default to its corner.
"""

from __future__ import annotations

import importlib
import struct
import warnings
from pathlib import Path

import numpy as np

from pvibr.maths.orthographic import Orthographic
from pvibr.photos.camera_parsing import Entry, Place, data_lines, fault

#: Suffixes of world files: that of the picture, or its first and last letter, plus w.
WORLD_SUFFIXES = ('.tfw', '.tifw', '.jgw', '.jpgw', '.jpegw', '.pgw', '.pngw', '.bpw', '.wld')
PICTURES = ('.tif', '.tiff', '.jpg', '.jpeg', '.png', '.bmp', '.jp2', '.webp')
_SIZES = {1: 1, 2: 1, 3: 2, 4: 4, 5: 8, 11: 4, 12: 8, 13: 4, 16: 8}
_FORMS = {1: 'B', 2: 's', 3: 'H', 4: 'I', 11: 'f', 12: 'd', 13: 'I', 16: 'Q'}
_TAGS = {33550: 'scale', 33922: 'tie', 34264: 'matrix', 34735: 'keys'}
_MAX_VALUES = 1 << 20  # values of a tag


def read(path):
    """Return the entries of a picture, of a world file, or of all pictures in a folder."""
    if path.is_dir():
        files = sorted(p for p in path.iterdir() if p.suffix.lower() in PICTURES)
        return [_entry(file, *referenced) for file in files if (referenced := georeference(file))]
    if path.suffix.lower() in WORLD_SUFFIXES:
        same_stem = sorted(path.parent.glob(f'{path.stem}.*'))
        pictures = [p for p in same_stem if p.suffix.lower() in PICTURES]
        if not pictures:
            raise fault(path, 'line 1', 'the picture of this world file is missing')
        path = pictures[0]
    referenced = georeference(path)
    if referenced is None:
        raise fault(path, 'byte 0', 'a georeference or a world file is missing')
    return [_entry(path, *referenced)]


def georeference(path):
    """Return (place, world from pixel corners (2, 3), crs), None without a georeference."""
    world_path = world_file(path)
    if world_path is not None:
        lines = list(data_lines(world_path))
        numbers = [x for line in lines for x in line.numbers(line.text.split())]
        if len(numbers) != 6:
            problem = f'a world file must have 6 numbers, got {len(numbers)}'
            raise fault(world_path, f'line {len(lines)}', problem)
        a, d, b, e, c, f = numbers
        return lines[0], _from_corner([[a, b, c], [d, e, f]]), _projection(path)
    tags = _tiff(path) if path.suffix.lower() in ('.tif', '.tiff') else None
    world_from_pixel = tags and _tiff_matrix(path, tags)
    if world_from_pixel:
        place, crs = Place(path, 'its GeoTIFF tags'), _tiff_crs(tags) or _projection(path)
        return place, np.array(world_from_pixel), crs
    return _by_rasterio(path)


def is_referenced(path) -> bool:
    """Return whether a picture has a georeference or a world file."""
    return georeference(path) is not None


def world_file(path) -> Path | None:
    """Return the world file of a picture."""
    suffix = path.suffix.lower()
    names = {f'{suffix[:2]}{suffix[-1]}w', f'{suffix}w', '.wld'} & set(WORLD_SUFFIXES)
    for name in sorted(names):
        for name_case in (name, name.upper()):
            if path.with_suffix(name_case).is_file():
                return path.with_suffix(name_case)
    return None


def _from_corner(matrix):
    """Return the matrix from pixel corners, given that from pixel centres."""
    shifted = np.array(matrix)
    shifted[:, 2] -= 0.5 * (shifted[:, 0] + shifted[:, 1])
    return shifted


def _projection(path):
    """Return the text of the .prj file beside a picture."""
    file = path.with_suffix('.prj')
    return file.read_text(errors='replace')[:10000].strip() if file.is_file() else None


def _entry(path, place, world_from_pixel, crs):
    def make(size):
        right, down = world_from_pixel[:, 0] * size[0], world_from_pixel[:, 1] * size[1]
        lower_corner = np.append(world_from_pixel[:, 2] + down, 0.0)
        width, height = np.hypot(*right), np.hypot(*down)
        if right[0] * down[1] - right[1] * down[0] >= 0:
            raise place.error(
                f'the georeference must not mirror the picture, got {world_from_pixel.tolist()}'
            )
        sides = np.append(right, 0.0), np.append(-down, 0.0)
        with place.named():
            return Orthographic(lower_corner, *sides, width, height, size=size)

    return Entry(place, path.name, None, make, crs)


def _tiff(path) -> dict | None:
    """Return the tags of the first directory of a TIFF or BigTIFF file, None for others."""
    with path.open('rb') as file:
        header = file.read(16)
        order = {b'II': '<', b'MM': '>'}.get(header[:2])
        if order is None or len(header) < 16:
            return None
        (magic,) = struct.unpack_from(order + 'H', header, 2)
        if magic not in (42, 43):
            return None
        is_big = magic == 43
        (start,) = struct.unpack_from(order + ('Q' if is_big else 'I'), header, 8 if is_big else 4)
        try:
            return dict(_tiff_tags(file, order, start, is_big))
        except (struct.error, OverflowError, ValueError, OSError):
            raise fault(path, f'byte {start}', 'the tag directory is broken') from None


def _tiff_tags(file, order, start, is_big):
    """Yield names and values of the tags in `_TAGS`."""
    counter, entry_size, value_size = ('Q', 20, 8) if is_big else ('H', 12, 4)
    file.seek(start)
    (count,) = struct.unpack(order + counter, file.read(struct.calcsize(counter)))
    table = file.read(entry_size * min(count, 4096))
    for offset in range(0, len(table) - entry_size + 1, entry_size):
        entry_format = order + ('HHQ' if is_big else 'HHI')
        tag, value_type, value_count = struct.unpack_from(entry_format, table, offset)
        if tag not in _TAGS or value_type not in _FORMS or value_count > _MAX_VALUES:
            continue
        length, end = value_count * _SIZES[value_type], offset + entry_size
        data = table[end - value_size : end]
        if length > value_size:
            file.seek(struct.unpack(order + ('Q' if is_big else 'I'), data)[0])
            data = file.read(length)
        yield _TAGS[tag], struct.unpack(f'{order}{value_count}{_FORMS[value_type]}', data[:length])


def _geo_keys(tags):
    keys = tags.get('keys', ())
    return {keys[i]: keys[i + 3] for i in range(4, len(keys) - 3, 4) if not keys[i + 1]}


def _tiff_matrix(path, tags):
    """Return the matrix from pixel corners, (2, 3), None without one."""
    if len(tags.get('matrix', ())) == 16:
        matrix = np.reshape(tags['matrix'], (4, 4))[:2, [0, 1, 3]]
    elif len(tags.get('scale', ())) >= 2 and len(tags.get('tie', ())) >= 6:
        (sx, sy), (i, j, _, x, y, _) = tags['scale'][:2], tags['tie'][:6]
        matrix = np.array([[sx, 0, x - i * sx], [0, -sy, y + j * sy]])
    else:
        return None
    if not np.isfinite(matrix).all():
        raise fault(path, 'its GeoTIFF tags', f'numbers must be finite, got {matrix.tolist()}')
    is_pixel_center = _geo_keys(tags).get(1025) == 2  # PixelIsPoint
    return (_from_corner(matrix) if is_pixel_center else matrix).tolist()


def _tiff_crs(tags):
    keys = _geo_keys(tags)
    code = next((keys[k] for k in (3072, 2048) if 0 < keys.get(k, 0) < 32767), None)
    return code and f'EPSG:{code}'


def _by_rasterio(path):
    """Return the georeference of other formats, None without rasterio."""
    try:
        rasterio = importlib.import_module('rasterio')
    except ImportError:
        return None
    try:
        with warnings.catch_warnings():
            warnings.simplefilter('ignore')
            with rasterio.open(path) as file:
                world_from_pixel, crs = np.reshape(file.transform[:6], (2, 3)), file.crs
    except rasterio.errors.RasterioIOError:
        return None
    if np.array_equal(world_from_pixel, np.eye(2, 3)):
        return None
    return Place(path, 'as rasterio reads it'), world_from_pixel, crs and crs.to_string()
