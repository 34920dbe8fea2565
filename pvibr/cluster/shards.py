"""Shards of a scene on the workers: made there, and drawn by the camera of the user's process."""

from __future__ import annotations

from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import numpy as np

from pvibr.cluster import stages
from pvibr.cluster.shard_pictures import ShardPicture
from pvibr.core import _vtk
from pvibr.core.effect import Effect
from pvibr.maths.views import View
from pvibr.things.draw_order import Stage
from pvibr.things.thing import Thing

_LIGHT_VALUES = (
    *('Position', 'FocalPoint', 'AmbientColor', 'DiffuseColor', 'SpecularColor', 'Intensity'),
    *('Positional', 'ConeAngle', 'Exponent', 'AttenuationValues', 'LightType', 'Switch'),
)


def light_values(renderer) -> list[dict]:
    """Return what sets equal lights, by the names of VTK's methods."""
    lights = renderer.GetLights()
    return [{name: getattr(light, f'Get{name}')() for name in _LIGHT_VALUES} for light in lights]


@dataclass(frozen=True)
class ShardView:
    """What all workers draw in a frame."""

    view: View
    size: tuple[int, int]
    samples: int
    time: float
    lights: list[dict]

    def key(self) -> tuple:
        """Return a value that differs where the picture may."""
        lights = [tuple(light.values()) for light in self.lights]
        view = self.view
        return view.key(), view.near, view.far, self.size, self.samples, self.time, tuple(lights)

    def show(self, plotter):
        """Set size, camera, lights and time of a plotter."""
        if plotter.window_size != list(self.size):
            plotter.window_size = list(self.size)
        window = plotter.render_window
        window.SetMultiSamples(self.samples)
        renderer = plotter.renderer
        renderer.SetBackground(0.0, 0.0, 0.0)
        renderer.SetBackgroundAlpha(0.0)
        if light_values(renderer) != self.lights:
            renderer.RemoveAllLights()
            for values in self.lights:
                renderer.AddLight(_light(values))
        plotter.ibr.time = self.time
        self._aim(renderer.GetActiveCamera())

    def _aim(self, camera):
        view, projection = self.view, _vtk.vtkMatrix4x4()
        position, focus, up = view.camera()
        camera.SetPosition(position.tolist())
        camera.SetFocalPoint(focus.tolist())
        camera.SetViewUp(up.tolist())
        camera.SetParallelProjection(view.parallel)
        camera.SetClippingRange(view.near, view.far)
        projection.DeepCopy(view.clip_from_view.ravel().tolist())
        camera.SetExplicitProjectionTransformMatrix(projection)
        camera.UseExplicitProjectionTransformMatrixOn()


def _light(values):
    light = _vtk.vtkLight()
    for name, value in values.items():
        getattr(light, f'Set{name}')(value)
    return light


class _Reader(Effect):
    """Reads colour and depth of the next frame."""

    draws_background = True  # samples of pixels are averaged as they are composited later
    color: Any = None
    depth: Any = None
    normal: Any = None

    def __init__(self, has_normals=False):
        super().__init__()
        self._has_normals = has_normals

    @property
    def surfaces(self) -> bool:
        """Whether it reads normals."""
        return self._has_normals

    def render(self, frame, picture):
        """Read all."""
        texels = picture.color.download()
        if texels.dtype != np.uint8:
            texels = np.rint(255 * np.clip(np.nan_to_num(texels), 0, 1)).astype(np.uint8)
        self.color = texels
        buffers = self.pipeline.buffers
        self.depth = buffers.array('depth', frame, picture, self.pipeline.things)[::-1]
        if self._has_normals:
            self.normal = buffers.array('normal', frame, picture, self.pipeline.things)[::-1]


def drawn_view(plotter, view, has_normals=True) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return colour, distance along the view and normals in view space, lowest row first."""
    view.show(plotter)
    plotter.ibr.wait()
    with _reading(plotter, has_normals) as reader:
        plotter.render_window.Render()
    if reader.color is None:
        raise RuntimeError('the picture of a plotter could not be read')
    return reader.color, reader.depth, reader.normal


def drawn_picture(plotter, view) -> ShardPicture:
    """Return a plotter's picture of a view, as far as it is covered."""
    color, depth, _ = drawn_view(plotter, view, has_normals=False)
    return ShardPicture.of(color, depth, view.samples > 1 and not _draws_fringes(plotter))


def _draws_fringes(plotter) -> bool:
    """Return whether soft edges are mostly those of cards, which are blended as displayed."""
    orders = [thing.order for thing in plotter.ibr if isinstance(thing, Thing)]
    return any(
        key[0] == Stage.FRINGE and actor.GetVisibility()
        for order in orders
        for key, actor in order
    )


@contextmanager
def _reading(plotter, has_normals):
    reader = _Reader(has_normals)
    plotter.ibr.add(reader)
    try:
        yield reader
    finally:
        plotter.ibr.remove(reader)


# -- what workers do -------------------------------------------------------------------------


def bounds_of_shard(scene, data) -> tuple[tuple[float, ...], str]:
    """Make a shard, and return its bounds and what went wrong."""
    return stages.told(scene.name, _bounds, scene, data, failed=())


def _bounds(scene, data) -> tuple[float, ...]:
    plotter = stages.stage_of(scene, *_given(data)).plotter
    return tuple(map(float, plotter.renderer.ComputeVisiblePropBounds()))


def picture_of_shard(scene, data, view) -> tuple[bytes, str]:
    """Draw a shard, which is made where it is not there yet; also return what went wrong."""
    return stages.told(scene.name, _picture, scene, data, view, failed=b'')


def _picture(scene, data, view) -> bytes:
    return drawn_picture(stages.stage_of(scene, *_given(data)).plotter, view).packed()


def _given(data) -> tuple:
    return () if data is None else (data,)
