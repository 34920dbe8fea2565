"""Cameras of Agisoft Metashape as XML; the centre of the first pixel is at (0.5, 0.5)."""

from __future__ import annotations

import numpy as np

from pvibr.cameras.files import xml_of
from pvibr.cameras.photos import Entry, camera_of, pinhole_matrix, posed
from pvibr.core.errors import warn
from pvibr.maths.lenses import Lens

_KINDS = {
    'frame': 'perspective',
    'fisheye': 'equidistant',
    'equidistant_fisheye': 'equidistant',
    'equisolid_fisheye': 'equisolid',
    'spherical': 'spherical',
    'cylindrical': 'cylindrical',
}


def read(path):
    """Return the entries of all chunks, in the world of the chunk's transform."""
    top, entries, left = xml_of(path), [], []
    for chunk in [top] if top.tag == 'chunk' else top.all('chunk'):
        sensors = {s.get('id'): s for s in chunk.all('sensor')}
        cameras = {c.get('id'): c for c in chunk.all('camera')}
        worlds = _worlds(chunk)
        for camera in cameras.values():
            matrix = _matrix(camera, cameras, sensors)
            if matrix is None:
                continue  # it was not aligned
            sensor = _sensor(camera, sensors)
            if sensor.attributes.get('type', 'frame') not in _KINDS:
                left.append(camera.get('label'))
                continue
            world = worlds.get(camera.attributes.get('component_id'), worlds[None])
            entries.append(_entry(camera, sensor, world @ matrix))
    if left:
        warn(f'{path}: {len(left)} cameras are of no known projection, such as {left[0]!r}.')
    return entries


def _worlds(chunk) -> dict:
    """Return the worlds of components, and of the chunk under None, as (4, 4)."""
    found = {None: _similarity(chunk.find('transform'))}
    for component in chunk.all('component'):
        if component.find('transform') is not None and 'id' in component.attributes:
            found[component.get('id')] = _similarity(component.find('transform'))
    return found


def _similarity(element):
    """Return a rotation, scale and translation, (4, 4)."""
    matrix = np.eye(4)
    if element is None:
        return matrix
    rotation, translation = element.find('rotation'), element.find('translation')
    if rotation is not None:
        matrix[:3, :3] = np.reshape(rotation.values(9), (3, 3))
    matrix[:3, :3] *= element.value('scale', 1.0)
    if translation is not None:
        matrix[:3, 3] = translation.values(3)
    return matrix


def _sensor(camera, sensors):
    key = camera.attributes.get('sensor_id')
    if key not in sensors:
        raise camera.error(f'there is no sensor {key!r}')
    return sensors[key]


def _matrix(camera, cameras, sensors):
    """Return the chunk from the camera, (4, 4), in a rig by its master; None if not aligned."""
    element = camera.find('transform')
    if element is not None:
        return np.reshape(element.values(16), (4, 4))
    master = cameras.get(camera.attributes.get('master_id'))
    if master is None or master is camera or master.find('transform') is None:
        return None
    sensor, relative = _sensor(camera, sensors), np.eye(4)
    rotation, location = sensor.find('rotation'), sensor.find('location')
    if rotation is not None:
        relative[:3, :3] = np.reshape(rotation.values(9), (3, 3))
    if location is not None:
        relative[:3, 3] = location.values(3)
    return np.reshape(master.find('transform').values(16), (4, 4)) @ relative


def _entry(camera, sensor, matrix):
    pose = posed(camera, matrix[:3, :3].T, matrix[:3, 3])
    found = list(sensor.all('calibration'))
    adjusted = [c for c in found if c.attributes.get('class') == 'adjusted']
    calibration = (adjusted or found or [None])[0]
    resolution = (
        sensor.find('resolution') if calibration is None else calibration.find('resolution')
    )
    resolution = resolution or sensor.find('resolution')
    if resolution is None:
        raise sensor.error('the sensor has no resolution')
    sides = [resolution.get('width'), resolution.get('height')]
    size = tuple(resolution.numbers(sides, 2, int))
    return Entry(
        camera,
        camera.get('label'),
        size,
        lambda size: _camera(sensor, calibration, pose, size),
    )


def _camera(sensor, calibration, pose, size):
    kind = _KINDS[sensor.attributes.get('type', 'frame')]
    middle = np.array(size) / 2 - 0.5
    if kind == 'spherical':
        focal = size[0] / (2 * np.pi)
        if calibration is not None:
            focal = calibration.value('f', focal)
            middle = np.add(middle, [calibration.value('cx'), calibration.value('cy')])
        return camera_of(
            sensor, pinhole_matrix(focal, focal, *middle), pose, size, lens=Lens(kind)
        )
    if calibration is None:
        raise sensor.error('the sensor has no calibration')
    value, place = calibration.value, calibration
    fy = value('f', value('fy', 0.0))
    fx, skew = value('fx', fy) + value('b1'), value('b2', value('skew'))
    cx, cy = np.add(middle, [value('cx'), value('cy')])
    K = pinhole_matrix(fx, fy, cx, cy, skew)
    if kind == 'cylindrical':
        return camera_of(place, K, pose, size, lens=Lens(kind))
    radial = [value(f'k{i}') for i in range(1, 5)]
    p1, p2, p3, p4 = (value(f'p{i}') for i in range(1, 5))
    if kind == 'perspective' and not (radial[3] or p3 or p4):  # its p1 is OpenCV's p2
        return camera_of(place, K, pose, size, [*radial[:2], p2, p1, radial[2]])
    lens = Lens(kind, (), radial, (p2, p1, p3, p4))
    return camera_of(place, K, pose, size, lens=lens)
