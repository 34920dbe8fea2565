"""Orthophotos: GeoTIFF, and pictures with world files.

A world file names the centre of the first pixel, a GeoTIFF its corner unless it says otherwise.
"""

from __future__ import annotations

import importlib
import struct
from pathlib import Path

import numpy as np

from pvibr.cameras.files import Place, data_lines, fault
from pvibr.cameras.photos import Entry
from pvibr.maths.orthographic import Orthographic

#: Suffixes of world files: first and last letter of the picture's and w, or the whole and w.
WORLD_SUFFIXES = ('.tfw', '.tifw', '.jgw', '.jpgw', '.jpegw', '.pgw', '.pngw', '.bpw', '.wld')
PICTURES = ('.tif', '.tiff', '.jpg', '.jpeg', '.png', '.bmp', '.jp2', '.webp')
_SIZES = {1: 1, 2: 1, 3: 2, 4: 4, 5: 8, 11: 4, 12: 8, 13: 4, 16: 8}
_FORMS = {1: 'B', 2: 's', 3: 'H', 4: 'I', 11: 'f', 12: 'd', 13: 'I', 16: 'Q'}
_TAGS = {33550: 'scale', 33922: 'tie', 34264: 'matrix', 34735: 'keys'}
_MOST = 1 << 20  # values of a tag


def read(path):
    """Return the entry of a picture or of its world file, or those of all in a folder."""
    if path.is_dir():
        files = sorted(p for p in path.iterdir() if p.suffix.lower() in PICTURES)
        return [_entry(file, *found) for file in files if (found := georeference(file))]
    if path.suffix.lower() in WORLD_SUFFIXES:
        beside = [
            p for p in sorted(path.parent.glob(f'{path.stem}.*')) if p.suffix.lower() in PICTURES
        ]
        if not beside:
            raise fault(path, 'line 1', 'there is no picture of this name beside it')
        path = beside[0]
    found = georeference(path)
    if found is None:
        raise fault(path, 'byte 0', 'it has no georeference and no world file beside it')
    return [_entry(path, *found)]


def georeference(path):
    """Return (place, matrix, crs): the matrix (2, 3) is of corners of pixels; None without one."""
    world = world_file(path)
    if world is not None:
        lines = list(data_lines(world))
        numbers = [x for line in lines for x in line.numbers(line.text.split())]
        if len(numbers) != 6:
            raise fault(world, f'line {len(lines)}', f'there are {len(numbers)} numbers, not 6')
        a, d, b, e, c, f = numbers
        return lines[0], _from_corner([[a, b, c], [d, e, f]]), _projection(path)
    tags = _tiff(path) if path.suffix.lower() in ('.tif', '.tiff') else None
    matrix = tags and _tiff_matrix(path, tags)
    if matrix:
        return (
            Place(path, 'its GeoTIFF tags'),
            np.array(matrix),
            _tiff_crs(tags) or _projection(path),
        )
    return _by_rasterio(path)


def is_referenced(path) -> bool:
    """Return whether a picture has a georeference of its own or a world file."""
    return georeference(path) is not None


def world_file(path) -> Path | None:
    """Return the world file of a picture."""
    ending = path.suffix.lower()
    names = {f'{ending[:2]}{ending[-1]}w', f'{ending}w', '.wld'} & set(WORLD_SUFFIXES)
    for name in sorted(names):
        for case in (name, name.upper()):
            if path.with_suffix(case).is_file():
                return path.with_suffix(case)
    return None


def _from_corner(matrix):
    """Return the matrix from corners of pixels, from that of their centres."""
    found = np.array(matrix)
    found[:, 2] -= 0.5 * (found[:, 0] + found[:, 1])
    return found


def _projection(path):
    """Return the text of the .prj file beside it."""
    file = path.with_suffix('.prj')
    return file.read_text(errors='replace')[:10000].strip() if file.is_file() else None


