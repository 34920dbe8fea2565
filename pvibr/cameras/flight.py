"""Moving a plotter's camera to that of a photograph."""

from __future__ import annotations

import numpy as np

from pvibr.cameras.photos import Photo
from pvibr.maths.quaternions import from_matrices, slerp, to_matrices


def fly(plotter, camera, frames):
    """Move the camera of the active subplot to another in some frames."""
    target = camera
    if not hasattr(camera, 'focal_point'):
        target = (camera if isinstance(camera, Photo) else Photo('', camera)).to_pyvista()
    now, bounds = plotter.camera, np.reshape(plotter.renderer.ComputeVisiblePropBounds(), (3, 2))
    here, there = _state(now), _state(target)
    middle = bounds.mean(axis=1) - there['position']
    distance = middle @ -there['axes'][2]
    if np.ptp(bounds, axis=1).min() >= 0 and distance > 0:
        there['distance'] = distance  # turns about the scene from there on
    turns = from_matrices(np.stack([here.pop('axes'), there.pop('axes')]))
    now.parallel_projection = target.parallel_projection
    for t in (np.arange(frames) + 1) / frames:
        share = t * t * (3 - 2 * t)
        state = {k: (1 - share) * here[k] + share * there[k] for k in here}
        _set(now, state, to_matrices(slerp(turns[0], turns[1], share)))
        plotter.renderer.ResetCameraClippingRange()
        plotter.render()


def _state(camera):
    """Return what moves of a camera."""
    position, focus = np.array(camera.position), np.array(camera.focal_point)
    distance = np.linalg.norm(position - focus)
    back = (position - focus) / distance
    right = np.cross(camera.up, back)
    right /= np.linalg.norm(right)
    return {
        'position': position,
        'axes': np.array([right, np.cross(back, right), back]),
        'distance': distance,
        'angle': camera.view_angle,
        'scale': camera.parallel_scale,
        'shift': np.array(camera.GetWindowCenter()),
    }


def _set(camera, state, axes):
    camera.position = state['position']
    camera.focal_point = state['position'] - state['distance'] * axes[2]
    camera.up = axes[1]
    camera.view_angle, camera.parallel_scale = state['angle'], state['scale']
    camera.SetWindowCenter(*state['shift'])
