"""Projects of every format with their documented projections, for single points in float64.

Each writer below returns the files of a project and a function that projects a point of the world
by the program's own formula, into pixels whose centres are whole numbers.
"""

import json
import math
import struct

import numpy as np

from tests.makers import turn_of

SIZE = (640, 480)
HALF = 0.5  # between a corner of the first pixel and its centre


def poses(seed, count=4):
    """Rotations and positions of cameras that look at the origin from about 5 units away."""
    rng = np.random.default_rng(seed)
    for _ in range(count):
        ahead = rng.normal(size=3)
        ahead /= np.linalg.norm(ahead)
        R = turn_of(ahead, rng.normal(size=3))
        yield R, -5 * ahead + rng.normal(scale=0.2, size=3)


def points(seed):
    return np.random.default_rng(seed).uniform(-1, 1, (200, 3))


def quaternion(R):
    """By the largest eigenvector (Bar-Itzhack 2000), not by the code under test."""
    m = R
    K = np.array(
        [
            [m[0, 0] - m[1, 1] - m[2, 2], 0, 0, 0],
            [m[0, 1] + m[1, 0], m[1, 1] - m[0, 0] - m[2, 2], 0, 0],
            [m[0, 2] + m[2, 0], m[1, 2] + m[2, 1], m[2, 2] - m[0, 0] - m[1, 1], 0],
            [m[2, 1] - m[1, 2], m[0, 2] - m[2, 0], m[1, 0] - m[0, 1], np.trace(m)],
        ]
    )
    x, y, z, w = np.linalg.eigh(K)[1][:, -1]
    return w, x, y, z


def brown(x, y, k=(), p=(0.0, 0.0), down=()):
    """OpenCV's formula: x to the right, y down."""
    s = x * x + y * y
    above = 1 + sum(c * s ** (i + 1) for i, c in enumerate(k))
    below = 1 + sum(c * s ** (i + 1) for i, c in enumerate(down))
    return (
        x * above / below + 2 * p[0] * x * y + p[1] * (s + 2 * x * x),
        y * above / below + p[0] * (s + 2 * y * y) + 2 * p[1] * x * y,
    )


def fisheye(x, y, z, k=()):
    r = math.hypot(x, y)
    a = math.atan2(r, z)
    d = a * (1 + sum(c * a ** (2 * i + 2) for i, c in enumerate(k)))
    return x / r * d, y / r * d


def text(numbers):
    return ' '.join(repr(float(x)) for x in np.ravel(numbers))


# -- the formats ------------------------------------------------------------------------------

COLMAP_K = {
    'SIMPLE_PINHOLE': ([600, 310, 250], lambda x, y, z, k: (x / z, y / z)),
    'PINHOLE': ([600, 610, 310, 250], lambda x, y, z, k: (x / z, y / z)),
    'SIMPLE_RADIAL': ([600, 310, 250, -0.1], lambda x, y, z, k: brown(x / z, y / z, k)),
    'RADIAL': ([600, 310, 250, -0.1, 0.03], lambda x, y, z, k: brown(x / z, y / z, k)),
    'OPENCV': (
        [600, 610, 310, 250, -0.1, 0.02, 1e-3, -2e-3],
        lambda x, y, z, k: brown(x / z, y / z, k[:2], k[2:]),
    ),
    'FULL_OPENCV': (
        [600, 610, 310, 250, -0.1, 0.02, 1e-3, -2e-3, 0.01, 0.05, -0.02, 0.01],
        lambda x, y, z, k: brown(x / z, y / z, (*k[:2], k[4]), k[2:4], k[5:]),
    ),
    'OPENCV_FISHEYE': (
        [400, 410, 310, 250, 0.02, -0.01, 2e-3, -1e-3],
        lambda x, y, z, k: fisheye(x, y, z, k),
    ),
    'RADIAL_FISHEYE': ([400, 310, 250, 0.02, -0.01], lambda x, y, z, k: fisheye(x, y, z, k)),
    'SIMPLE_RADIAL_FISHEYE': ([400, 310, 250, 0.02], lambda x, y, z, k: fisheye(x, y, z, k)),
    'FISHEYE': ([400, 410, 310, 250], lambda x, y, z, k: fisheye(x, y, z)),
    'FOV': (
        [500, 510, 310, 250, 0.9],
        lambda x, y, z, k: [
            c
            * math.atan(2 * math.hypot(x, y) / z * math.tan(k[0] / 2))
            / (k[0] * math.hypot(x, y))
            for c in (x, y)
        ],
    ),
    'SIMPLE_DIVISION': (
        [600, 310, 250, -0.15],
        lambda x, y, z, k: [
            2 * c / (z + math.sqrt(z * z - 4 * k[0] * (x * x + y * y))) for c in (x, y)
        ],
    ),
    'EUCM': (
        [400, 410, 310, 250, 0.6, 1.1],
        lambda x, y, z, k: [
            c / (k[0] * math.sqrt(k[1] * (x * x + y * y) + z * z) + (1 - k[0]) * z) for c in (x, y)
        ],
    ),
}


