"""Writing cameras for photogrammetry and radiance fields: COLMAP and transforms.json."""

from __future__ import annotations

import json
import os
import struct
from pathlib import Path

import numpy as np

from pvibr.core.arguments import check_one_of
from pvibr.core.files import replacing
from pvibr.core.plotters import subplot_size
from pvibr.maths.cameras import as_camera
from pvibr.maths.lens_camera import LensCamera
from pvibr.maths.orthographic import Orthographic
from pvibr.maths.quaternions import from_matrices
from pvibr.photos.colmap import EQUIRECTANGULAR, MODELS
from pvibr.photos.photos import Photo

_FORMATS = ('colmap', 'colmap_binary', 'transforms')
_MAX_SKEW = 0.01  # pixels of error at the border that a format without skew may cause


def write_cameras(path, cameras, *, size=None, format=None):
    """Write cameras for COLMAP, or as transforms.json.

    Parameters
    ----------
    path : str or pathlib.Path
        A folder, for COLMAP's ``cameras``, ``images`` and empty ``points3D``, or a ``.json`` file.
    cameras : plotter, Photo, camera, or sequence of these
        A plotter stands for the camera of its active subplot; a camera is a ``pyvista.Camera``,
        :class:`Pinhole` or :class:`LensCamera`. Cameras other than photographs are named
        ``'0000.png'`` and so on.
    size : tuple of 2 int, optional
        Width and height in pixels for ``pyvista.Camera``; by default those of the plotter's
        subplot.
    format : str, optional
        ``'colmap'``, ``'colmap_binary'`` or ``'transforms'``; by default according to `path`.

    Raises
    ------
    ValueError
        If there is no camera, a size is unknown, or the format does not support the projection.

    Examples
    --------
    >>> import pathlib, tempfile
    >>> import pyvista as pv
    >>> import pvibr
    >>> pl = pv.Plotter(off_screen=True, window_size=(200, 100))
    >>> _ = pl.add_mesh(pv.Sphere())
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     file = pathlib.Path(folder) / 'transforms.json'
    ...     pvibr.write_cameras(file, pl)
    ...     '"fl_x"' in file.read_text()
    True
    >>> pl.close()
    """
    path = Path(path).expanduser()
    if format is None:
        format = 'transforms' if path.suffix.lower() == '.json' else 'colmap'
    check_one_of('format', format, _FORMATS)
    photos = _photos(cameras, size)
    if format == 'transforms':
        _write_transforms(path, photos)
    else:
        _write_colmap(path, photos, binary=format == 'colmap_binary')


def _photos(cameras, size) -> list[Photo]:
    if not isinstance(cameras, list | tuple) or hasattr(cameras, '_asdict'):
        cameras = [cameras]
    photos = []
    for k, camera in enumerate(cameras):
        if isinstance(camera, Photo):
            photos.append(camera)
            continue
        view_size = size
        if hasattr(camera, 'renderer'):
            view_size = view_size or subplot_size(camera)
            camera = camera.camera
        view_size = view_size or getattr(camera, 'size', None)
        if view_size is None:
            raise ValueError(f'size must be given for camera {k}, got None for {camera!r:.60}')
        if not isinstance(camera, LensCamera):
            camera = as_camera(camera, view_size)
        photos.append(Photo(f'{k:04}.png', camera))
    if not photos:
        raise ValueError('cameras must have at least one camera, got none')
    return photos


def _described(photo):
    """Return COLMAP's model and parameters; the centre of the first pixel is at (0.5, 0.5)."""
    camera = photo.camera
    if isinstance(camera, Orthographic):
        raise ValueError(f'{photo.name}: no format supports an orthographic camera')
    model, parameters = _model(photo)
    if model == EQUIRECTANGULAR[0]:
        return model, [float(s) for s in camera.size]
    K = camera.K
    if max(abs(K[0, 1]), abs(K[1, 0])) * max(camera.size) > _MAX_SKEW * min(K[0, 0], K[1, 1]):
        raise ValueError(f'{photo.name}: K must have no skew, got {K.tolist()}')
    return model, [K[0, 0], K[1, 1], K[0, 2] + 0.5, K[1, 2] + 0.5, *parameters]


def _model(photo):
    """Return COLMAP's model with two focal lengths, and its parameters after the centre."""
    camera = photo.camera
    if not isinstance(camera, LensCamera):
        k1, k2, p1, p2, *more = (float(x) for x in camera.distortion)
        if any(more):
            return 'FULL_OPENCV', [k1, k2, p1, p2, *more]
        return ('OPENCV', [k1, k2, p1, p2]) if any((k1, k2, p1, p2)) else ('PINHOLE', [])
    lens = camera.lens
    is_plain = not any((*lens.radial, *lens.tangential, *lens.prism))
    model_names = {
        'division': 'DIVISION',
        'fov': 'FOV',
        'unified': 'EUCM',
        'spherical': EQUIRECTANGULAR[0],
    }
    if is_plain and lens.kind in model_names:
        return model_names[lens.kind], list(lens.values)
    radial = (*lens.radial, *[0.0] * 6)[:6]
    p1, p2, *p34 = (*lens.tangential, *[0.0] * 4)[:4]
    prism = (*lens.prism, *[0.0] * 4)[:4]
    if lens.kind == 'equidistant' and not any((*p34, *lens.radial[6:])):
        if not any((*radial[4:], p1, p2, *prism)):
            return 'OPENCV_FISHEYE', list(radial[:4])
        if lens.late:
            return 'RAD_TAN_THIN_PRISM_FISHEYE', [*radial, p2, p1, *prism]
        if not any((*radial[4:], prism[1], prism[3])):
            return 'THIN_PRISM_FISHEYE', [*radial[:2], p1, p2, *radial[2:4], prism[0], prism[2]]
    try:
        return 'FULL_OPENCV', [float(x) for x in camera.as_pinhole().distortion]
    except ValueError as error:
        raise ValueError(f'{photo.name}: {error}') from None


