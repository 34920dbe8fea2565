"""COLMAP models, text or binary, with or without rigs (3.12).

The centre of the first pixel is at (0.5, 0.5).
"""

from __future__ import annotations

import numpy as np

from pvibr.maths.lenses import Lens
from pvibr.maths.quaternions import multiply, rotate, to_matrices
from pvibr.photos.camera_parsing import (
    Cursor,
    Entry,
    camera_of,
    data_lines,
    lines_of,
    pinhole_matrix,
)

#: Camera models: id, number of focal lengths, number of parameters after the centre.
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
EQUIRECTANGULAR = ('EQUIRECTANGULAR', 17)  # its parameters are width and height
_IMAGE_SIZE = 4 + 7 * 8 + 4 + 1 + 8  # minimum in bytes


def read(path):
    """Return the entries of a folder with cameras, images, and optional rigs and frames."""
    folder = path if path.is_dir() else path.parent
    binary = (folder / 'images.bin').is_file() and path.suffix != '.txt'
    tables = _Binary(folder) if binary else _Text(folder)
    cameras = dict(tables.cameras())
    poses = _rig_poses(tables)
    entries = []
    for place, image_id, pose, camera_id, name in tables.images():
        if camera_id not in cameras:
            raise place.error(
                f'camera of image {image_id} must be in {tables.file("cameras")}, got {camera_id}'
            )
        origin, model, size, numbers = cameras[camera_id]
        pose = poses.get(image_id, pose)
        entries.append(_entry(place, name, pose, origin, model, size, numbers))
    return entries


def _entry(place, name, image_pose, origin, model, size, numbers):
    with place.named():
        R = to_matrices(image_pose[:4])
    return Entry(
        place,
        name,
        size,
        lambda size: model_camera(origin, model, numbers, (R, np.array(image_pose[4:])), size),
    )


def model_camera(place, model, numbers, pose, size):
    """Return the camera of a model's parameters."""
    if model == EQUIRECTANGULAR[0]:
        K = pinhole_matrix(size[0] / (2 * np.pi), size[1] / np.pi, *(np.array(size) / 2 - 0.5))
        return camera_of(place, K, pose, size, lens=Lens('spherical'))
    focal_count = MODELS[model][1]
    fx, fy = numbers[0], numbers[focal_count - 1]
    K = pinhole_matrix(fx, fy, *(np.array(numbers[focal_count : focal_count + 2]) - 0.5))
    lens_or_distortion = lens_or_coefficients(place, model, numbers[focal_count + 2 :])
    if isinstance(lens_or_distortion, Lens):
        return camera_of(place, K, pose, size, lens=lens_or_distortion)
    return camera_of(place, K, pose, size, lens_or_distortion)


def lens_or_coefficients(place, model, coefficients):
    """Return the lens of a model, or OpenCV coefficients."""
    if model in ('SIMPLE_PINHOLE', 'PINHOLE', 'SIMPLE_RADIAL', 'RADIAL', 'OPENCV', 'FULL_OPENCV'):
        return [*coefficients, 0, 0, 0, 0][:4] if len(coefficients) < 4 else list(coefficients)
    lenses = {
        'FOV': lambda: Lens('fov', coefficients),
        'EUCM': lambda: Lens('unified', coefficients),
        'SIMPLE_DIVISION': lambda: Lens('division', coefficients),
        'DIVISION': lambda: Lens('division', coefficients),
        'THIN_PRISM_FISHEYE': lambda: Lens(
            'equidistant',
            (),
            (*coefficients[:2], *coefficients[4:6]),
            coefficients[2:4],
            (coefficients[6], 0, coefficients[7], 0),
        ),
        # Its tangential coefficients are OpenCV's, swapped.
        'RAD_TAN_THIN_PRISM_FISHEYE': lambda: Lens(
            'equidistant',
            (),
            coefficients[:6],
            (coefficients[7], coefficients[6]),
            coefficients[8:],
            late=True,
        ),
    }
    with place.named():
        return lenses.get(model, lambda: Lens('equidistant', (), coefficients))()


def _rig_poses(tables) -> dict:
    """Return the poses of images by id, from rigs and frames."""
    sensors = {(rig, sensor): pose for rig, sensor, pose in tables.rigs()}
    poses_by_image = {}
    for rig, pose, images in tables.frames():
        for sensor, image in images:
            sensor_pose = sensors.get((rig, sensor))
            if sensor_pose is not None:
                poses_by_image[image] = _composed(sensor_pose, pose)
    return poses_by_image


def _composed(outer, inner):
    """Return the composition of two poses (quaternion, translation), inner first."""
    return [*multiply(outer[:4], inner[:4]), *(rotate(outer[:4], inner[4:]) + outer[4:])]


def _param_count(model) -> int:
    """Return the number of parameters of a model, 0 for an unknown one."""
    if model == EQUIRECTANGULAR[0]:
        return 2
    return 2 + sum(MODELS[model][1:]) if model in MODELS else 0


class _Tables:
    """The files of a model."""

    suffix: str

    def __init__(self, folder):
        self._folder = folder

    def file(self, name):
        """Return the path of a table."""
        return self._folder / (name + self.suffix)