def colmap(folder, seed, model='OPENCV', offset=HALF):
    """IMAGE_ID QW QX QY QZ TX TY TZ CAMERA_ID NAME; the first corner is at (0, 0)."""
    params, plane = COLMAP_K[model]
    focal = 1 if len(params) in (3,) or model.startswith(('SIMPLE', 'RADIAL')) else 2
    sparse = folder / 'sparse' / '0'
    sparse.mkdir(parents=True)
    (sparse / 'cameras.txt').write_text(f'# cameras\n7 {model} 640 480 {text(params)}\n')
    lines, made = ['# images'], {}
    for k, (R, C) in enumerate(poses(seed)):
        name = f'a {k}.jpg'
        lines += [f'{k + 3} {text(quaternion(R))} {text(-R @ C)} 7 {name}', '' if k else '1 2 -1']

        def project(point, R=R, C=C):
            x, y = plane(*(R @ (point - C)), params[focal + 2 :])
            cx, cy = params[focal : focal + 2]
            return params[0] * x + cx - offset, params[focal - 1] * y + cy - offset

        made[name] = project
    (sparse / 'images.txt').write_text('\n'.join(lines) + '\n')
    return folder, made


def opensfm(folder, seed):
    """Lengths of the picture in units of its longer side, from its middle."""
    shots, made = {}, {}
    for k, (R, C) in enumerate(poses(seed)):
        angle = math.acos((np.trace(R) - 1) / 2)
        axis = np.array([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]])
        turn = axis / np.linalg.norm(axis) * angle
        camera = ('persp', 'brown', 'fish', 'pano')[k]
        shot = {'rotation': turn.tolist(), 'translation': (-R @ C).tolist(), 'camera': camera}
        shots[f'{k}.jpg'] = shot

        def project(point, R=R, C=C, camera=camera):
            x, y, z = R @ (point - C)
            if camera == 'pano':
                u = math.atan2(x, z) / (2 * math.pi)
                v = math.atan2(y, math.hypot(x, z)) / (2 * math.pi)
            elif camera == 'persp':
                u, v = (0.9 * c for c in brown(x / z, y / z, (-0.1, 0.02)))
            elif camera == 'brown':
                u, v = brown(x / z, y / z, (-0.1, 0.02, 0.01), (1e-3, -2e-3))
                u, v = 0.9 * u + 0.01, 0.92 * v - 0.02
            else:
                u, v = (0.6 * c for c in fisheye(x, y, z, (0.02, -0.01)))
            # denormalized_image_coordinates of OpenSfM: centres of pixels are whole
            return u * 640 - 0.5 + 320, v * 640 - 0.5 + (160 if camera == 'pano' else 240)

        made[f'{k}.jpg'] = project
    cameras = {
        'persp': {'projection_type': 'perspective', 'focal': 0.9, 'k1': -0.1, 'k2': 0.02},
        'brown': {
            'projection_type': 'brown',
            'focal_x': 0.9,
            'focal_y': 0.92,
            'c_x': 0.01,
            'c_y': -0.02,
            'k1': -0.1,
            'k2': 0.02,
            'k3': 0.01,
            'p1': 1e-3,
            'p2': -2e-3,
        },
        'fish': {'projection_type': 'fisheye', 'focal': 0.6, 'k1': 0.02, 'k2': -0.01},
        'pano': {'projection_type': 'spherical'},
    }
    for name, camera in cameras.items():
        camera |= {'width': 640, 'height': 320 if name == 'pano' else 480}
    path = folder / 'reconstruction.json'
    path.write_text(json.dumps([{'cameras': cameras, 'shots': shots, 'points': {}}], indent=1))
    return path, made