def _entry(path, place, matrix, crs):
    def make(size):
        right, down = matrix[:, 0] * size[0], matrix[:, 1] * size[1]
        corner = np.append(matrix[:, 2] + down, 0.0)
        width, height = np.hypot(*right), np.hypot(*down)
        if right[0] * down[1] - right[1] * down[0] >= 0:
            raise place.error(f'the picture is mirrored: {matrix.tolist()}')
        sides = np.append(right, 0.0), np.append(-down, 0.0)
        with place.named():
            return Orthographic(corner, *sides, width, height, size=size)

    return Entry(place, path.name, None, make, crs)


def _tiff(path) -> dict | None:
    """Return the tags of the first directory of a TIFF or BigTIFF file, None if it is neither."""
    with path.open('rb') as file:
        head = file.read(16)
        order = {b'II': '<', b'MM': '>'}.get(head[:2])
        if order is None or len(head) < 16:
            return None
        magic = struct.unpack(order + 'H', head[2:4])[0]
        if magic not in (42, 43):
            return None
        big = magic == 43
        start = struct.unpack(order + ('Q' if big else 'I'), head[8:16] if big else head[4:8])[0]
        try:
            return dict(_tiff_tags(file, order, start, big))
        except (struct.error, OverflowError, ValueError, OSError):
            raise fault(path, f'byte {start}', 'its directory of tags is broken') from None


def _tiff_tags(file, order, start, big):
    """Yield names and values of tags."""
    counter, entry, room = ('Q', 20, 8) if big else ('H', 12, 4)
    file.seek(start)
    (count,) = struct.unpack(order + counter, file.read(struct.calcsize(counter)))
    table = file.read(entry * min(count, 4096))
    for at in range(0, len(table) - entry + 1, entry):
        tag, kind, number = struct.unpack_from(order + ('HHQ' if big else 'HHI'), table, at)
        if tag not in _TAGS or kind not in _FORMS or number > _MOST:
            continue
        length, data = number * _SIZES[kind], table[at + entry - room : at + entry]
        if length > room:
            file.seek(struct.unpack(order + ('Q' if big else 'I'), data)[0])
            data = file.read(length)
        yield _TAGS[tag], struct.unpack(f'{order}{number}{_FORMS[kind]}', data[:length])


def _geo_keys(tags):
    keys = tags.get('keys', ())
    return {keys[i]: keys[i + 3] for i in range(4, len(keys) - 3, 4) if not keys[i + 1]}


def _tiff_matrix(path, tags):
    """Return the matrix of corners of pixels, (2, 3)."""
    if len(tags.get('matrix', ())) == 16:
        m = np.reshape(tags['matrix'], (4, 4))
        matrix = m[:2, [0, 1, 3]]
    elif len(tags.get('scale', ())) >= 2 and len(tags.get('tie', ())) >= 6:
        (sx, sy), (i, j, _, x, y, _) = tags['scale'][:2], tags['tie'][:6]
        matrix = np.array([[sx, 0, x - i * sx], [0, -sy, y + j * sy]])
    else:
        return None
    if not np.isfinite(matrix).all():
        raise fault(path, 'its GeoTIFF tags', f'{matrix.tolist()} should be finite numbers')
    centres = _geo_keys(tags).get(1025) == 2  # PixelIsPoint
    return (_from_corner(matrix) if centres else matrix).tolist()


def _tiff_crs(tags):
    keys = _geo_keys(tags)
    code = next((keys[k] for k in (3072, 2048) if 0 < keys.get(k, 0) < 32767), None)
    return code and f'EPSG:{code}'


def _by_rasterio(path):
    """Return the georeference of any other file where rasterio is installed."""
    try:
        rasterio = importlib.import_module('rasterio')
    except ImportError:
        return None
    import warnings

    try:
        with warnings.catch_warnings():
            warnings.simplefilter('ignore')
            with rasterio.open(path) as file:
                matrix, crs = np.reshape(file.transform[:6], (2, 3)), file.crs
    except rasterio.errors.RasterioIOError:
        return None
    if np.array_equal(matrix, np.eye(2, 3)):
        return None
    return Place(path, 'as rasterio reads it'), matrix, crs and crs.to_string()
