"""Flights of a plotter's camera."""

from __future__ import annotations

import weakref

import numpy as np

from pvibr.core.plotters import subplot_size
from pvibr.maths.cameras import aspect_of, check_plain, vertical_angle
from pvibr.maths.quaternions import from_matrices, slerp, to_matrices
from pvibr.photos.photos import Photo
from pvibr.things.clipping_range import reset_clipping_range

_ROUNDING = 1e-12  # of an aspect ratio


def fly(plotter, camera, frames):
    """Move the camera of the active subplot to another over a number of frames."""
    target, size = camera, subplot_size(plotter)
    if not hasattr(camera, 'focal_point'):
        target = (camera if isinstance(camera, Photo) else Photo('', camera)).to_pyvista(size)
    bounds = np.reshape(plotter.renderer.ComputeVisiblePropBounds(), (3, 2))
    moving = plotter.camera
    start_state, end_state = _state(moving, size), _state(target, size)
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
        _set(moving, current_state, to_matrices(slerp(rotations[0], rotations[1], eased)), size)
        reset_clipping_range(plotter.renderer)
        plotter.render()
    if moving.GetUseExplicitAspectRatio() or moving.GetWindowCenter()[0]:
        _LensKeeper(plotter.renderer, moving, size)


def _state(camera, size):
    """Return the animated state of a camera."""
    check_plain(camera)
    position, focal_point = np.array(camera.position), np.array(camera.focal_point)
    distance = np.linalg.norm(position - focal_point)
    backward = (position - focal_point) / distance
    right = np.cross(camera.up, backward)
    right /= np.linalg.norm(right)
    aspect = aspect_of(camera, size)
    return {
        'position': position,
        'axes': np.array([right, np.cross(backward, right), backward]),
        'distance': distance,
        'angle': vertical_angle(camera, aspect),
        'scale': camera.parallel_scale,
        'shift': np.array(camera.GetWindowCenter()),
        'stretch': aspect / (size[0] / size[1]),
    }


def _set(camera, state, axes, size):
    camera.position = state['position']
    camera.focal_point = state['position'] - state['distance'] * axes[2]
    camera.up = axes[1]
    camera.view_angle, camera.parallel_scale = state['angle'], state['scale']
    camera.SetUseHorizontalViewAngle(False)
    camera.SetWindowCenter(*state['shift'])
    camera.SetUseExplicitAspectRatio(bool(abs(state['stretch'] - 1) > _ROUNDING))
    camera.SetExplicitAspectRatio(state['stretch'] * size[0] / size[1])


class _LensKeeper:
    """Keeps the shape of the pixels and the principal point of a camera in resized windows.

    VTK stores both relative to the window; a camera that was given others is left alone.
    """

    def __init__(self, renderer, camera, size):
        self._renderer, self._camera = weakref.ref(renderer), weakref.ref(camera)
        self._aspect, self._lens = size[0] / size[1], _lens(camera)
        self._tag = renderer.GetRenderWindow().AddObserver('WindowResizeEvent', self._on_resize)

    def _on_resize(self, window, _event):
        renderer, camera = self._renderer(), self._camera()
        if renderer is None or not all(renderer.GetSize()):
            return
        width, height = renderer.GetSize()
        center_x, center_y, ratio = self._lens
        change = width / height / self._aspect
        resized = center_x / change, center_y, ratio * change
        if renderer.GetActiveCamera() is not camera or _lens(camera) not in (self._lens, resized):
            window.RemoveObserver(self._tag)
            return
        camera.SetWindowCenter(*resized[:2])
        camera.SetExplicitAspectRatio(resized[2])
        self._aspect, self._lens = width / height, _lens(camera)


def _lens(camera):
    """Return the centre of a camera's window, and its aspect ratio if it is explicit."""
    return *camera.GetWindowCenter(), camera.GetExplicitAspectRatio()
