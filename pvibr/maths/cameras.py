"""Conversion of PyVista's cameras, calibrations and orthophoto extents to cameras."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pvibr.core.arguments import checked_direction, checked_numbers, checked_positive
from pvibr.maths import _checks
from pvibr.maths.lens_camera import LensCamera
from pvibr.maths.orthographic import Orthographic
from pvibr.maths.pinhole import GUESSED, Pinhole, check_principal_point


def as_camera(camera, size):
    """Return the camera of a picture.

    Parameters
    ----------
    camera : pyvista.Camera, Pinhole, LensCamera, Orthographic, Photo, dict or tuple
        A dict has the keys of :class:`Pinhole` (``size`` is optional); a tuple is ``(K, R, t)`` or
        ``(K, R, t, distortion)``. Clipping planes of a ``pyvista.Camera`` are ignored.
    size : tuple of 2 int
        Width and height of the picture in pixels.

    Returns
    -------
    Pinhole or Orthographic
        With this size; of another lens, the pinhole with rational distortion that follows it.

    Raises
    ------
    ValueError
        If the camera is degenerate, unknown or for a picture of another size.

    Examples
    --------
    >>> import pyvista as pv
    >>> from pvibr.maths.cameras import as_camera
    >>> camera = pv.Camera()
    >>> camera.position, camera.focal_point, camera.up = (0, 0, 5), (0, 0, 0), (0, 1, 0)
    >>> uv, depth = as_camera(camera, (640, 480)).project([[0.0, 0.0, 0.0]])
    >>> uv.tolist(), depth.tolist()
    ([[0.5, 0.5]], [5.0])
    """
    size = _checks.size_of(size)
    if hasattr(camera, 'world_from_camera'):  # a photograph
        camera = camera.camera
    if isinstance(camera, LensCamera):
        camera = camera.as_pinhole()
    if isinstance(camera, Orthographic) and camera.size is None:
        return replace(camera, size=size)
    if isinstance(camera, Pinhole | Orthographic):
        return _of_size(camera, size)
    if hasattr(camera, 'focal_point'):
        return _from_view(camera, size)
    calibration = _named(camera)
    if 'size' in calibration:
        return _of_size(Pinhole(**calibration), size)
    pinhole = Pinhole(size=size, **calibration)
    check_principal_point(pinhole.K, size, GUESSED)
    return pinhole


def _from_view(camera, size):
    """Return the camera equal to a ``pyvista.Camera``, read by its attributes."""
    position = checked_numbers('camera.position', camera.position, (3,))
    focal_point = checked_numbers('camera.focal_point', camera.focal_point, (3,))
    ahead = checked_direction('camera.focal_point - camera.position', focal_point - position)
    up = checked_direction('camera.up', camera.up)
    right = np.cross(ahead, up)
    if np.linalg.norm(right) < _checks.ROTATION_TOLERANCE:
        raise ValueError(
            f'camera.up must not be along the view {ahead.tolist()}, got {up.tolist()}'
        )
    right /= np.linalg.norm(right)
    up = np.cross(right, ahead)
    check_plain(camera)
    aspect = aspect_of(camera, size)
    center = np.array(camera.GetWindowCenter() if hasattr(camera, 'GetWindowCenter') else (0, 0))
    if camera.parallel_projection:
        parallel_scale = checked_positive('camera.parallel_scale', camera.parallel_scale)
        half = parallel_scale * np.array([aspect, 1.0])
        corner = position + ((center - 1) * half) @ [right, up]
        return Orthographic(corner, right, up, 2 * half[0], 2 * half[1], near=0.0, size=size)
    view_angle = checked_positive('camera.view_angle', camera.view_angle)
    if view_angle >= 180:
        raise ValueError(f'camera.view_angle must be below 180 degrees, got {view_angle}')
    half_tangent = np.tan(np.radians(vertical_angle(camera, aspect)) / 2)
    half = half_tangent * np.array([aspect, 1.0])
    K = np.diag([*(0.5 * np.array(size) / half), 1.0])
    K[:2, 2] = 0.5 * np.array(size) * (1 + center * [-1, 1]) - 0.5
    R = np.array([right, -up, ahead])
    return Pinhole(K, R, -R @ position, size)


def aspect_of(camera, size) -> float:
    """Return the aspect ratio of the view that VTK's camera shows in a window of a size."""
    if hasattr(camera, 'GetUseExplicitAspectRatio') and camera.GetUseExplicitAspectRatio():
        return checked_positive('camera.GetExplicitAspectRatio()', camera.GetExplicitAspectRatio())
    return size[0] / size[1]


def vertical_angle(camera, aspect) -> float:
    """Return the view angle of VTK's camera from bottom to top, in degrees."""
    if not (hasattr(camera, 'GetUseHorizontalViewAngle') and camera.GetUseHorizontalViewAngle()):
        return camera.view_angle
    half_tangent = np.tan(np.radians(camera.view_angle) / 2) / aspect
    return float(np.degrees(2 * np.arctan(half_tangent)))


def check_plain(camera):
    """Raise ValueError if VTK's camera is more than a pinhole: its picture would differ."""
    identity = [float(i == j) for i in range(4) for j in range(4)]
    plain_settings = {
        'ModelTransformMatrix': identity,
        'UserTransform': None,
        'UserViewTransform': None,
        'UseExplicitProjectionTransformMatrix': 0,
        'UseOffAxisProjection': 0,
        'ViewShear': (0.0, 0.0, 1.0),
    }
    for name, expected in plain_settings.items():
        setting = getattr(camera, f'Get{name}', lambda expected=expected: expected)()
        if hasattr(setting, 'GetElement'):
            setting = [setting.GetElement(i, j) for i in range(4) for j in range(4)]
        if setting != expected:
            raise ValueError(f'camera.Get{name}() must be {expected}, got {setting}')


def _named(camera):
    """Return the arguments of a Pinhole from a dict or a tuple."""
    parameter_names = 'K', 'R', 't', 'distortion'
    if isinstance(camera, tuple | list) and len(camera) in (3, 4):
        return dict(zip(parameter_names, camera, strict=False))
    if isinstance(camera, dict):
        if {'K', 'R', 't'} <= set(camera) <= {*parameter_names, 'size'}:
            return camera
        raise ValueError(
            f'camera must have the keys K, R, t, and optionally distortion and size, got '
            f'{sorted(camera)}'
        )
    raise ValueError(
        'camera must be a pyvista.Camera, a Pinhole, an Orthographic, (K, R, t), '
        f'(K, R, t, distortion) or a dict of these, got {camera!r:.200}'
    )


def _of_size(camera, size):
    if camera.size == size:
        return camera
    remedy = '; use camera.resized(size) for a scaled picture'
    raise ValueError(
        f'camera.size must be {size}, that of the picture, got {camera.size}'
        f'{remedy if isinstance(camera, Pinhole) else ""}'
    )
