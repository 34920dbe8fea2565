"""One frame: its renderer, view, size, time and quality."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from pvibr.core import _vtk
from pvibr.core.passes import margins
from pvibr.maths.sequences import pair
from pvibr.maths.views import View


@dataclass(frozen=True, eq=False)
class Sample:
    """One of the samples whose mean is a still picture: effects vary with it what they sample."""

    index: int
    #: How many there will be.
    count: int = 64
    #: The user's camera, which the renderer has again after the frame.
    camera: Any = None

    @property
    def gap(self) -> float:
        """Return how far apart the samples of what spans 1 are; 0 if too near to be told apart."""
        return self.count**-0.5 if self.count < 64 else 0.0

    def pair(self, name) -> tuple[float, float]:
        """Return two numbers, 0 to 1: over all samples those of a name fill a square evenly."""
        return pair(self.index, name)


@dataclass(frozen=True, eq=False)
class Frame:
    """One frame of one subplot; read-only, the only thing that is passed to effects."""

    renderer: _vtk.vtkRenderer
    window: _vtk.vtkRenderWindow
    size: tuple[int, int]
    origin: tuple[int, int]
    view: View
    index: int = 0
    time: float = 0.0
    picking: bool = False
    #: Whether nothing blends, as for shadow maps.
    casting: bool = False
    #: Whether it is a depth map of a light or a projector, of which pixels may be oblong.
    depth_map: bool = False
    #: Whether `view` is that of the renderer's camera; else see `elsewhere`.
    own: bool = True
    #: Things that were drawn in other views since they were prepared for this frame.
    astray: set = field(default_factory=set)
    tile: tuple[float, float, float, float] = (0.0, 0.0, 1.0, 1.0)
    scale: int = 1
    quality: float = 1.0
    #: Which sample of a still picture it is; None if it is a picture of its own.
    sample: Sample | None = None

    @classmethod
    def of(cls, renderer, *, index=0, time=0.0, quality=1.0) -> Frame:
        """Return the frame that a renderer is about to draw."""
        camera, window = renderer.GetActiveCamera(), renderer.GetRenderWindow()
        if bool(camera.GetStereo()) != bool(window.GetStereoRender()):
            camera.Render(renderer)  # cameras learn by it whether they are one of two eyes
        projection = camera.GetProjectionTransformMatrix(renderer.GetTiledAspectRatio(), -1, 1)
        near, far = camera.GetClippingRange()
        view = View(
            _matrix(camera.GetModelViewTransformMatrix()),
            _matrix(projection),
            near,
            far,
            bool(camera.GetParallelProjection()),
            _frozen(camera.GetPosition()),
        )
        scale = tuple(window.GetTileScale())
        origin, size, tile = _whole(renderer) if scale == (1, 1) else _tile(renderer, window)
        return cls(
            renderer=renderer,
            window=window,
            size=size,
            origin=origin,
            view=view,
            index=index,
            time=time,
            picking=renderer.GetSelector() is not None,
            tile=tile,
            scale=scale[1],
            quality=quality,
        )

    def elsewhere(self, view, size, *, casting=False) -> Frame:
        """Return the frame of another view of the same scene."""
        how = {
            'casting': casting,
            'depth_map': casting,
            'own': False,
            'quality': 1.0,
        }
        return replace(self, view=view, size=size, origin=(0, 0), **how)

    def within_passes(self) -> tuple[Frame, Frame]:
        """Return the frame as VTK's passes have the scene drawn, and as they show that."""
        camera = self.renderer.GetActiveCamera()
        if 0 in self.size or camera.GetUseExplicitProjectionTransformMatrix():
            return self, self
        wide, high = margins(self.renderer, self.size)
        if wide == high == 1:
            return self, self
        # They widen the angle along one axis, and keep the aspect ratio of what they show.
        angle = wide if camera.GetUseHorizontalViewAngle() and not self.parallel else high
        size = round(self.size[0] * wide), round(self.size[1] * high)
        drawn = replace(self, size=size, view=_zoomed(self.view, 1 / angle, 1 / angle))
        return drawn, replace(self, view=_zoomed(self.view, wide / angle, high / angle))

    @property
    def view_from_world(self) -> np.ndarray:
        """See :class:`pvibr.maths.views.View`."""
        return self.view.view_from_world

    @property
    def clip_from_view(self) -> np.ndarray:
        """See :class:`pvibr.maths.views.View`."""
        return self.view.clip_from_view

    @property
    def parallel(self) -> bool:
        """Whether the projection is parallel."""
        return self.view.parallel

    @property
    def near(self) -> float:
        """Distance of the near plane, world units."""
        return self.view.near

    @property
    def far(self) -> float:
        """Distance of the far plane, world units."""
        return self.view.far

    @property
    def eye(self) -> np.ndarray:
        """Position of the camera, (3,), world units."""
        return self.view.eye

    def vary(self, name) -> tuple[float, float]:
        """Return two numbers, 0 to 1, by which effects vary what they sample; mostly 0."""
        return (0.0, 0.0) if self.sample is None else self.sample.pair(name)

    @property
    def whole(self) -> tuple[float, float]:
        """Width and height of the subplot in pixels; `size` is that of the tile."""
        left, bottom, right, top = self.tile
        return self.size[0] / (right - left or 1), self.size[1] / (top - bottom or 1)

    @property
    def pixel_scales(self) -> tuple[float, float]:
        """Pixels per unit of tan(angle) in perspective, per world unit in parallel projection."""
        width, height = np.diag(self.clip_from_view)[:2] * self.size / 2
        return float(width), float(height)

    @property
    def pixel_scale(self) -> float:
        """The scale along y, or the greater where pixels may be oblong."""
        return max(self.pixel_scales) if self.depth_map else self.pixel_scales[1]

    @property
    def scene_size(self) -> float:
        """Diagonal of what is in the scene, world units."""
        low, high = np.reshape(self.renderer.ComputeVisiblePropBounds(), (3, 2)).T
        return max(float(np.linalg.norm(high - low)), 1e-12)

    def pixel_at(self, point) -> float:
        """Return the size of a pixel at a point, in world units."""
        away = -float(self.view_from_world[2, :3] @ point + self.view_from_world[2, 3])
        return (1.0 if self.parallel else max(away, self.near)) / self.pixel_scale


