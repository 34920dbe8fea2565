"""Pix4D's open photogrammetry format, and transforms.json of radiance fields and Blender."""

from __future__ import annotations

from urllib.parse import unquote, urlsplit

import numpy as np

from pvibr.cameras import colmap
from pvibr.cameras.files import json_of
from pvibr.cameras.photos import Entry, camera_of, pinhole_matrix, posed
from pvibr.cameras.programs import spherical_matrix
from pvibr.maths.lenses import Lens

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
        raise json_of(path).error('the project has no calibrated cameras')
    top = files['cameras']
    sensors = {s['id'].whole(): s['internals'] for s in top['sensors']}
    sizes, names = {}, {}
    if 'inputs' in files:
        sizes = {s['id'].whole(): s['image_size_px'] for s in files['inputs']['sensors']}
    if 'list' in files:
        names = {c['id'].whole(): _opf_name(c['uri'].text()) for c in files['list']['cameras']}
    crs = _opf_crs(files.get('frame'))
    entries = []
    for camera in top['cameras']:
        sensor = camera['sensor_id'].whole()
        if sensor not in sensors:
            raise camera.error(f'there is no sensor {sensor}')
        size = sizes.get(sensor)
        size = size and tuple(int(s) for s in size.numbers(2))
        number = camera['id'].whole()
        name = names.get(number, str(number))
        entries.append(_opf_entry(camera, name, size, sensors[sensor], crs))
    return entries


def _opf_files(path) -> dict:
    """Return the files of a project by meaning, beside it or below."""
    top = json_of(path)
    meaning = {form: name for name, form in OPF_FORMATS.items()}
    if top['format'].text() != OPF_PROJECT:
        found = {}
        for file in [path, *sorted(path.parent.glob('*.json'))]:
            form = _opf_format(file)
            if form in meaning and meaning[form] not in found:
                found[meaning[form]] = json_of(file)
        return found
    found, root = {}, path.parent.resolve()
    for item in top['items']:
        for resource in item['resources']:
            form = resource['format'].text()
            file = root / _opf_name(resource['uri'].text())
            inside = file.resolve().is_relative_to(root)
            if form in meaning and meaning[form] not in found and inside:
                if not file.is_file():
                    raise resource.error(f'{file} does not exist')
                found[meaning[form]] = json_of(file)
    return found


def _opf_format(path) -> str:
    with path.open('rb') as file:
        head = file.read(4096)
    return next((form for form in OPF_FORMATS.values() if form.encode() in head), '')


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
    world = _turn(0, omega) @ _turn(1, phi) @ _turn(2, kappa) @ np.diag([1.0, -1.0, -1.0])
    pose = posed(camera, world.T, camera['position'].numbers(3))
    return Entry(camera, name, size, lambda size: _opf_camera(lens, pose, size), crs)


def _turn(axis, angle):
    """Return the rotation about an axis."""
    i, j = (axis + 1) % 3, (axis + 2) % 3
    matrix = np.eye(3)
    matrix[i, i] = matrix[j, j] = np.cos(angle)
    matrix[j, i], matrix[i, j] = np.sin(angle), -np.sin(angle)
    return matrix


def _opf_camera(node, pose, size):
    kind = node['type'].text()
    cx, cy = np.array(node['principal_point_px'].numbers(2)) - 0.5
    if kind == 'spherical':
        K = spherical_matrix(size)
        K[:2, 2] = cx, cy
        return camera_of(node, K, pose, size, lens=Lens('spherical'))
    if kind == 'perspective':
        focal = node['focal_length_px'].number()
        k, p = node['radial_distortion'].numbers(3), node['tangential_distortion'].numbers(2)
        return camera_of(
            node, pinhole_matrix(focal, focal, cx, cy), pose, size, [*k[:2], *p, k[2]]
        )
    if kind != 'fisheye':
        raise node.error(f'type {kind!r} is unknown')
    c, d, e, f = node['affine'].numbers(4)
    # A rotation about the axis on the right of K is one of the camera, as nothing but it is
    # not symmetric about the axis.
    turn = np.eye(3)
    turn[:2, :2] = np.array([[f, -e], [e, f]]) / (np.hypot(e, f) or 1.0)
    K = np.array([[c, d, cx], [e, f, cy], [0, 0, 1.0]]) @ turn.T
    K[1, 0] = 0.0
    pose = turn @ pose[0], turn @ pose[1]
    # Of the angle in units of a right one.
    series = [a * (2 / np.pi) ** i for i, a in enumerate(node['polynomial'].numbers())]
    return camera_of(node, K, pose, size, lens=Lens('polynomial', series))


# -- transforms.json --------------------------------------------------------------------------

_FISHEYES = ('OPENCV_FISHEYE', 'FISHEYE', 'SIMPLE_FISHEYE', 'RADIAL_FISHEYE')


def read_transforms(path):
    """Return the entries; camera to world with y up and z back, first corner at (0, 0)."""
    top, entries = json_of(path), []
    for frame in top['frames']:
        numbers = frame['transform_matrix'].numbers()
        if len(numbers) not in (12, 16):
            raise frame.error(f'transform_matrix has {len(numbers)} numbers; it needs 4 x 4')
        matrix = np.reshape(numbers, (-1, 4))[:3]
        flip = np.diag([1.0, -1.0, -1.0])
        pose = posed(frame, (matrix[:, :3] @ flip).T, matrix[:, 3])
        entries.append(_frame_entry(frame, top, pose))
    return entries


def _frame_entry(frame, top, pose):
    def given(key):
        return frame.get(key) or top.get(key)

    width, height = given('w'), given('h')
    size = None if width is None or height is None else (width.whole(), height.whole())
    name = frame['file_path'].text()
    return Entry(frame, name, size, lambda size: _frame_camera(frame, given, pose, size))


def _frame_camera(frame, given, pose, size):
    def value(key, default=0.0):
        node = given(key)
        return default if node is None else node.number()

    model = given('camera_model')
    model = 'OPENCV' if model is None else model.text().upper()
    fisheye = given('is_fisheye')
    if model == 'EQUIRECTANGULAR':
        return colmap.model_camera(frame, model, (), pose, size)
    fx = value('fl_x', None) or _focal(given('camera_angle_x'), size[0])
    fy = value('fl_y', None) or _focal(given('camera_angle_y'), size[1])
    if not (fx or fy):
        raise frame.error('there is no fl_x and no camera_angle_x')
    K = pinhole_matrix(
        fx or fy, fy or fx, value('cx', size[0] / 2) - 0.5, value('cy', size[1] / 2) - 0.5
    )
    params = given('distortion_params')
    k = [value(f'k{i}') for i in range(1, 7)]
    p1, p2 = value('p1'), value('p2')
    if model in ('THIN_PRISM_FISHEYE', 'RAD_TAN_THIN_PRISM_FISHEYE', 'FISHEYE624', 'FOV', 'EUCM'):
        raise frame.error(f'camera_model {model!r} is not read from transforms.json')
    if params is not None:
        *k, p1, p2 = params.numbers(6)
    if model in _FISHEYES or (fisheye is not None and fisheye.value is True):
        return camera_of(frame, K, pose, size, lens=Lens('equidistant', (), k[:4]))
    if any(k[3:]):
        return camera_of(frame, K, pose, size, lens=Lens('perspective', (), k, (p1, p2)))
    return camera_of(frame, K, pose, size, [k[0], k[1], p1, p2, k[2]])


def _focal(angle, side):
    return None if angle is None else 0.5 * side / np.tan(0.5 * angle.number())