class _Binary(_Tables):
    """The binary files."""

    suffix = '.bin'

    def _open(self, name, entry_size):
        if not self.file(name).is_file():
            return None, 0
        cursor = Cursor(self.file(name))
        return cursor, cursor.count(entry_size)

    def cameras(self):
        """Yield id, (place, model, size, parameters)."""
        models_by_id = {row[0]: name for name, row in MODELS.items()}
        models_by_id[EQUIRECTANGULAR[1]] = EQUIRECTANGULAR[0]
        cursor, camera_count = self._open('cameras', 24)
        for _ in range(camera_count):
            place = cursor.place
            camera_id, model_id, width, height = cursor.take('IiQQ')
            if model_id not in models_by_id:
                raise place.error(f'model must be 0 to {EQUIRECTANGULAR[1]}, got {model_id}')
            model = models_by_id[model_id]
            numbers = np.atleast_1d(cursor.take(f'{_param_count(model)}d'))
            yield camera_id, (place, model, (width, height), numbers)

    def images(self):
        """Yield place, image id, pose, camera id and name."""
        cursor, image_count = self._open('images', _IMAGE_SIZE)
        for _ in range(image_count):
            place = cursor.place
            image_id, *pose, camera_id = cursor.take('I7dI')
            yield place, image_id, pose, camera_id, cursor.text()
            cursor.skip(24 * cursor.count(24))

    def rigs(self):
        """Yield rig, sensor, and the pose of the sensor in the rig if known."""
        cursor, rig_count = self._open('rigs', 8)
        for _ in range(rig_count):
            rig_id, sensors = cursor.take('II')
            for k in range(sensors):
                sensor_id = cursor.take('iI')
                if k == 0:
                    yield rig_id, sensor_id, (1.0, 0, 0, 0, 0, 0, 0)
                elif cursor.take('B'):
                    yield rig_id, sensor_id, cursor.take('7d')

    def frames(self):
        """Yield rig, pose and (sensor, image) of each frame."""
        cursor, frame_count = self._open('frames', 68)
        for _ in range(frame_count):
            _, rig_id, *pose = cursor.take('II7d')
            images = [cursor.take('iIQ') for _ in range(cursor.count(16, 'I'))]
            yield (
                rig_id,
                pose,
                [((kind, sensor), image) for kind, sensor, image in images if not kind],
            )


class _Text(_Tables):
    """The text files."""

    suffix = '.txt'

    def _lines(self, name):
        return data_lines(self.file(name)) if self.file(name).is_file() else ()

    def cameras(self):
        """Yield id, (place, model, size, parameters)."""
        for line in self._lines('cameras'):
            tokens = line.text.split()
            camera_id, width, height = line.numbers([*tokens[:1], *tokens[2:4]], 3, int)
            model, numbers = tokens[1], line.numbers(tokens[4:])
            param_count = _param_count(model)
            if not param_count:
                raise line.error(f'camera model {model!r} is unknown')
            if len(numbers) != param_count:
                raise line.error(f'{model} must have {param_count} parameters, got {len(numbers)}')
            yield camera_id, (line, model, (width, height), numbers)

    def images(self):
        """Yield place, image id, pose, camera id and name; every second line lists points."""
        if not self.file('images').is_file():
            return
        expects_points = False
        for line in lines_of(self.file('images')):
            if expects_points:
                expects_points = False
            elif line.text and line.text[0] != '#':
                image_id, *rest = line.text.split(maxsplit=9)
                if len(rest) != 9:
                    raise line.error('line must be IMAGE_ID QW QX QY QZ TX TY TZ CAMERA_ID NAME')
                image_id, camera_id = line.numbers([image_id, rest[7]], 2, int)
                expects_points = True
                yield line, image_id, line.numbers(rest[:7], 7), camera_id, rest[8]

    def rigs(self):
        """Yield rig, sensor, and the pose of the sensor in the rig if known."""
        for line in self._lines('rigs'):
            tokens = line.text.split()
            rig_id, sensor_count = line.numbers(tokens[:2], 2, int)
            start = 2
            for k in range(min(sensor_count, len(tokens))):
                kind = tokens[start] if start < len(tokens) else ''
                (sensor_id,) = line.numbers(tokens[start + 1 : start + 2], 1, int)
                sensor, start = (0 if kind == 'CAMERA' else 1, sensor_id), start + 2
                if k == 0:
                    yield rig_id, sensor, (1.0, 0, 0, 0, 0, 0, 0)
                    continue
                (has_pose,) = line.numbers(tokens[start : start + 1], 1, int)
                start += 1
                if has_pose:
                    yield rig_id, sensor, line.numbers(tokens[start : start + 7], 7)
                    start += 7

    def frames(self):
        """Yield rig, pose and (sensor, image) of each frame."""
        for line in self._lines('frames'):
            tokens = line.text.split()
            _, rig_id = line.numbers(tokens[:2], 2, int)
            pose = line.numbers(tokens[2:9], 7)
            (image_count,) = line.numbers(tokens[9:10], 1, int)
            rest = tokens[10:]
            if len(rest) != 3 * image_count:
                raise line.error(f'frame must list {image_count} images, got {len(rest) / 3:g}')
            ids = [line.numbers(rest[i + 1 : i + 3], 2, int) for i in range(0, len(rest), 3)]
            images = [
                ((0, s), i) for (s, i), k in zip(ids, rest[::3], strict=True) if k == 'CAMERA'
            ]
            yield rig_id, pose, images
