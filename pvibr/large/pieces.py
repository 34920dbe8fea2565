"""Files of large meshes that are read in pieces: binary PLY, binary STL, heights by rasterio."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from pathlib import Path

import numpy as np

from pvibr.core.errors import require
from pvibr.core.files import existing
from pvibr.io.ply_headers import CORNERS, PLY_TYPES, ply_header
from pvibr.large.build import TriangleMesh
from pvibr.large.sources import Source

#: Properties of PLY files that are one array, as VTK names it.
_PLY_ARRAYS = {'RGBA': ('red', 'green', 'blue', 'alpha'), 'RGB': ('red', 'green', 'blue')}
_POINT, _NORMAL = ('x', 'y', 'z'), ('nx', 'ny', 'nz')
#: Names of texture coordinates in PLY files.
_COORDINATES = ('u', 'v'), ('s', 't'), ('texture_u', 'texture_v')
_STL_HEAD = 84
_STL = np.dtype([('normal', '<f4', 3), ('corners', '<f4', (3, 3)), ('attribute', '<u2')])
#: Points at most: they are numbered by 32 bits.
_MOST_POINTS = 2**31 - 1
#: Bytes that GDAL keeps of what it read.
_GDAL_BYTES = 1 << 26


class Rows:
    """Rows that are made when they are asked for."""

    def __init__(self, count: int, read: Callable[[int, int], np.ndarray]):
        self._count, self._read = count, read

    def __len__(self) -> int:
        """Return the number of rows."""
        return self._count

    def __getitem__(self, rows: slice) -> np.ndarray:
        """Return some rows."""
        start, stop, _ = rows.indices(self._count)
        return self._read(start, max(start, stop))


def source_in_pieces(path) -> Source | None:
    """Return the triangles of a file that can be read in pieces, None for other files."""
    path = existing(path, 'mesh file')
    suffix = path.suffix.lower()
    if suffix == '.ply':
        return _ply(path)
    if suffix == '.stl':
        return _stl(path)
    return _heights(path) if suffix in ('.tif', '.tiff') else None


def _records(path, dtype, offset, count, decode) -> Rows:
    """Return what is decoded of the records of a file."""

    def read(start, stop):
        # Read, not mapped: what was read does not stay in memory.
        at = offset + start * dtype.itemsize
        return decode(np.fromfile(path, dtype, stop - start, offset=at))

    return Rows(count, read)


def _fields(path, dtype, offset, count, names) -> Rows:
    """Return fields of the records of a file as the columns of an array, or one as it is."""
    if len(names) == 1:
        return _records(path, dtype, offset, count, lambda found: found[names[0]])
    return _records(
        path, dtype, offset, count, lambda found: np.stack([found[n] for n in names], 1)
    )


def _ply(path) -> Source | None:
    """Return the triangles of a binary PLY file, None where it has other faces or more."""
    try:
        header = ply_header(path)
    except ValueError:  # which is told where it is read
        return None
    order, elements = header.order, header.elements
    if not order or [element.name for element in elements] != ['vertex', 'face']:
        return None
    vertex, face = (_record(element.properties, order) for element in elements)
    if vertex is None or face is None or not {*_POINT} <= {*(vertex.names or ())}:
        return None
    point_count, face_count = (element.count for element in elements)
    start, names = header.size, vertex.names or ()
    face_start = start + point_count * vertex.itemsize
    size, least = path.stat().st_size, face_start + face_count * face.itemsize
    if size != least or not face_count:  # it is cut, or faces have more corners
        return None

    def of_points(fields):
        return _fields(path, vertex, start, point_count, fields)

    given = {*names}
    coordinates = next((pair for pair in _COORDINATES if {*pair} <= given), ())
    mesh = TriangleMesh(
        of_points(_POINT),
        _records(path, face, face_start, face_count, _triangles_of),
        range(face_count),
        of_points(_NORMAL) if {*_NORMAL} <= given else None,
        of_points(coordinates) if coordinates else None,
    )
    colors = next((name for name, of in _PLY_ARRAYS.items() if {*of} <= given), None)
    arrays = {colors: of_points(_PLY_ARRAYS[colors])} if colors else {}
    used = {*_POINT, *_NORMAL, *coordinates, *(_PLY_ARRAYS[colors] if colors else ())}
    arrays |= {name: of_points([name]) for name in names if name not in used}
    of_faces = [name for name in face.names or () if name not in ('corner_count', 'corners')]
    cell_arrays = {n: _fields(path, face, face_start, face_count, [n]) for n in of_faces}
    return Source(mesh, arrays, colors, cell_arrays, face_count, point_count)


def _record(properties, order) -> np.dtype | None:
    """Return the records of an element of a PLY file, None where they are not of one size."""
    fields: list[tuple] = []
    for words in properties:
        kinds = [order + PLY_TYPES[name] for name in words[words[0] == 'list' : -1]]
        if words[0] != 'list':
            fields.append((words[-1], kinds[0]))
        elif words[-1] in CORNERS:
            fields += [('corner_count', kinds[0]), ('corners', kinds[1], 3)]
        else:
            return None
    try:
        return np.dtype(fields)
    except ValueError:  # a name that occurs twice
        return None


def _triangles_of(faces) -> np.ndarray:
    if (faces['corner_count'] != 3).any():
        raise ValueError('its faces must be triangles: some are not, or the file is damaged')
    return faces['corners'].astype(np.int64)


def _stl(path) -> Source | None:
    """Return the triangles of a binary STL file, None for one of text."""
    with path.open('rb') as file:
        head = file.read(_STL_HEAD)
    count = int(np.frombuffer(head, '<u4', 1, 80)[0]) if len(head) == _STL_HEAD else 0
    if not count or path.stat().st_size != _STL_HEAD + count * _STL.itemsize:
        return None

    def points(start, stop):
        first, last = start // 3, -(-stop // 3)
        at = _STL_HEAD + first * _STL.itemsize
        corners = np.fromfile(path, _STL, last - first, offset=at)['corners'].reshape(-1, 3)
        return corners[start - 3 * first : stop - 3 * first]

    def faces(start, stop):
        return np.arange(3 * start, 3 * stop).reshape(-1, 3)

    _check_count(3 * count)
    mesh = TriangleMesh(Rows(3 * count, points), Rows(count, faces), range(count), is_soup=True)
    return Source(mesh, cell_count=count)


def _check_count(count):
    if count > _MOST_POINTS:
        raise ValueError(f'mesh must have at most {_MOST_POINTS} points, got {count}')


def _heights(path) -> Source:
    """Return the triangles between the pixels of a raster of heights, its first band."""
    rasterio = require('rasterio', 'geo', 'heights in GeoTIFF files')
    with rasterio.Env(GDAL_CACHEMAX=_GDAL_BYTES):
        raster = rasterio.open(path)
    width, height = raster.width, raster.height
    if min(width, height) < 2:
        raise ValueError(f'path must be a raster of heights, got {width} x {height} pixels')
    _check_count(width * height)
    matrix = np.reshape(raster.transform[:6], (2, 3))

    def values(start, stop):
        """Heights of pixels, row by row, NaN where there is none."""
        first, last = start // width, -(-stop // width)
        window = rasterio.windows.Window(0, first, width, last - first)
        with rasterio.Env(GDAL_CACHEMAX=_GDAL_BYTES):
            band = raster.read(1, window=window, masked=True)
        found = np.ma.filled(band.astype(np.float64), np.nan).ravel()
        found[~np.isfinite(found)] = np.nan
        return found[start - first * width : stop - first * width]

    filler = _first_height(values, width, height)

    def points(start, stop):
        at = np.arange(start, stop)
        centers = np.stack([at % width + 0.5, at // width + 0.5, np.ones(len(at))])
        # Points without a height are of no triangle.
        return np.c_[(matrix @ centers).T, np.nan_to_num(values(start, stop), nan=filler)]

    is_mirrored = np.linalg.det(matrix[:, :2]) < 0  # rows go down, as north is up in most

    def faces(start, stop):
        triangle = np.arange(start, stop)
        row, column = np.divmod(triangle // 2, width - 1)
        first = row * width + column
        upper = np.stack([first, first + 1, first + width], 1)
        lower = np.stack([first + 1, first + width + 1, first + width], 1)
        found = np.where((triangle % 2 == 0)[:, None], upper, lower)
        found = found[:, ::-1] if is_mirrored else found
        low, high = int(found.min(initial=width * height)), int(found.max(initial=0))
        is_missing = np.isnan(values(low, high + 1))
        # Without area, they are left out.
        return np.where(is_missing[found - low].any(1)[:, None], low, found)

    count = 2 * (width - 1) * (height - 1)
    mesh = TriangleMesh(Rows(width * height, points), Rows(count, faces), range(count))
    heights = Rows(width * height, lambda start, stop: values(start, stop).astype(np.float32))
    return Source(mesh, {'height': heights}, 'height', {}, count, width * height)


def _first_height(values, width, height) -> float:
    """Return some height of a raster."""
    for row in range(height):
        found = values(row * width, (row + 1) * width)
        if np.isfinite(found).any():
            return float(found[np.isfinite(found)][0])
    raise ValueError('path must be a raster of heights, got one without any')


def digest_of(path: Path) -> str:
    """Return a digest of the content of a file."""
    digest = hashlib.blake2b(digest_size=20)
    with path.open('rb') as file:
        while content := file.read(1 << 24):
            digest.update(content)
    return digest.hexdigest()