def openmvg(folder, seed):
    """Centres of pixels are whole; x_camera = R (x - C)."""
    pp = [310.0, 250.0]
    kinds = [
        ('pinhole', {}, lambda x, y: (x, y)),
        ('k3', {'disto_k3': [-0.1, 0.02, 0.01]}, lambda x, y: brown(x, y, (-0.1, 0.02, 0.01))),
        (
            't2',
            {'disto_t2': [-0.1, 0.02, 0.01, 1e-3, -2e-3]},
            lambda x, y: brown(x, y, (-0.1, 0.02, 0.01), (1e-3, -2e-3)),
        ),
        (
            'fish',
            {'fisheye': [0.02, -0.01, 0.0, 0.0]},
            lambda x, y: fisheye(x, y, 1, (0.02, -0.01)),
        ),
    ]
    views, intrinsics, extrinsics, made = [], [], [], {}
    for k, (R, C) in enumerate(poses(seed)):
        data = {'local_path': 'day', 'filename': f'{k}.jpg', 'width': 640, 'height': 480}
        data |= {'id_view': k, 'id_intrinsic': k, 'id_pose': k}
        views.append({'key': k, 'value': {'ptr_wrapper': {'id': 1, 'data': data}}})
        lens = {'width': 640, 'height': 480, 'focal_length': 600.0, 'principal_point': pp}
        lens |= kinds[k][1]
        intrinsics.append({'key': k, 'value': {'ptr_wrapper': {'id': 1, 'data': lens}}})
        extrinsics.append({'key': k, 'value': {'rotation': R.tolist(), 'center': C.tolist()}})

        def project(point, R=R, C=C, plane=kinds[k][2]):
            x, y, z = R @ (point - C)
            x, y = plane(x / z, y / z)
            return 600 * x + pp[0], 600 * y + pp[1]

        made[f'/elsewhere/day/{k}.jpg'] = project
    views.append({'key': 9, 'value': {'ptr_wrapper': {'data': {**data, 'id_pose': 99}}}})
    top = {'sfm_data_version': '0.3', 'root_path': '/elsewhere', 'views': views}
    top |= {'intrinsics': intrinsics, 'extrinsics': extrinsics}
    path = folder / 'sfm_data.json'
    path.write_text(json.dumps(top, indent=2))
    return path, made


