"""Flights of a plotter's camera."""

from __future__ import annotations

import numpy as np

from pvibr.maths.quaternions import from_matrices, slerp, to_matrices
from pvibr.photos.photos import Photo


def fly(plotter, camera, frames):
    """Move the camera of the active subplot to another over a number of frames."""
    target = camera
    if not hasattr(camera, 'focal_point'):
        target = (camera if isinstance(camera, Photo) else Photo('', camera)).to_pyvista()
    bounds = np.reshape(plotter.renderer.ComputeVisiblePropBounds(), (3, 2))
    moving = plotter.camera
    start_state, end_state = _state(moving), _state(target)
    scene_offset = bounds.mean(axis=1) - end_state['position']
    distance = scene_offset @ -end_state['axes'][2]
    if np.ptp(bounds, axis=1).min() >= 0 and distance > 0:
        end_state['distance'] = distance  # so that the user then turns about the scene
    rotations = from_matrices(np.stack([start_state.pop('axes'), end_state.pop('axes')]))
    moving.parallel_projection = target.parallel_projection
    for t in (np.arange(frames) + 1) / frames:
        eased = t * t * (3 - 2 * t)
        current_state = {
            k: (1 - eased) * start_state[k] + eased * end_state[k] for k in start_state
        }
        _set(moving, current_state, to_matrices(slerp(rotations[0], rotations[1], eased)))
        plotter.renderer.ResetCameraClippingRange()
        plotter.render()


def _state(camera):
    """Return the animated state of a camera."""
    position, focal_point = np.array(camera.position), np.array(camera.focal_point)
    distance = np.linalg.norm(position - focal_point)
    backward = (position - focal_point) / distance
    right = np.cross(camera.up, backward)
    right /= np.linalg.norm(right)
    return {
        'position': position,
        'axes': np.array([right, np.cross(backward, right), backward]),
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
