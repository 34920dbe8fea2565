"""Cameras of OpenSfM, OpenMVG, OpenMVS, Bundler and VisualSFM."""

from __future__ import annotations

import numpy as np

from pvibr.core.errors import warn
from pvibr.maths.lenses import Lens
from pvibr.maths.quaternions import from_axis_angle, to_matrices
from pvibr.photos.camera_parsing import (
    Cursor,
    Entry,
    Line,
    camera_of,
    data_lines,
    json_of,
    pinhole_matrix,
    posed,
)

_NO_INDEX = 0xFFFFFFFF  # of OpenMVS and OpenMVG


def spherical_matrix(size):
    """Return K of a spherical panorama whose longer side is a full circle."""
    focal, (cx, cy) = max(size) / (2 * np.pi), np.array(size) / 2 - 0.5
    return pinhole_matrix(focal, focal, cx, cy)


# -- OpenSfM ----------------------------------------------------------------------------------


def read_opensfm(path):
    """Return the entries of a reconstruction.json.

    Image coordinates are in units of the longer side from the centre, (w - 1) / 2 in pixels.
    """
    reconstructions = list(json_of(path))
    if not reconstructions:
        return []
    if len(reconstructions) > 1:
        count = len(reconstructions)
        warn(f'{path} has {count} reconstructions with separate worlds: only the first is read')
    cameras = dict(reconstructions[0]['cameras'].items())
    shots = [node for key in ('shots', 'pano_shots') if (node := reconstructions[0].get(key))]
    return [_opensfm_entry(name, shot, cameras) for node in shots for name, shot in node.items()]


def _opensfm_entry(name, shot, cameras):
    camera_id = shot['camera'].text()
    if camera_id not in cameras:
        raise shot.error(f'camera {camera_id!r} is missing')
    camera = cameras[camera_id]
    rotation_vector = np.array(shot['rotation'].numbers(3))
    angle = np.linalg.norm(rotation_vector)
    if not angle < 1e6:
        problem = f'rotation must be an axis times radians, got {rotation_vector.tolist()}'
        raise shot.error(problem)
    q = from_axis_angle(rotation_vector / angle, angle) if angle else [1.0, 0, 0, 0]
    pose = to_matrices(q), shot['translation'].numbers(3)
    size = camera['width'].whole(), camera['height'].whole()
    return Entry(shot, name, size, lambda size: _opensfm_camera(camera, pose, size))


def _opensfm_camera(node, pose, size):
    projection = node.get('projection_type')
    projection = 'perspective' if projection is None else projection.text()
    if projection in ('spherical', 'equirectangular'):
        return camera_of(node, spherical_matrix(size), pose, size, lens=Lens('spherical'))
    value, longer_side = node.value_of, max(size)
    if node.get('focal_x') is not None:
        fx, fy = node['focal_x'].number(), node['focal_y'].number()
    else:
        fx = fy = node['focal'].number()
    center = (np.array(size) - 1) / 2 + longer_side * np.array([value('c_x'), value('c_y')])
    K = pinhole_matrix(fx * longer_side, fy * longer_side, *center)
    brown = [value('k1'), value('k2'), value('p1'), value('p2'), value('k3')]
    if projection in ('perspective', 'brown', 'radial', 'simple_radial'):
        return camera_of(node, K, pose, size, brown)
    radial = [value(f'k{i}') for i in range(1, 7)]
    if projection == 'dual':
        lens = Lens('dual', (value('transition', 0.5),), radial[:2])
    elif projection in ('fisheye', 'fisheye_opencv', 'fisheye62', 'fisheye624'):
        prism = [value(f's{i}') for i in range(4)]
        lens = Lens('equidistant', (), radial, (value('p1'), value('p2')), prism)
    else:
        raise node.error(f'projection_type {projection!r} is unknown')
    return camera_of(node, K, pose, size, lens=lens)


# -- OpenMVG ----------------------------------------------------------------------------------


def read_openmvg(path):
    """Return the entries of a sfm_data.json; pixel centres have integer coordinates."""
    document = json_of(path)
    poses = {node['key'].whole(): node['value'] for node in document['extrinsics']}
    intrinsics = {node['key'].whole(): node['value'] for node in document['intrinsics']}
    root_path = document.get('root_path')
    entries = []
    for node in document['views']:
        view = node['value']['ptr_wrapper']['data']
        pose = poses.get(view['id_pose'].whole())
        intrinsic_id = view['id_intrinsic'].whole()
        if pose is None or intrinsic_id == _NO_INDEX:
            continue  # not registered
        if intrinsic_id not in intrinsics:
            raise view.error(f'intrinsic {intrinsic_id} is missing')
        local_path = view.get('local_path')
        parts = [root_path.text() if root_path else '', local_path.text() if local_path else '']
        name = '/'.join([part for part in parts if part] + [view['filename'].text()])
        lens = intrinsics[intrinsic_id]['ptr_wrapper']['data']
        entries.append(_openmvg_entry(view, name, lens, pose))
    return entries