def openmvs(folder, seed, version=7):
    """An interface archive; a rig of one platform: R_cam R_pose, R_pose^T C_cam + C_pose."""

    def sized(name):
        return struct.pack('<Q', len(name)) + name.encode()

    K = np.array([[600.0, 0, 310], [0, 610, 250], [0, 0, 1]])
    (R0, C0), *_ = poses(seed + 1)
    R0 = R0 if version else np.eye(3)
    C0 = 0.1 * C0
    data = b'' if not version else b'MVSI' + struct.pack('<II', version, 0)
    data += struct.pack('<Q', 1) + sized('rig') + struct.pack('<Q', 1) + sized('cam')
    data += sized('RGB') if version > 3 else b''
    data += struct.pack('<II', *SIZE) if version > 0 else b''
    full = K if version else K / 640 + [[0, 0, 0], [0, 0, 0], [0, 0, 1 - 1 / 640]]
    data += full.tobytes() + R0.tobytes() + C0.tobytes()
    placed = list(poses(seed))
    data += struct.pack('<Q', len(placed))
    made, images = {}, struct.pack('<Q', len(placed) + 1)
    for k, (R, C) in enumerate(placed):
        outer = R0.T @ R  # so that the camera is at R, C
        centre = C - outer.T @ C0
        data += outer.tobytes() + centre.tobytes()
        images += sized(f'{k}.jpg') + (sized('') if version > 4 else b'')
        images += struct.pack('<III', 0, 0, k) + (struct.pack('<I', k) if version > 2 else b'')
        if version > 6:
            images += struct.pack('<fff', 1, 2, 3) + struct.pack('<QIIffff', 1, 0, 9, 1, 1, 1, 1)

        def project(point, R=R, C=C):
            x, y, w = K @ R @ (point - C)
            return x / w, y / w

        made[f'{k}.jpg'] = project
    images += sized('lost.jpg') + (sized('') if version > 4 else b'')
    images += struct.pack('<III', 0, 0, 0xFFFFFFFF) + (
        struct.pack('<I', 9) if version > 2 else b''
    )
    images += struct.pack('<fffQ', 0, 0, 0, 0) if version > 6 else b''
    path = folder / 'scene.mvs'
    path.write_bytes(data + images + struct.pack('<QQQ', 0, 0, 0))
    return path, made


def bundler(folder, seed):
    """Snavely: p = -P / P.z, p' = f r(p) p, from the middle of the picture, y up."""
    rows, names, made = ['# Bundle file v0.3', '5 0'], [], {}
    for k, (R, C) in enumerate(poses(seed)):
        up = np.diag([1.0, -1, -1]) @ R
        t = -up @ C
        rows += [text([600, -0.1, 0.02]), *(text(row) for row in up), text(t)]
        names.append(f'./day/{k}.jpg')

        def project(point, up=up, t=t):
            P = up @ point + t
            x, y = -P[0] / P[2], -P[1] / P[2]
            s = x * x + y * y
            r = 1 - 0.1 * s + 0.02 * s * s
            return 600 * r * x + (640 - 1) / 2, (480 - 1) / 2 - 600 * r * y

        made[names[-1]] = project
    rows += ['0 0 0'] * 5
    (folder / 'bundle').mkdir()
    (folder / 'bundle' / 'bundle.out').write_text('\n'.join(rows))
    (folder / 'list.txt').write_text('\n'.join([f'{n} 0 600.5' for n in names] + ['x.jpg']))
    return folder / 'bundle' / 'bundle.out', made


def nvm(folder, seed, fixed='', *, matrix=False):
    """Wu: (1 + k |m|^2) m = f X / Z with m from the middle, k in units of the focal length."""
    rows, made = [f'NVM_V3{"_R9T" * matrix} {fixed}'.strip(), '', '4'], {}
    for k, (R, C) in enumerate(poses(seed)):
        pose = f'{text(R)} {text(-R @ C)}' if matrix else f'{text(quaternion(R))} {text(C)}'
        rows.append(f'day"{k}.jpg\t600 {pose} -0.08 0')

        def project(point, R=R, C=C):
            x, y, z = R @ (point - C)
            wanted = math.hypot(x, y) / z
            low, high = 0.0, 1.5  # by bisection
            for _ in range(80):
                m = (low + high) / 2
                low, high = (m, high) if (1 - 0.08 * m * m) * m < wanted else (low, m)
            middle = (310 - HALF, 250 - HALF) if fixed else (639 / 2, 479 / 2)
            return tuple(
                600 * m * c / (wanted * z) + at for c, at in zip((x, y), middle, strict=True)
            )

        made[f'day {k}.jpg'] = project
    path = folder / 'scene.nvm'
    path.write_text('\n'.join(rows) + '\n\n0\n')
    return path, made