def _zoomed(view, x, y) -> View:
    """Return a view with another angle along each axis."""
    clip = view.clip_from_view.copy()
    clip[0, 0] *= x
    clip[1, 1] *= y
    return replace(view, clip_from_view=_frozen(clip, (4, 4)))


def _whole(renderer):
    """Return origin and size of a subplot, in pixels of the framebuffer, and the shares drawn."""
    return tuple(renderer.GetOrigin()), tuple(renderer.GetSize()), (0.0, 0.0, 1.0, 1.0)


def _tile(renderer, window):
    """Return the same where a tile of a large screenshot is drawn."""
    tile, view, whole = window.GetTileViewport(), renderer.GetViewport(), window.GetSize()
    corners, shares = [], []
    for i in range(4):
        side = view[2 + i % 2] - view[i % 2] or 1
        edge = max(view[i], tile[i]) if i < 2 else min(view[i], tile[i])
        shares.append((edge - view[i % 2]) / side)
        within = min(max(view[i], tile[i % 2]), tile[2 + i % 2]) - tile[i % 2]
        corners.append(round(within * whole[i % 2]))
    x0, y0, x1, y1 = corners
    return (x0, y0), (x1 - x0, y1 - y0), tuple(shares)


def _matrix(vtk_matrix) -> np.ndarray:
    return _frozen(vtk_matrix.GetData(), (4, 4))


def _frozen(values, shape=(3,)) -> np.ndarray:
    array = np.array(values, np.float64).reshape(shape)
    array.flags.writeable = False
    return array
