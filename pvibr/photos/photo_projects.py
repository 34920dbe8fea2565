"""Pix4D's Open Photogrammetry Format, and transforms.json of radiance fields and Blender."""

from __future__ import annotations

from urllib.parse import unquote, urlsplit

import numpy as np

from pvibr.maths.lenses import Lens
from pvibr.photos import colmap
from pvibr.photos.camera_parsing import Entry, camera_of, json_of, pinhole_matrix, posed
from pvibr.photos.camera_programs import spherical_matrix

# -- OPF --------------------------------------------------------------------------------------

OPF_FORMATS = {
    'cameras': 'application/opf-calibrated-cameras+json',
    'inputs': 'application/opf-input-cameras+json',
    'list': 'application/opf-camera-list+json',
    'frame': 'application/opf-scene-reference-frame+json',
}
OPF_PROJECT = 'application/opf-project+json'


def read_opf(path):
    """Return the entries of a project or of its calibrated cameras, in the processing CRS.

    The corner of the first pixel is at (0, 0).
    """
    files = _opf_files(path)
    if 'cameras' not in files:
        raise json_of(path).error('the calibrated cameras are missing')
    calibrated = files['cameras']
    sensors = {s['id'].whole(): s['internals'] for s in calibrated['sensors']}
    sizes_by_sensor, names_by_camera = {}, {}
    if 'inputs' in files:
        sizes_by_sensor = {s['id'].whole(): s['image_size_px'] for s in files['inputs']['sensors']}
    if 'list' in files:
        names_by_camera = {
            c['id'].whole(): _opf_name(c['uri'].text()) for c in files['list']['cameras']
        }
    crs = _opf_crs(files.get('frame'))
    entries = []
    for camera in calibrated['cameras']:
        sensor_id = camera['sensor_id'].whole()
        if sensor_id not in sensors:
            raise camera.error(f'sensor {sensor_id} is missing')
        sensor_size = sizes_by_sensor.get(sensor_id)
        sensor_size = sensor_size and tuple(int(s) for s in sensor_size.numbers(2))
        camera_id = camera['id'].whole()
        name = names_by_camera.get(camera_id, str(camera_id))
        entries.append(_opf_entry(camera, name, sensor_size, sensors[sensor_id], crs))
    return entries


def _opf_files(path) -> dict:
    """Return the files of a project by kind, in its folder or below."""
    document = json_of(path)
    kinds = {kind: name for name, kind in OPF_FORMATS.items()}
    if document['format'].text() != OPF_PROJECT:
        files_by_kind = {}
        for file in [path, *sorted(path.parent.glob('*.json'))]:
            kind = _opf_format(file)
            if kind in kinds and kinds[kind] not in files_by_kind:
                files_by_kind[kinds[kind]] = json_of(file)
        return files_by_kind
    files_by_kind, root = {}, path.parent.resolve()
    for item in document['items']:
        for resource in item['resources']:
            kind = resource['format'].text()
            file = root / _opf_name(resource['uri'].text())
            is_inside = file.resolve().is_relative_to(root)
            if kind in kinds and kinds[kind] not in files_by_kind and is_inside:
                if not file.is_file():
                    raise resource.error(f'{file} is missing')
                files_by_kind[kinds[kind]] = json_of(file)
    return files_by_kind


def _opf_format(path) -> str:
    with path.open('rb') as file:
        header = file.read(4096)
    return next((kind for kind in OPF_FORMATS.values() if kind.encode() in header), '')


def _opf_name(uri) -> str:
    """Return the path of a URI."""
    if '://' not in uri:
        return unquote(uri.split('#')[0])
    return unquote(urlsplit(uri).path).lstrip('/')


def _opf_crs(frame):
    definition = frame and frame['crs']['definition']
    return definition and definition.text()


def _opf_entry(camera, name, size, lens, crs):
    omega, phi, kappa = np.radians(camera['orientation_deg'].numbers(3))
    world_rotation = _turn(0, omega) @ _turn(1, phi) @ _turn(2, kappa) @ np.diag([1.0, -1.0, -1.0])
    camera_pose = posed(camera, world_rotation.T, camera['position'].numbers(3))
    return Entry(camera, name, size, lambda size: _opf_camera(lens, camera_pose, size), crs)


def _turn(axis, angle):
    """Return the rotation matrix about an axis."""
    i, j = (axis + 1) % 3, (axis + 2) % 3
    matrix = np.eye(3)
    matrix[i, i] = matrix[j, j] = np.cos(angle)
    matrix[j, i], matrix[i, j] = np.sin(angle), -np.sin(angle)
    return matrix


