"""Files of OpenSfM, OpenMVG, OpenMVS, Bundler and VisualSFM."""

from __future__ import annotations

import numpy as np

from pvibr.cameras.files import Cursor, Line, data_lines, json_of
from pvibr.cameras.photos import Entry, camera_of, pinhole_matrix, posed
from pvibr.core.errors import warn
from pvibr.maths.lenses import Lens
from pvibr.maths.quaternions import from_axis_angle, to_matrices

_NONE = 0xFFFFFFFF  # of OpenMVS and OpenMVG: no number


def spherical_matrix(size):
    """Return K of a panorama all around whose longer side is a full circle."""
    focal, (cx, cy) = max(size) / (2 * np.pi), np.array(size) / 2 - 0.5
    return pinhole_matrix(focal, focal, cx, cy)


# -- OpenSfM ----------------------------------------------------------------------------------


def read_opensfm(path):
    """Return the entries of a reconstruction.json; units of its lengths are the longer side.

    Its origin is the middle of the picture: (w - 1) / 2 where centres of pixels are whole.
    """
    parts = list(json_of(path))
    if not parts:
        return []
    if len(parts) > 1:
        warn(f'{path} has {len(parts)} reconstructions, each in its own world: the first is read.')
    cameras = dict(parts[0]['cameras'].items())
    shots = [
        shot
        for key in ('shots', 'pano_shots')
        if parts[0].get(key) is not None
        for shot in parts[0][key].items()
    ]
    return [_opensfm_entry(name, shot, cameras) for name, shot in shots]


def _opensfm_entry(name, shot, cameras):
    key = shot['camera'].text()
    if key not in cameras:
        raise shot.error(f'there is no camera {key!r}')
    camera = cameras[key]
    turn = np.array(shot['rotation'].numbers(3))
    angle = np.linalg.norm(turn)
    if not angle < 1e6:
        raise shot.error(
            f'its rotation is {turn.tolist()}; an axis times an angle in radians is needed'
        )
    q = from_axis_angle(turn / angle, angle) if angle else [1.0, 0, 0, 0]
    pose = to_matrices(q), shot['translation'].numbers(3)
    size = camera['width'].whole(), camera['height'].whole()
    return Entry(shot, name, size, lambda size: _opensfm_camera(camera, pose, size))


def _opensfm_camera(node, pose, size):
    kind = 'perspective' if node.get('projection_type') is None else node['projection_type'].text()
    if kind in ('spherical', 'equirectangular'):
        return camera_of(node, spherical_matrix(size), pose, size, lens=Lens('spherical'))
    k, longest = node.value_of, max(size)
    if node.get('focal_x') is not None:
        fx, fy = node['focal_x'].number(), node['focal_y'].number()
    else:
        fx = fy = node['focal'].number()
    cx, cy = ((s - 1) / 2 + k(c) * longest for s, c in zip(size, ('c_x', 'c_y'), strict=True))
    K = pinhole_matrix(fx * longest, fy * longest, cx, cy)
    brown = [k('k1'), k('k2'), k('p1'), k('p2'), k('k3')]
    if kind in ('perspective', 'brown', 'radial', 'simple_radial'):
        return camera_of(node, K, pose, size, brown)
    radial = [k(f'k{i}') for i in range(1, 7)]
    if kind == 'dual':
        lens = Lens('dual', (k('transition', 0.5),), radial[:2])
    elif kind in ('fisheye', 'fisheye_opencv', 'fisheye62', 'fisheye624'):
        prism = [k(f's{i}') for i in range(4)]
        lens = Lens('equidistant', (), radial, (k('p1'), k('p2')), prism)
    else:
        raise node.error(f'projection_type {kind!r} is unknown')
    return camera_of(node, K, pose, size, lens=lens)


# -- OpenMVG ----------------------------------------------------------------------------------


def read_openmvg(path):
    """Return the entries of a sfm_data.json; centres of pixels are whole numbers."""
    top = json_of(path)
    poses = {node['key'].whole(): node['value'] for node in top['extrinsics']}
    intrinsics = {node['key'].whole(): node['value'] for node in top['intrinsics']}
    root = top.get('root_path')
    entries = []
    for node in top['views']:
        view = node['value']['ptr_wrapper']['data']
        pose = poses.get(view['id_pose'].whole())
        number = view['id_intrinsic'].whole()
        if pose is None or number == _NONE:
            continue  # it was not registered
        if number not in intrinsics:
            raise view.error(f'there is no intrinsic {number}')
        local = view.get('local_path')
        parts = [root.text() if root else '', local.text() if local else '']
        name = '/'.join([part for part in parts if part] + [view['filename'].text()])
        entries.append(_openmvg_entry(view, name, intrinsics[number]['ptr_wrapper']['data'], pose))
    return entries


def _openmvg_entry(view, name, lens, pose):
    placed = posed(pose, pose['rotation'].numbers(9), pose['center'].numbers(3))
    base = lens.get('value0') or lens
    size = base['width'].whole(), base['height'].whole()
    return Entry(view, name, size, lambda size: _openmvg_camera(lens, placed, size))


