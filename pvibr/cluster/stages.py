"""What workers do: scenes that stay, in the one thread of a process that draws."""

from __future__ import annotations

import time
import traceback
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from dataclasses import dataclass, field
from typing import Any

import pyvista as pv

from pvibr.capture.movies import encoded
from pvibr.core.determinism import deterministic

#: Seconds after which a scene is closed that nobody asked for, as another one is made.
_FORGOTTEN_SECONDS = 300.0


@dataclass(frozen=True)
class Moment:
    """What a frame shows: a time, a camera or both."""

    time: float | None = None
    #: What ``plotter.camera_position`` takes.
    position: Any = None
    view_angle: float | None = None
    #: Half the height of what is seen, in a parallel projection.
    parallel_scale: float | None = None

    def show(self, plotter):
        """Set the time and the camera of a plotter."""
        if self.time is not None:
            plotter.ibr.time = self.time
        if self.position is None:
            return
        plotter.camera_position = self.position
        if self.view_angle is not None:
            plotter.camera.view_angle = self.view_angle
        if self.parallel_scale is not None:
            plotter.camera.parallel_projection = True
            plotter.camera.parallel_scale = self.parallel_scale
        plotter.renderer.ResetCameraClippingRange()


@dataclass(frozen=True)
class Scene:
    """How to make a plotter, and how its frames are drawn."""

    key: str
    make: Callable[..., pv.Plotter]
    args: tuple = ()
    kwargs: dict = field(default_factory=dict)
    #: PyVista's theme in the user's process.
    theme: dict = field(default_factory=dict)
    samples: int = 1
    is_deterministic: bool = False
    #: Name of `make` in messages.
    name: str = 'make_scene'


class _Stage:
    """The plotter of a scene."""

    def __init__(self, scene, args=()):
        self._scene = scene
        pv.OFF_SCREEN = True
        pv.global_theme.load_theme(pv.themes.Theme.from_dict(scene.theme))
        with deterministic(scene.is_deterministic):
            self.plotter = scene.make(*scene.args, *args, **scene.kwargs)
        if not isinstance(self.plotter, pv.Plotter):
            raise TypeError(
                f'{scene.name} must return a pyvista.Plotter, got {type(self.plotter).__name__}'
            )
        self._cameras = [_begun(renderer).copy() for renderer in self.plotter.renderers]
        self.used = time.monotonic()

    def draw(self, moment) -> bytes:
        """Return the picture of a moment, encoded: it depends on no other moment."""
        for renderer, camera in zip(self.plotter.renderers, self._cameras, strict=True):
            renderer.camera = camera.copy()
        with deterministic(self._scene.is_deterministic):
            moment.show(self.plotter)
            picture = self.plotter.ibr.screenshot(samples=self._scene.samples)
        self.used = time.monotonic()
        return encoded(picture)

    def close(self):
        """Close the plotter."""
        self.plotter.close()


def _begun(renderer) -> pv.Camera:
    """Return the camera of a renderer, placed as PyVista does before the first frame."""
    if not renderer.camera.is_set:
        renderer.camera_position = renderer.get_default_cam_pos()
        renderer.ResetCamera()
    return renderer.camera


# Contexts of OpenGL are of one thread, and Dask's workers have several.
_thread: ThreadPoolExecutor | None = None
_stages: dict[str, _Stage] = {}


def drawing(function, *args):
    """Return what a function returns in the thread that draws."""
    return _drawing_thread().submit(function, *args).result()


def _drawing_thread() -> ThreadPoolExecutor:
    global _thread
    if _thread is None:
        _thread = ThreadPoolExecutor(1, 'pvibr')
    return _thread


def told(doing, function, *args, failed) -> tuple[Any, str]:
    """Return what a function returns in the thread that draws, and what went wrong, as text."""
    # Errors go back as text: Dask would print them here as well, and not all can be sent.
    try:
        return drawing(function, *args), ''
    except Exception as error:
        return failed, failure_of(doing, error)


def failure_of(doing, error) -> str:
    """Return what failed, and the traceback."""
    last = traceback.format_exception_only(type(error), error)[-1].strip()
    trace = ''.join(traceback.format_exception(error))
    return f'{doing} failed: {last}\n\nOn the worker:\n{trace}'


def draw_frames(numbers, moments, scene) -> tuple[list[bytes], str]:
    """Return pictures of a scene, which is made where it is not there yet, and what went wrong."""
    return drawing(_draw_frames, numbers, moments, scene)


def _draw_frames(numbers, moments, scene) -> tuple[list[bytes], str]:
    pictures: list[bytes] = []
    doing = 'make_scene'
    try:
        stage = stage_of(scene)
        for number, moment in zip(numbers, moments, strict=True):
            doing = f'frame {number}'
            pictures.append(stage.draw(moment))
    except Exception as error:
        return pictures, failure_of(doing, error)
    return pictures, ''


def stage_of(scene, *args) -> _Stage:
    """Return the plotter of a scene, made with further arguments where it is not there yet."""
    now = time.monotonic()
    if scene.key not in _stages:
        for key in [k for k, s in _stages.items() if now - s.used > _FORGOTTEN_SECONDS]:
            _stages.pop(key).close()
        _stages[scene.key] = _Stage(scene, args)
    _stages[scene.key].used = now
    return _stages[scene.key]


def leave(key):
    """Close the plotter of a scene, once it has drawn what it draws."""
    _drawing_thread().submit(_leave, key)


def _leave(key):
    with suppress(KeyError):
        _stages.pop(key).close()