def metashape(folder, seed):
    """Manual, appendix on camera models; the second camera is the first's slave."""
    sensors = {
        '0': ('frame', 'b1 2.5,b2 0.5,k1 -0.1,k2 0.02,k3 0.01,p1 0.001,p2 -0.002'),
        '1': ('frame', 'k1 -0.1,k2 0.02,k3 0.01,k4 0.01,p1 0.001,p2 -0.002,p3 0.1,p4 0.2'),
        '2': ('fisheye', 'k1 0.02,k2 -0.01,p1 0.001,p2 -0.002'),
        '3': ('equisolid_fisheye', 'k1 0.02'),
    }
    rows = ['<?xml version="1.0" encoding="UTF-8"?>', '<document version="2.0.0">', '<chunk>']
    placed = list(poses(seed))
    scale, (turn, move) = 2.5, next(poses(seed + 7))
    chunk = np.eye(4)
    chunk[:3, :3], chunk[:3, 3] = scale * turn, move

    def local(R, C):
        matrix = np.eye(4)
        matrix[:3, :3], matrix[:3, 3] = turn.T @ R.T, turn.T @ (C - move) / scale
        return matrix

    for key, (kind, numbers) in sensors.items():
        values = ''.join('<{0}>{1}</{0}>'.format(*pair.split()) for pair in numbers.split(','))
        slave = ''
        if key == '1':
            relative = np.linalg.inv(local(*placed[0])) @ local(*placed[1])
            slave = f'<rotation>{text(relative[:3, :3])}</rotation>'
            slave += f'<location>{text(relative[:3, 3])}</location>'
        rows.append(
            f'<sensor id="{key}" type="{kind}"><resolution width="640" height="480"/>{slave}'
            f'<calibration type="{kind}" class="initial"><f>1</f></calibration>'
            f'<calibration type="{kind}" class="adjusted"><resolution width="640" height="480"/>'
            f'<f>{400 if "fish" in kind else 600}</f><cx>-10</cx><cy>10</cy>{values}'
            '</calibration></sensor>'
        )
    made = {}
    for k, (R, C) in enumerate(placed):
        master = ' master_id="0"' if k == 1 else ''
        matrix = '' if k == 1 else f'<transform>{text(local(R, C))}</transform>'
        rows.append(f'<camera id="{k}" sensor_id="{k}" label="IMG_{k}"{master}>{matrix}</camera>')
        kind, numbers = sensors[str(k)]
        value = {n: float(v) for n, v in (pair.split() for pair in numbers.split(','))}

        def project(point, R=R, C=C, kind=kind, v=value):
            x, y, z = R @ (point - C)
            r = math.hypot(x, y)
            if kind == 'fisheye':
                x, y = (c / r * math.atan2(r, z) for c in (x, y))
            elif kind == 'equisolid_fisheye':
                x, y = (c / r * 2 * math.sin(math.atan2(r, z) / 2) for c in (x, y))
            else:
                x, y = x / z, y / z
            s = x * x + y * y
            radial = 1 + sum(v.get(f'k{i}', 0) * s**i for i in range(1, 5))
            more = 1 + v.get('p3', 0) * s + v.get('p4', 0) * s * s
            p1, p2 = v.get('p1', 0), v.get('p2', 0)
            u = x * radial + (p1 * (s + 2 * x * x) + 2 * p2 * x * y) * more
            w = y * radial + (p2 * (s + 2 * y * y) + 2 * p1 * x * y) * more
            f = 400 if 'fish' in kind else 600
            u = 640 / 2 - 10 + u * f + u * v.get('b1', 0) + w * v.get('b2', 0)
            return u - HALF, 480 / 2 + 10 + w * f - HALF

        made[f'IMG_{k}'] = project
    rows += ['<camera id="9" sensor_id="0" label="lost"/>', '<transform>']
    rows.append(f'<rotation>{text(turn)}</rotation><translation>{text(move)}</translation>')
    rows += [f'<scale>{scale}</scale></transform>', '</chunk>', '</document>']
    path = folder / 'cameras.xml'
    path.write_text('\n'.join(rows))
    return path, made


