"""Cameras of Agisoft Metashape and PhotoScan as XML; the first pixel's centre is (0.5, 0.5).

Files differ in what the numbers of a calibration mean:

- ``<f>``, ``<b1>``, ``<b2>``, and the principal point from the middle of the picture: Metashape,
  and PhotoScan from 1.3 on (manuals, appendix on camera models).
- ``<fx>``, ``<fy>``, ``<skew>``, and the principal point from the corner: PhotoScan up to 1.2. Its
  tangential coefficients are in OpenCV's order (manual of Agisoft Lens 0.4); f = fy,
  b1 = fx - fy, b2 = skew (Agisoft's forum, topic 6437).
- The same for each camera, in a ``<collection>`` without sensors: PhotoScan up to 0.9.
"""

from __future__ import annotations

import numpy as np

from pvibr.core.errors import warn
from pvibr.maths.lenses import Lens
from pvibr.photos.camera_parsing import Element, Entry, camera_of, pinhole_matrix, posed, xml_of

_KINDS = {
    'frame': 'perspective',
    'fisheye': 'equidistant',
    'equidistant_fisheye': 'equidistant',
    'equisolid_fisheye': 'equisolid',
    'spherical': 'spherical',
    'cylindrical': 'cylindrical',
}


def read(path):
    """Return the entries of all chunks, in world units of their transforms."""
    document, entries, unknown_labels = xml_of(path), [], []
    chunks = [document] if document.tag in ('chunk', 'collection') else document.all('chunk')
    for chunk in chunks:
        sensors = {s.get('id'): s for s in chunk.all('sensor')}
        cameras = {c.attributes.get('id', k): c for k, c in enumerate(chunk.all('camera'))}
        worlds_by_id = _worlds(chunk)
        for camera in cameras.values():
            matrix = _matrix(camera, cameras, sensors)
            if matrix is None:
                continue  # not aligned
            sensor = _sensor(camera, sensors)
            if sensor.attributes.get('type', 'frame') not in _KINDS:
                unknown_labels.append(camera.get('label'))
                continue
            world = worlds_by_id.get(camera.attributes.get('component_id'), worlds_by_id[None])
            entries.append(_entry(camera, sensor, world @ matrix))
    if unknown_labels:
        count, label = len(unknown_labels), unknown_labels[0]
        warn(f'{path}: {count} cameras have an unknown projection, such as {label!r}')
    return entries


def _worlds(chunk) -> dict:
    """Return world from component, (4, 4), by component; that of the chunk under None."""
    worlds = {None: _similarity(chunk.find('transform'))}
    for component in chunk.all('component'):
        if component.find('transform') is not None and 'id' in component.attributes:
            worlds[component.get('id')] = _similarity(component.find('transform'))
    return worlds


def _similarity(element):
    """Return the matrix of a rotation, scale and translation, (4, 4)."""
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
    """Return the sensor of a camera, which up to PhotoScan 0.9 is itself."""
    key = camera.attributes.get('sensor_id')
    if key is None and camera.find('calibration') is not None:
        return camera
    if key not in sensors:
        raise camera.error(f'sensor {key!r} is missing')
    return sensors[key]


def _matrix(camera, cameras, sensors):
    """Return chunk from camera, (4, 4), for rigs by the master camera; None if not aligned."""
    element = camera.find('transform')
    if element is not None:
        return np.reshape(element.values(16), (4, 4))
    master = cameras.get(camera.attributes.get('master_id'))
    if master is None or master is camera or master.find('transform') is None:
        return None
    sensor, rig_from_camera = _sensor(camera, sensors), np.eye(4)
    rotation, location = sensor.find('rotation'), sensor.find('location')
    if rotation is not None:
        rig_from_camera[:3, :3] = np.reshape(rotation.values(9), (3, 3))
    if location is not None:
        rig_from_camera[:3, 3] = location.values(3)
    return np.reshape(master.find('transform').values(16), (4, 4)) @ rig_from_camera


def _entry(camera, sensor, matrix):
    pose = posed(camera, matrix[:3, :3].T, matrix[:3, 3])
    calibrations = list(sensor.all('calibration'))
    adjusted = [c for c in calibrations if c.attributes.get('class') == 'adjusted']
    calibration = (adjusted or calibrations or [None])[0]
    resolution = calibration and calibration.find('resolution')
    resolution = resolution or sensor.find('resolution')
    if resolution is None:
        raise sensor.error('the sensor has no resolution')
    sides = [resolution.get('width'), resolution.get('height')]
    size = tuple(resolution.numbers(sides, 2, int))
    label = camera.get('label')
    return Entry(
        camera,
        label,
        size,
        lambda size: _camera(sensor, calibration, pose, size),
    )


def _camera(sensor, calibration, pose, size):
    lens_kind = _KINDS[sensor.attributes.get('type', 'frame')]
    if calibration is None and lens_kind != 'spherical':
        raise sensor.error('the sensor has no calibration')
    # Panoramas may have no calibration.
    K = _intrinsics(calibration or Element(sensor.path, sensor.number, '', {}), size, lens_kind)
    if lens_kind in ('spherical', 'cylindrical'):
        return camera_of(calibration or sensor, K, pose, size, lens=Lens(lens_kind))
    radial = [calibration.value(f'k{i}') for i in range(1, 5)]
    p1, p2, p3, p4 = (calibration.value(f'p{i}') for i in range(1, 5))
    if not _is_absolute(calibration):
        p1, p2 = p2, p1  # to OpenCV's order
    if lens_kind == 'perspective' and not (radial[3] or p3 or p4):
        return camera_of(calibration, K, pose, size, [*radial[:2], p1, p2, radial[2]])
    lens = Lens(lens_kind, (), radial, (p1, p2, p3, p4))
    return camera_of(calibration, K, pose, size, lens=lens)


def _is_absolute(calibration) -> bool:
    """Return whether a calibration is as PhotoScan up to 1.2 wrote it."""
    return calibration.find('fx') is not None


def _intrinsics(calibration, size, lens_kind):
    """Return K, whose pixel centres are whole numbers."""
    value, (width, height) = calibration.value, size
    if _is_absolute(calibration):
        cx, cy = value('cx', width / 2), value('cy', height / 2)
        fx, fy, skew = value('fx'), value('fy'), value('skew')
    else:
        cx, cy = width / 2 + value('cx'), height / 2 + value('cy')
        fy = value('f', width / (2 * np.pi) if lens_kind == 'spherical' else 0.0)
        fx, skew = fy + value('b1'), value('b2')
    return pinhole_matrix(fx, fy, cx - 0.5, cy - 0.5, skew)