def _openmvg_entry(view, name, lens, pose):
    camera_pose = posed(pose, pose['rotation'].numbers(9), pose['center'].numbers(3))
    base = lens.get('value0') or lens
    size = base['width'].whole(), base['height'].whole()
    return Entry(view, name, size, lambda size: _openmvg_camera(lens, camera_pose, size))


def _openmvg_camera(lens, pose, size):
    if lens.get('value0') is not None:  # panoramas only
        K = spherical_matrix(size)
        K[:2, 2] += 0.5
        return camera_of(lens, K, pose, size, lens=Lens('spherical'))
    focal, (cx, cy) = lens['focal_length'].number(), lens['principal_point'].numbers(2)
    K = pinhole_matrix(focal, focal, cx, cy)
    if lens.get('fisheye') is not None:
        fisheye = Lens('equidistant', (), lens['fisheye'].numbers(4))
        return camera_of(lens, K, pose, size, lens=fisheye)
    k1 = k2 = k3 = t1 = t2 = 0.0
    if lens.get('disto_k1') is not None:
        (k1,) = lens['disto_k1'].numbers(1)
    elif lens.get('disto_k3') is not None:
        k1, k2, k3 = lens['disto_k3'].numbers(3)
    elif lens.get('disto_t2') is not None:
        k1, k2, k3, t1, t2 = lens['disto_t2'].numbers(5)
    return camera_of(lens, K, pose, size, [k1, k2, t1, t2, k3])


# -- OpenMVS ----------------------------------------------------------------------------------


def read_openmvs(path):
    """Return the entries of an MVSI interface archive; pixel centres have integer coordinates."""
    cursor = Cursor(path)
    version = 0
    if cursor.data[:4] == b'MVSI':
        cursor.skip(4)
        place, (version, _) = cursor.place, cursor.take('II')
        if version > 7:
            raise place.error(f'interface version must be 0 to 7, got {version}')
    elif cursor.data[:3] == b'MVS':
        raise cursor.place.error('not an interface archive: export with --archive-type 0')
    platforms = [_openmvs_platform(cursor, version) for _ in range(cursor.count(24))]
    entries = [_openmvs_image(cursor, version, platforms) for _ in range(cursor.count(20))]
    return [entry for entry in entries if entry is not None]


def _openmvs_sized(cursor) -> str:
    return cursor.text(cursor.count(1))


def _openmvs_platform(cursor, version):
    _openmvs_sized(cursor)
    cameras = []
    for _ in range(cursor.count(176)):
        _openmvs_sized(cursor)
        if version > 3:
            _openmvs_sized(cursor)
        size = cursor.take('II') if version > 0 else (0, 0)
        K, R, C = (np.array(cursor.take(f'{n}d')) for n in (9, 9, 3))
        cameras.append((size if all(size) else None, K.reshape(3, 3), R.reshape(3, 3), C))
    poses = [np.array(cursor.take('12d')) for _ in range(cursor.count(96))]
    return cameras, [(pose[:9].reshape(3, 3), pose[9:]) for pose in poses]


def _openmvs_image(cursor, version, platforms):
    place, name = cursor.place, _openmvs_sized(cursor)
    if version > 4:
        _openmvs_sized(cursor)
    platform, camera, pose = cursor.take('III')
    cursor.skip((4 if version > 2 else 0) + (12 if version > 6 else 0))
    if version > 6:
        cursor.skip(24 * cursor.count(24))
    if _NO_INDEX in (platform, camera, pose):
        return None
    try:
        cameras, poses = platforms[platform]
        (size, K, R, C), (platform_rotation, position) = cameras[camera], poses[pose]
    except IndexError:
        raise place.error(
            f'platform {platform}, camera {camera} or pose {pose} of {name!r} is missing'
        ) from None
    # The camera's pose is relative to the platform's.
    camera_pose = posed(place, R @ platform_rotation, platform_rotation.T @ C + position)

    def make(picture_size):
        return camera_of(place, _pixel_matrix(K, size, picture_size), camera_pose, picture_size)

    return Entry(place, name, size, make)