def photoscan(folder, seed, version='1.2.0'):
    """Of the manual of Agisoft Lens 0.4: pixels from the corner; up to 0.9 without sensors."""
    numbers = 'fx 620,fy 600,cx 310,cy 250,skew 0.5,k1 -0.1,k2 0.02,k3 0.01,p1 0.001,p2 -0.002'
    values = ''.join('<{0}>{1}</{0}>'.format(*pair.split()) for pair in numbers.split(','))
    size = '<resolution width="640" height="480"/>'
    old = version == '0.9.0'
    sensor = f'<sensor id="0" type="frame">{size}<calibration class="adjusted">{size}{values}'
    rows = ['<?xml version="1.0" encoding="UTF-8"?>']
    rows += ['<collection><cameras>'] if old else [f'<document version="{version}"><chunk>']
    rows += [] if old else [f'{sensor}</calibration></sensor>']
    made = {}
    for k, (R, C) in enumerate(poses(seed)):
        matrix = f'<transform>{text(np.r_[np.c_[R.T, C], [[0, 0, 0, 1]]])}</transform>'
        own = f'{size}<calibration><width>640</width><height>480</height>{values}</calibration>'
        names = f'label="{k}.jpg"' if old else f'id="{k}" sensor_id="0" label="{k}.jpg"'
        rows.append(f'<camera {names}>{own if old else ""}{matrix}</camera>')

        def project(point, R=R, C=C):
            x, y, z = R @ (point - C)
            x, y = brown(x / z, y / z, (-0.1, 0.02, 0.01), (1e-3, -2e-3))
            return 310 + x * 620 + y * 0.5 - HALF, 250 + y * 600 - HALF

        made[f'{k}.jpg'] = project
    rows.append('</cameras></collection>' if old else '</chunk></document>')
    path = folder / 'cameras.xml'
    path.write_text('\n'.join(rows))
    return path, made


def opf(folder, seed):
    """Of the specification: right, top, back; R_x(omega) R_y(phi) R_z(kappa); corner at (0, 0)."""
    lens = [
        {
            'type': 'perspective',
            'principal_point_px': [310, 250],
            'focal_length_px': 600,
            'radial_distortion': [-0.1, 0.02, 0.01],
            'tangential_distortion': [1e-3, -2e-3],
        },
        {
            'type': 'fisheye',
            'principal_point_px': [310, 250],
            'is_p0_zero': True,
            'affine': [620, 3, 2, 610],
            'polynomial': [0.0, 1.0, 0.015, -0.1],
        },
    ]
    cameras, made = [], {}
    for k, (R, C) in enumerate(poses(seed)):
        world = R.T @ np.diag([1.0, -1, -1])
        phi = math.asin(world[0, 2])
        omega = math.atan2(-world[1, 2], world[2, 2])
        kappa = math.atan2(-world[0, 1], world[0, 0])
        degrees = [math.degrees(a) for a in (omega, phi, kappa)]
        camera = {'id': k, 'sensor_id': k % 2, 'orientation_deg': degrees, 'position': C.tolist()}
        cameras.append(camera)

        def project(point, R=R, C=C, wide=k % 2):
            x, y, z = R @ (point - C)
            if not wide:
                u, v = brown(x / z, y / z, (-0.1, 0.02, 0.01), (1e-3, -2e-3))
                return 600 * u + 310 - HALF, 600 * v + 250 - HALF
            r = math.hypot(x, y)
            a = 2 / math.pi * math.atan2(r, z)
            rho = a + 0.015 * a**2 - 0.1 * a**3
            u, v = rho * x / r, rho * y / r
            return 620 * u + 3 * v + 310 - HALF, 2 * u + 610 * v + 250 - HALF

        made[f'images/{k} a.jpg'] = project
    sensors = [{'id': k, 'internals': lens[k]} for k in range(2)]
    files = {
        'calibrated-cameras': {'sensors': sensors, 'cameras': cameras},
        'input-cameras': {
            'sensors': [{'id': k, 'image_size_px': list(SIZE)} for k in range(2)],
            'captures': [],
        },
        'camera-list': {'cameras': [{'id': k, 'uri': f'images/{k}%20a.jpg'} for k in range(4)]},
        'scene-reference-frame': {'crs': {'definition': 'EPSG:32632'}},
    }
    resources = []
    for name, content in files.items():
        form = f'application/opf-{name}+json'
        content = {'format': form, 'version': '1.0', **content}
        (folder / f'{name}.json').write_text(json.dumps(content))
        resources.append({'uri': f'{name}.json', 'format': form})
    path = folder / 'project.opf'
    project = {'format': 'application/opf-project+json', 'items': [{'resources': resources}]}
    path.write_text(json.dumps(project))
    return path, made


