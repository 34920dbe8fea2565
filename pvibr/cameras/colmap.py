"""COLMAP's models: text and binary, of one camera per picture or of rigs (3.12).

The centre of the first pixel is at (0.5, 0.5).
"""

from __future__ import annotations

import numpy as np

from pvibr.cameras.files import Cursor, data_lines, lines_of
from pvibr.cameras.photos import Entry, camera_of, pinhole_matrix
from pvibr.maths.lenses import Lens
from pvibr.maths.quaternions import multiply, rotate, to_matrices

#: Names by number, how many focal lengths each has, and how many more besides the centre.
MODELS = {
    'SIMPLE_PINHOLE': (0, 1, 0),
    'PINHOLE': (1, 2, 0),
    'SIMPLE_RADIAL': (2, 1, 1),
    'RADIAL': (3, 1, 2),
    'OPENCV': (4, 2, 4),
    'OPENCV_FISHEYE': (5, 2, 4),
    'FULL_OPENCV': (6, 2, 8),
    'FOV': (7, 2, 1),
    'SIMPLE_RADIAL_FISHEYE': (8, 1, 1),
    'RADIAL_FISHEYE': (9, 1, 2),
    'THIN_PRISM_FISHEYE': (10, 2, 8),
    'RAD_TAN_THIN_PRISM_FISHEYE': (11, 2, 12),
    'SIMPLE_DIVISION': (12, 1, 1),
    'DIVISION': (13, 2, 1),
    'SIMPLE_FISHEYE': (14, 1, 0),
    'FISHEYE': (15, 2, 0),
    'EUCM': (16, 2, 2),
}
EQUIRECTANGULAR = ('EQUIRECTANGULAR', 17)  # width and height are its numbers
_PER_IMAGE = 4 + 7 * 8 + 4 + 1 + 8  # bytes, at least


def read(path):
    """Return the entries of a folder with cameras, images, and perhaps rigs and frames."""
    folder = path if path.is_dir() else path.parent
    binary = (folder / 'images.bin').is_file() and path.suffix != '.txt'
    tables = _Binary(folder) if binary else _Text(folder)
    cameras = dict(tables.cameras())
    poses = _rig_poses(tables)
    entries = []
    for place, number, pose, camera, name in tables.images():
        if camera not in cameras:
            raise place.error(
                f'image {number} has camera {camera}, which {tables.file("cameras")} lacks'
            )
        origin, model, size, numbers = cameras[camera]
        entries.append(_entry(place, name, poses.get(number, pose), origin, model, size, numbers))
    return entries


def _entry(place, name, pose, origin, model, size, numbers):
    R = _rotation(place, pose[:4])
    return Entry(
        place,
        name,
        size,
        lambda size: model_camera(origin, model, numbers, (R, np.array(pose[4:])), size),
    )


def _rotation(place, quaternion):
    with place.named():
        return to_matrices(quaternion)


def model_camera(place, model, numbers, pose, size):
    """Return the camera of a model's numbers."""
    if model == EQUIRECTANGULAR[0]:
        K = pinhole_matrix(size[0] / (2 * np.pi), size[1] / np.pi, *(np.array(size) / 2 - 0.5))
        return camera_of(place, K, pose, size, lens=Lens('spherical'))
    focal = MODELS[model][1]
    fx, fy = numbers[0], numbers[focal - 1]
    K = pinhole_matrix(fx, fy, *(np.array(numbers[focal : focal + 2]) - 0.5))
    found = shape_of(place, model, numbers[focal + 2 :])
    if isinstance(found, Lens):
        return camera_of(place, K, pose, size, lens=found)
    return camera_of(place, K, pose, size, found)


def shape_of(place, model, k):
    """Return the lens of a model, or OpenCV's coefficients."""
    if model in ('SIMPLE_PINHOLE', 'PINHOLE', 'SIMPLE_RADIAL', 'RADIAL', 'OPENCV', 'FULL_OPENCV'):
        return [*k, 0, 0, 0, 0][:4] if len(k) < 4 else list(k)
    lenses = {
        'FOV': lambda: Lens('fov', k),
        'EUCM': lambda: Lens('unified', k),
        'SIMPLE_DIVISION': lambda: Lens('division', k),
        'DIVISION': lambda: Lens('division', k),
        'THIN_PRISM_FISHEYE': lambda: Lens(
            'equidistant', (), (*k[:2], *k[4:6]), k[2:4], (k[6], 0, k[7], 0)
        ),
        # Its first tangential coefficient is OpenCV's second.
        'RAD_TAN_THIN_PRISM_FISHEYE': lambda: Lens(
            'equidistant', (), k[:6], (k[7], k[6]), k[8:], late=True
        ),
    }
    with place.named():
        return lenses.get(model, lambda: Lens('equidistant', (), k))()


def _rig_poses(tables) -> dict:
    """Return poses of images by number, from rigs and their frames."""
    sensors = {(rig, sensor): pose for rig, sensor, pose in tables.rigs()}
    found = {}
    for rig, pose, images in tables.frames():
        for sensor, image in images:
            relative = sensors.get((rig, sensor))
            if relative is not None:
                found[image] = _composed(relative, pose)
    return found


def _composed(outer, inner):
    """Return a pose after another, as quaternion and translation."""
    q = multiply(outer[:4], inner[:4])
    return [*q, *(rotate(outer[:4], inner[4:]) + outer[4:])]