def _write_colmap(folder, photos, *, binary):
    described = [(*_described(p), p) for p in photos]
    intrinsics = list(dict.fromkeys((m, tuple(n), p.size) for m, n, p in described))
    camera_ids = {key: camera_id for camera_id, key in enumerate(intrinsics, start=1)}
    images = []
    for image_id, (model, params, photo) in enumerate(described, start=1):
        camera_from_world = photo.camera_from_world
        pose = [*from_matrices(camera_from_world[:3, :3]), *camera_from_world[:3, 3]]
        images.append((image_id, pose, camera_ids[model, tuple(params), photo.size], photo.name))
    files = _binary_files(intrinsics, images) if binary else _text_files(intrinsics, images)
    folder.mkdir(parents=True, exist_ok=True)
    for name, content in files.items():
        with replacing(folder / name) as part:
            part.write_bytes(content)


def _text_files(intrinsics, images):
    cameras = ['# CAMERA_ID, MODEL, WIDTH, HEIGHT, PARAMS[]']
    for item_id, (model, params, (width, height)) in enumerate(intrinsics, start=1):
        cameras.append(f'{item_id} {model} {width} {height} {_spaced(params)}')
    poses = ['# IMAGE_ID, QW, QX, QY, QZ, TX, TY, TZ, CAMERA_ID, NAME; then a line of points']
    for item_id, pose, camera, name in images:
        poses += [f'{item_id} {_spaced(pose)} {camera} {name}', '']
    texts = {
        'cameras.txt': cameras,
        'images.txt': poses,
        'points3D.txt': ['# no points'],
    }
    return {n: ('\n'.join(t) + '\n').encode('utf-8', 'surrogateescape') for n, t in texts.items()}


def _spaced(numbers):
    return ' '.join(repr(float(x)) for x in numbers)


def _binary_files(intrinsics, images):
    model_ids = {name: row[0] for name, row in MODELS.items()} | dict([EQUIRECTANGULAR])
    cameras = struct.pack('<Q', len(intrinsics))
    for k, (model, params, size) in enumerate(intrinsics, start=1):
        cameras += struct.pack(f'<IiQQ{len(params)}d', k, model_ids[model], *size, *params)
    images_bytes = struct.pack('<Q', len(images))
    for k, pose, camera, name in images:
        images_bytes += struct.pack('<I7dI', k, *pose, camera)
        images_bytes += name.encode('utf-8', 'surrogateescape') + b'\0' + struct.pack('<Q', 0)
    return {
        'cameras.bin': cameras,
        'images.bin': images_bytes,
        'points3D.bin': struct.pack('<Q', 0),
    }


_TRANSFORMS_MODELS = {
    'PINHOLE': ('PINHOLE', ()),
    'OPENCV': ('OPENCV', ('k1', 'k2', 'p1', 'p2')),
    'OPENCV_FISHEYE': ('OPENCV_FISHEYE', ('k1', 'k2', 'k3', 'k4')),
    EQUIRECTANGULAR[0]: (EQUIRECTANGULAR[0], ()),
}


def _write_transforms(path, photos):
    frames, models = [], set()
    for photo in photos:
        model, numbers = _described(photo)
        param_names: tuple
        if model == 'FULL_OPENCV' and not any(numbers[9:]):
            model, param_names = 'OPENCV', ('k1', 'k2', 'p1', 'p2', 'k3')
        elif model in _TRANSFORMS_MODELS:
            model, param_names = _TRANSFORMS_MODELS[model]
        else:
            raise ValueError(f'{photo.name}: transforms.json has no {model}; write a folder')
        models.add('OPENCV' if model == 'PINHOLE' else model)
        width, height = photo.size
        frame = {'file_path': _relative(photo, path.parent), 'w': width, 'h': height}
        if model != EQUIRECTANGULAR[0]:
            frame |= dict(zip(('fl_x', 'fl_y', 'cx', 'cy', *param_names), numbers, strict=False))
        world_from_camera = np.linalg.inv(photo.camera.view_from_world)
        frames.append({**frame, 'transform_matrix': world_from_camera.tolist()})
    if len(models) > 1:
        raise ValueError(f'transforms.json must have one model, got {", ".join(sorted(models))}')
    with replacing(path) as part:
        part.write_text(json.dumps({'camera_model': models.pop(), 'frames': frames}, indent=1))


def _relative(photo, folder):
    """Return the picture's path relative to a folder that contains it, else its name."""
    if photo.path is None:
        return photo.name
    relative_path = Path(os.path.relpath(photo.path, folder)).as_posix()
    return photo.name if relative_path.startswith('..') else relative_path