def upright(R, C):
    """Return the matrix from a camera, y up and z back, to the world."""
    return np.vstack([np.c_[R.T @ np.diag([1.0, -1, -1]), C], [0, 0, 0, 1]]).tolist()


def transforms(folder, seed, model='OPENCV'):
    """Nerfstudio's data conventions: camera to world, y up, z back; first corner at (0, 0)."""
    frames, made = [], {}
    for k, (R, C) in enumerate(poses(seed)):
        frames.append({'file_path': f'images/{k}.png', 'transform_matrix': upright(R, C)})

        def project(point, R=R, C=C):
            x, y, z = R @ (point - C)
            if model == 'OPENCV':
                x, y = brown(x / z, y / z, (-0.1, 0.02), (1e-3, -2e-3))
            else:
                x, y = fisheye(x, y, z, (-0.1, 0.02))
            return 600 * x + 310 - HALF, 610 * y + 250 - HALF

        made[f'images/{k}.png'] = project
    top = {'camera_model': model, 'w': 640, 'h': 480, 'fl_x': 600, 'fl_y': 610, 'cx': 310}
    top |= {'cy': 250, 'k1': -0.1, 'k2': 0.02, 'p1': 1e-3, 'p2': -2e-3, 'frames': frames}
    path = folder / 'transforms.json'
    path.write_text(json.dumps(top, indent=1))
    return path, made


def blender(folder, seed):
    """NeRF's synthetic sets: an angle, no size, no endings."""
    frames, made = [], {}
    for k, (R, C) in enumerate(poses(seed)):
        frames.append({'file_path': f'./train/r_{k}', 'transform_matrix': upright(R, C)})

        def project(point, R=R, C=C):
            x, y, z = R @ (point - C)
            f = 320 / math.tan(0.35)
            return f * x / z + 320 - HALF, f * y / z + 240 - HALF

        made[f'./train/r_{k}'] = project
    path = folder / 'transforms_train.json'
    path.write_text(json.dumps({'camera_angle_x': 0.7, 'frames': frames}))
    return path, made


FORMATS = {
    **{f'colmap-{m}': lambda f, s, m=m: colmap(f, s, m) for m in COLMAP_K},
    'opensfm': opensfm,
    'openmvg': openmvg,
    'bundler': bundler,
    'nvm': nvm,
    'nvm-fixed': lambda f, s: nvm(f, s, 'FixedK 600 310 600 250 -0.08'),
    'nvm-matrix': lambda f, s: nvm(f, s, matrix=True),
    **{f'openmvs-{v}': lambda f, s, v=v: openmvs(f, s, v) for v in range(8)},
    'metashape': metashape,
    **{f'photoscan-{v}': lambda f, s, v=v: photoscan(f, s, v) for v in ('0.9.0', '1.2.0')},
    'opf': opf,
    'transforms': transforms,
    'blender': blender,
    'transforms-fisheye': lambda f, s: transforms(f, s, 'OPENCV_FISHEYE'),
}


def write_pictures(folder, names, sizes=()):
    """Pictures of names, the ends of which are kept; all of one size but some."""
    from PIL import Image

    for name in names:
        place = folder / 'images' / name.replace('\\', '/').split('/')[-1]
        place.parent.mkdir(exist_ok=True)
        place = place if place.suffix else place.with_suffix('.PNG')
        Image.new('1', dict(sizes).get(name, SIZE)).save(place)


def pixels(camera, where):
    """Projections in pixels whose centres are whole numbers."""
    uv, _ = camera.project(where)
    return np.c_[uv[:, 0] * camera.size[0] - 0.5, (1 - uv[:, 1]) * camera.size[1] - 0.5]