class _Binary:
    """The binary files."""

    def __init__(self, folder):
        self._folder = folder

    def file(self, name):
        """Return the path of a table."""
        return self._folder / f'{name}.bin'

    def _open(self, name, least):
        if not self.file(name).is_file():
            return None, 0
        cursor = Cursor(self.file(name))
        return cursor, cursor.count(least)

    def cameras(self):
        """Yield number, (place, model, size, numbers)."""
        known = {number: name for name, (number, _, _) in MODELS.items()}
        cursor, count = self._open('cameras', 24)
        for _ in range(count):
            place = cursor.place
            number, model, width, height = cursor.take('IiQQ')
            if model == EQUIRECTANGULAR[1]:
                name, more = EQUIRECTANGULAR[0], 2
            elif model in known:
                name, more = known[model], 2 + sum(MODELS[known[model]][1:])
            else:
                raise place.error(
                    f'camera model {model} is unknown; known are 0 to {EQUIRECTANGULAR[1]}'
                )
            yield number, (place, name, (width, height), np.atleast_1d(cursor.take(f'{more}d')))

    def images(self):
        """Yield place, number, pose, camera and name."""
        cursor, count = self._open('images', _PER_IMAGE)
        for _ in range(count):
            place = cursor.place
            number, *pose, camera = cursor.take('I7dI')
            name = cursor.text()
            yield place, number, pose, camera, name
            cursor.skip(24 * cursor.count(24))

    def rigs(self):
        """Yield rig, sensor and pose of the sensor in the rig, if it has one."""
        cursor, count = self._open('rigs', 8)
        for _ in range(count):
            rig, sensors = cursor.take('II')
            for k in range(sensors):
                sensor = cursor.take('iI')
                if k == 0:
                    yield rig, sensor, (1.0, 0, 0, 0, 0, 0, 0)
                elif cursor.take('B'):
                    yield rig, sensor, cursor.take('7d')

    def frames(self):
        """Yield rig, pose and (sensor, image) of each frame."""
        cursor, count = self._open('frames', 68)
        for _ in range(count):
            _, rig, *pose = cursor.take('II7d')
            images = [cursor.take('iIQ') for _ in range(cursor.count(16, 'I'))]
            yield (
                rig,
                pose,
                [((kind, sensor), image) for kind, sensor, image in images if not kind],
            )


class _Text:
    """The text files."""

    def __init__(self, folder):
        self._folder = folder

    def file(self, name):
        """Return the path of a table."""
        return self._folder / f'{name}.txt'

    def _lines(self, name):
        return data_lines(self.file(name)) if self.file(name).is_file() else ()

    def cameras(self):
        """Yield number, (place, model, size, numbers)."""
        for line in self._lines('cameras'):
            tokens = line.text.split()
            number, width, height = line.numbers([*tokens[:1], *tokens[2:4]], 3, int)
            model, numbers = tokens[1], line.numbers(tokens[4:])
            wanted = 2 if model == EQUIRECTANGULAR[0] else None
            if model in MODELS:
                wanted = 2 + sum(MODELS[model][1:])
            if len(numbers) != wanted:
                msg = f'camera model {model!r} is unknown'
                if wanted:
                    msg = f'{model} has {len(numbers)} numbers; it needs {wanted}'
                raise line.error(msg)
            yield number, (line, model, (width, height), numbers)

    def images(self):
        """Yield place, number, pose, camera and name; every second line is its points."""
        if not self.file('images').is_file():
            return
        points = False
        for line in lines_of(self.file('images')):
            if points:
                points = False
            elif line.text and line.text[0] != '#':
                number, *rest = line.text.split(maxsplit=9)
                if len(rest) != 9:
                    raise line.error('it should be IMAGE_ID QW QX QY QZ TX TY TZ CAMERA_ID NAME')
                (number, camera), points = line.numbers([number, rest[7]], 2, int), True
                yield line, number, line.numbers(rest[:7], 7), camera, rest[8]

    def rigs(self):
        """Yield rig, sensor and pose of the sensor in the rig, if it has one."""
        for line in self._lines('rigs'):
            tokens = line.text.split()
            rig, count = line.numbers(tokens[:2], 2, int)
            at = 2
            for k in range(min(count, len(tokens))):
                kind = tokens[at] if at < len(tokens) else ''
                (number,) = line.numbers(tokens[at + 1 : at + 2], 1, int)
                sensor, at = (0 if kind == 'CAMERA' else 1, number), at + 2
                if k == 0:
                    yield rig, sensor, (1.0, 0, 0, 0, 0, 0, 0)
                    continue
                (has,), at = line.numbers(tokens[at : at + 1], 1, int), at + 1
                if has:
                    yield rig, sensor, line.numbers(tokens[at : at + 7], 7)
                    at += 7

    def frames(self):
        """Yield rig, pose and (sensor, image) of each frame."""
        for line in self._lines('frames'):
            tokens = line.text.split()
            _, rig = line.numbers(tokens[:2], 2, int)
            pose = line.numbers(tokens[2:9], 7)
            (count,) = line.numbers(tokens[9:10], 1, int)
            rest = tokens[10:]
            if len(rest) != 3 * count:
                raise line.error(f'{count} images are announced; {len(rest) / 3:g} follow')
            ids = [line.numbers(rest[i + 1 : i + 3], 2, int) for i in range(0, len(rest), 3)]
            images = [
                ((0, s), i) for (s, i), k in zip(ids, rest[::3], strict=True) if k == 'CAMERA'
            ]
            yield rig, pose, images