def _openmvg_camera(lens, pose, size):
    if lens.get('value0') is not None:  # only panoramas are written so
        K = spherical_matrix(size)
        K[:2, 2] += 0.5
        return camera_of(lens, K, pose, size, lens=Lens('spherical'))
    focal, (cx, cy) = lens['focal_length'].number(), lens['principal_point'].numbers(2)
    K = pinhole_matrix(focal, focal, cx, cy)
    if lens.get('fisheye') is not None:
        return camera_of(
            lens, K, pose, size, lens=Lens('equidistant', (), lens['fisheye'].numbers(4))
        )
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
    """Return the entries of an interface archive (MVSI, versions 0 to 7); whole pixel centres."""
    cursor = Cursor(path)
    version = 0
    if cursor.data[:4] == b'MVSI':
        cursor.skip(4)
        place, (version, _) = cursor.place, cursor.take('II')
        if version > 7:
            raise place.error(f'version {version} of the interface is unknown; known are 0 to 7')
    elif cursor.data[:3] == b'MVS':
        raise cursor.place.error(
            "it is OpenMVS's own archive: export an interface archive (--archive-type 0)"
        )
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
    if _NONE in (platform, camera, pose):
        return None
    try:
        cameras, poses = platforms[platform]
        (size, K, R, C), (outer, position) = cameras[camera], poses[pose]
    except IndexError:
        raise place.error(
            f'{name!r} has platform {platform}, camera {camera}, pose {pose}: one is not there'
        ) from None
    # The camera's position is relative to the platform's.
    placed = posed(place, R @ outer, outer.T @ C + position)
    return Entry(
        place, name, size, lambda found: camera_of(place, _full(K, size, found), placed, found)
    )


def _full(K, size, found):
    """Return K in pixels: it is in units of the longer side where it has no size."""
    if size is not None:
        return K
    scaled = K * max(found)
    if not (K[:2, 2] < 3).all():  # it was in pixels of the unit size, centres whole
        scaled[:2, 2] = (K[:2, 2] + 0.5) * max(found) - 0.5
    scaled[2, 2] = K[2, 2]
    return scaled


# -- Bundler and VisualSFM --------------------------------------------------------------------

#: Lists of pictures beside a bundle file; STEM is its name without the suffix.
BUNDLE_LISTS = ('STEM.list.txt', 'list.txt', 'list_images.txt', 'image_list.txt', 'images.txt')


def read_bundler(path):
    """Return the entries of a bundle file and the list beside it; the origin is in the middle."""
    rows = data_lines(path)
    head = next(rows, None)
    if head is None:
        return []
    count = head.numbers(head.text.split(), 2, int)[0]
    names = _bundle_names(path, head, count)
    entries = []
    for name in names:
        place: Line | None = None
        numbers: list[float] = []
        while len(numbers) < 15:
            line = next(rows, None)
            if line is None:
                raise (place or head).error(f'the file is cut: {count} cameras are announced')
            place = place or line
            numbers += line.numbers(line.text.split())
        focal, k1, k2 = numbers[:3]
        if focal:  # else it was not registered
            flip = np.diag([1.0, -1.0, -1.0])
            pose = flip @ np.reshape(numbers[3:12], (3, 3)), flip @ numbers[12:15]
            entries.append(_middle_entry(place, name, focal, pose, [k1, k2, 0.0, 0.0]))
    return entries


def _bundle_names(path, head, count):
    """Return the pictures' names."""
    stem = path.name.split('.')[0]
    places = [
        folder / name for folder in (path.parent, path.parent.parent) for name in BUNDLE_LISTS
    ]
    for place in (p.with_name(p.name.replace('STEM', stem)) for p in places):
        if place.is_file():
            names = [line.text.split(' 0 ')[0].strip() for line in data_lines(place)]
            if len(names) == count:
                return names
    raise head.error(
        f'{count} cameras are announced; the pictures should be listed, one a line, beside it in '
        f'{", ".join(BUNDLE_LISTS).replace("STEM", stem)}'
    )


def _middle_entry(place, name, focal, pose, distortion=(), lens=None):
    """Return an entry whose principal point is the middle of a picture of unknown size."""

    def make(size):
        K = pinhole_matrix(focal, focal, (size[0] - 1) / 2, (size[1] - 1) / 2)
        return camera_of(place, K, pose, size, distortion, lens)

    return Entry(place, name, None, make)


def read_nvm(path):
    """Return the entries of the first model of an NVM file."""
    rows = data_lines(path)
    head = next(rows, None)
    if head is None:
        return []
    fixed = head.text.split()[1:]
    shared = head.numbers(fixed[1:]) if fixed[:1] == ['FixedK'] else None
    if shared is not None and len(shared) not in (4, 5):
        raise head.error('FixedK should have fx, cx, fy, cy, and perhaps the distortion')
    line = next(rows, head)
    (count,) = line.numbers(line.text.split(), 1, int)
    as_matrix = 'R9T' in head.text.split()[0]
    entries: list[Entry] = []
    for _ in range(count):
        line = next(rows, None)
        if line is None:
            raise head.error(
                f'the file is cut: {count} cameras are announced, {len(entries)} are there'
            )
        entries.append(_nvm_entry(line, shared, as_matrix))
    return entries


def _nvm_entry(line, shared, as_matrix):
    turn = 9 if as_matrix else 4
    name, *tokens = line.text.rsplit(maxsplit=6 + turn)
    focal, *rest = line.numbers(tokens, 6 + turn)
    place, k = np.array(rest[turn : turn + 3]), rest[turn + 3]
    try:
        R = np.reshape(rest[:9], (3, 3)) if as_matrix else to_matrices(rest[:4])
    except ValueError as error:
        raise line.error(error) from None
    pose = (R, place) if as_matrix else posed(line, R, place)
    if shared is not None:
        k = shared[4] if len(shared) == 5 and shared[4] else k
    lens = Lens('inverse', (k,)) if k else None
    name = name.replace('"', ' ')
    if shared is None:
        return _middle_entry(line, name, focal, pose, lens=lens)
    fx, cx, fy, cy = shared[:4]
    K = pinhole_matrix(fx, fy, cx - 0.5, cy - 0.5)
    return Entry(line, name, None, lambda size: camera_of(line, K, pose, size, lens=lens))