def _pixel_matrix(K, size, picture_size):
    """Return K in pixels; without a size it is in units of the longer side."""
    if size is not None:
        return K
    scaled = K * max(picture_size)
    if not (K[:2, 2] < 3).all():  # relative to integer pixel centres at unit size
        scaled[:2, 2] = (K[:2, 2] + 0.5) * max(picture_size) - 0.5
    scaled[2, 2] = K[2, 2]
    return scaled


# -- Bundler and VisualSFM --------------------------------------------------------------------

#: Picture lists beside a bundle file; STEM is its name without suffix.
BUNDLE_LISTS = ('STEM.list.txt', 'list.txt', 'list_images.txt', 'image_list.txt', 'images.txt')


def read_bundler(path):
    """Return the entries of a bundle file and its list; image coordinates are from the centre."""
    lines = data_lines(path)
    header = next(lines, None)
    if header is None:
        return []
    camera_count = header.numbers(header.text.split(), 2, int)[0]
    names = _bundle_names(path, header, camera_count)
    entries = []
    for name in names:
        first_line: Line | None = None
        numbers: list[float] = []
        while len(numbers) < 15:
            line = next(lines, None)
            if line is None:
                raise (first_line or header).error(f'truncated: {camera_count} cameras declared')
            first_line = first_line or line
            numbers += line.numbers(line.text.split())
        focal, k1, k2 = numbers[:3]
        if focal:  # else not registered
            flip = np.diag([1.0, -1.0, -1.0])
            pose = flip @ np.reshape(numbers[3:12], (3, 3)), flip @ numbers[12:15]
            entries.append(_middle_entry(first_line, name, focal, pose, [k1, k2, 0.0, 0.0]))
    return entries


def _bundle_names(path, header, count):
    """Return the names of pictures from a list file."""
    stem = path.name.split('.')[0]
    list_names = [name.replace('STEM', stem) for name in BUNDLE_LISTS]
    for list_file in (f / name for f in (path.parent, path.parent.parent) for name in list_names):
        if list_file.is_file():
            names = [line.text.split(' 0 ')[0].strip() for line in data_lines(list_file)]
            if len(names) == count:
                return names
    raise header.error(
        f'a list of the {count} pictures, one per line, must be beside the file, in one of '
        f'{", ".join(list_names)}'
    )


def _middle_entry(place, name, focal, pose, distortion=(), lens=None):
    """Return an entry of unknown size whose principal point is the centre of the picture."""

    def make(size):
        K = pinhole_matrix(focal, focal, (size[0] - 1) / 2, (size[1] - 1) / 2)
        return camera_of(place, K, pose, size, distortion, lens)

    return Entry(place, name, None, make)


def read_nvm(path):
    """Return the entries of the first model of an NVM file."""
    lines = data_lines(path)
    header = next(lines, None)
    if header is None:
        return []
    header_tokens = header.text.split()[1:]
    shared = header.numbers(header_tokens[1:]) if header_tokens[:1] == ['FixedK'] else None
    if shared is not None and len(shared) not in (4, 5):
        raise header.error(f'FixedK must be fx, cx, fy, cy and optional distortion, got {shared}')
    line = next(lines, header)
    (count,) = line.numbers(line.text.split(), 1, int)
    as_matrix = 'R9T' in header.text.split()[0]
    entries: list[Entry] = []
    for _ in range(count):
        line = next(lines, None)
        if line is None:
            raise header.error(f'the file is truncated: {count} cameras declared')
        entries.append(_nvm_entry(line, shared, as_matrix))
    return entries


def _nvm_entry(line, shared, as_matrix):
    count = 9 if as_matrix else 4
    name, *tokens = line.text.rsplit(maxsplit=6 + count)
    focal, *pose_numbers = line.numbers(tokens, 6 + count)
    translation = np.array(pose_numbers[count : count + 3])
    distortion = pose_numbers[count + 3]
    with line.named():
        R = np.reshape(pose_numbers[:9], (3, 3)) if as_matrix else to_matrices(pose_numbers[:4])
    camera_pose = (R, translation) if as_matrix else posed(line, R, translation)
    if shared is not None:
        distortion = shared[4] if len(shared) == 5 and shared[4] else distortion
    lens = Lens('inverse', (distortion,)) if distortion else None
    name = name.replace('"', ' ')
    if shared is None:
        return _middle_entry(line, name, focal, camera_pose, lens=lens)
    fx, cx, fy, cy = shared[:4]
    K = pinhole_matrix(fx, fy, cx - 0.5, cy - 0.5)
    return Entry(line, name, None, lambda size: camera_of(line, K, camera_pose, size, lens=lens))