def _opf_camera(node, pose, size):
    camera_type = node['type'].text()
    cx, cy = np.array(node['principal_point_px'].numbers(2)) - 0.5
    if camera_type == 'spherical':
        K = spherical_matrix(size)
        K[:2, 2] = cx, cy
        return camera_of(node, K, pose, size, lens=Lens('spherical'))
    if camera_type == 'perspective':
        focal = node['focal_length_px'].number()
        k, p = node['radial_distortion'].numbers(3), node['tangential_distortion'].numbers(2)
        K = pinhole_matrix(focal, focal, cx, cy)
        return camera_of(node, K, pose, size, [*k[:2], *p, k[2]])
    if camera_type != 'fisheye':
        raise node.error(f'type must be perspective, fisheye or spherical, got {camera_type!r}')
    c, d, e, f = node['affine'].numbers(4)
    # The lens is symmetric about its axis, so a rotation in K can move into the pose.
    in_plane = np.eye(3)
    in_plane[:2, :2] = np.array([[f, -e], [e, f]]) / (np.hypot(e, f) or 1.0)
    K = np.array([[c, d, cx], [e, f, cy], [0, 0, 1.0]]) @ in_plane.T
    K[1, 0] = 0.0
    pose = in_plane @ pose[0], in_plane @ pose[1]
    # The polynomial is in units of a right angle.
    series = [a * (2 / np.pi) ** i for i, a in enumerate(node['polynomial'].numbers())]
    return camera_of(node, K, pose, size, lens=Lens('polynomial', series))


# -- transforms.json --------------------------------------------------------------------------

_FISHEYES = ('OPENCV_FISHEYE', 'FISHEYE', 'SIMPLE_FISHEYE', 'RADIAL_FISHEYE')


def read_transforms(path):
    """Return the entries; poses have y up and z back, the first pixel's corner is (0, 0)."""
    document, entries = json_of(path), []
    for frame in document['frames']:
        numbers = frame['transform_matrix'].numbers()
        if len(numbers) not in (12, 16):
            raise frame.error(f'transform_matrix must have 12 or 16 numbers, got {len(numbers)}')
        world_from_camera = np.reshape(numbers, (-1, 4))[:3]
        flip = np.diag([1.0, -1.0, -1.0])
        camera_pose = posed(frame, (world_from_camera[:, :3] @ flip).T, world_from_camera[:, 3])
        entries.append(_frame_entry(frame, document, camera_pose))
    return entries


def _frame_entry(frame, document, pose):
    def lookup(key):
        return frame.get(key) or document.get(key)

    width, height = lookup('w'), lookup('h')
    size = None if width is None or height is None else (width.whole(), height.whole())
    name = frame['file_path'].text()
    return Entry(frame, name, size, lambda size: _frame_camera(frame, lookup, pose, size))


def _frame_camera(frame, lookup, pose, size):
    def value(key, default=0.0):
        node = lookup(key)
        return default if node is None else node.number()

    model = lookup('camera_model')
    model = 'OPENCV' if model is None else model.text().upper()
    fisheye = lookup('is_fisheye')
    if model == 'EQUIRECTANGULAR':
        return colmap.model_camera(frame, model, (), pose, size)
    fx = value('fl_x', None) or _focal(lookup('camera_angle_x'), size[0])
    fy = value('fl_y', None) or _focal(lookup('camera_angle_y'), size[1])
    if not (fx or fy):
        raise frame.error('fl_x or camera_angle_x is missing')
    cx, cy = value('cx', size[0] / 2) - 0.5, value('cy', size[1] / 2) - 0.5
    K = pinhole_matrix(fx or fy, fy or fx, cx, cy)
    params = lookup('distortion_params')
    radial = [value(f'k{i}') for i in range(1, 7)]
    p1, p2 = value('p1'), value('p2')
    if model in ('THIN_PRISM_FISHEYE', 'RAD_TAN_THIN_PRISM_FISHEYE', 'FISHEYE624', 'FOV', 'EUCM'):
        raise frame.error(f'camera_model {model!r} is not supported in transforms.json')
    if params is not None:
        *radial, p1, p2 = params.numbers(6)
    if model in _FISHEYES or (fisheye is not None and fisheye.value is True):
        return camera_of(frame, K, pose, size, lens=Lens('equidistant', (), radial[:4]))
    if any(radial[3:]):
        return camera_of(frame, K, pose, size, lens=Lens('perspective', (), radial, (p1, p2)))
    return camera_of(frame, K, pose, size, [radial[0], radial[1], p1, p2, radial[2]])


def _focal(angle, side):
    return None if angle is None else 0.5 * side / np.tan(0.5 * angle.number())
