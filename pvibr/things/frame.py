"""One frame: its renderer, view, size, time and quality."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache
from typing import Any

import numpy as np

from pvibr.core import _vtk
from pvibr.core._vtk import method
from pvibr.core.passes import margins
from pvibr.maths.sequences import pair
from pvibr.maths.views import View

#: Ratio of their sides above which pixels count as oblong.
_OBLONG = 1.01
#: Ratio of quality from one step to the next: what is dropped entirely goes with the first.
STEP = 2**-0.25
#: Offset of lines from their surface toward the eye, as a fraction of the distance.
_BEFORE = 2e-3
#: A subplot that is no tile of a large screenshot.
_WHOLE = 0.0, 0.0, 1.0, 1.0


@dataclass(frozen=True, eq=False)
class Sample:
    """One of the samples averaged into a still picture; effects vary their sampling with it."""

    index: int
    #: Number of samples in total.
    count: int = 64
    #: The user's camera, restored after the frame.
    camera: Any = None

    @property
    def gap(self) -> float:
        """Spacing of the samples over a unit interval; 0 if too fine to be visible."""
        return self.count**-0.5 if self.count < 64 else 0.0

    def pair(self, name) -> tuple[float, float]:
        """Return two numbers, 0 to 1; over all samples those of a name fill the unit square."""
        return pair(self.index, name)


@dataclass(frozen=True, eq=False)
class Frame:
    """One frame of one subplot, read-only; all that effects are given."""

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
    #: Whether it is a depth map of a light or projector, whose pixels may be oblong.
    depth_map: bool = False
    #: Whether `view` is that of the renderer's camera; else see `elsewhere`.
    own: bool = True
    #: Things drawn in other views since they were prepared for this frame.
    astray: set = field(default_factory=set)
    #: Whether an effect reads the depth of the frame, once a thing has found out.
    reads_depth: list[bool] = field(default_factory=list)
    tile: tuple[float, float, float, float] = _WHOLE
    scale: int = 1
    quality: float = 1.0
    #: The sample of a still picture, or None for a picture by itself.
    sample: Sample | None = None
    #: What `once` has made, by what makes it.
    _made: dict = field(default_factory=dict, init=False, repr=False)

    @classmethod
    def of(cls, renderer, *, index=0, time=0.0, quality=1.0) -> Frame:
        """Return the frame that a renderer is about to draw."""
        get = object.__getattribute__  # PyVista's lookup is in Python
        camera, window = get(renderer, 'GetActiveCamera')(), get(renderer, 'GetRenderWindow')()
        if bool(get(camera, 'GetStereo')()) != bool(window.GetStereoRender()):
            camera.Render(renderer)  # updates the camera's stereo state
        aspect_ratio = get(renderer, 'GetTiledAspectRatio')()
        near, far = get(camera, 'GetClippingRange')()
        view = _view(
            get(camera, 'GetModelViewTransformMatrix')().GetData(),
            get(camera, 'GetProjectionTransformMatrix')(aspect_ratio, -1, 1).GetData(),
            near,
            far,
            bool(get(camera, 'GetParallelProjection')()),
            get(camera, 'GetPosition')(),
        )
        scale = window.GetTileScale()
        if scale == (1, 1):
            origin, size, tile = get(renderer, 'GetOrigin')(), get(renderer, 'GetSize')(), _WHOLE
        else:
            origin, size, tile = _tile(renderer, window)
        return cls(
            renderer=renderer,
            window=window,
            size=size,
            origin=origin,
            view=view,
            index=index,
            time=time,
            picking=get(renderer, 'GetSelector')() is not None,
            tile=tile,
            scale=scale[1],
            quality=quality,
        )

    def elsewhere(self, view, size, *, casting=False) -> Frame:
        """Return the frame of another view of the same scene."""
        flags = {'casting': casting, 'depth_map': casting, 'own': False}
        return replace(self, view=view, size=size, origin=(0, 0), quality=1.0, **flags)

    def within_passes(self) -> tuple[Frame, Frame]:
        """Return the frame as VTK's passes draw the scene, and as they show it."""
        if method(self.renderer, 'GetPass')() is None:
            return self, self
        camera = self.renderer.GetActiveCamera()
        if 0 in self.size or camera.GetUseExplicitProjectionTransformMatrix():
            return self, self
        width_ratio, height_ratio = margins(self.renderer, self.size)
        if width_ratio == height_ratio == 1:
            return self, self
        # Passes widen the angle along one axis and keep the shown aspect ratio.
        is_horizontal = camera.GetUseHorizontalViewAngle() and not self.parallel
        angle_ratio = width_ratio if is_horizontal else height_ratio
        size = round(self.size[0] * width_ratio), round(self.size[1] * height_ratio)
        drawn_view = _zoomed(self.view, 1 / angle_ratio, 1 / angle_ratio)
        shown_view = _zoomed(self.view, width_ratio / angle_ratio, height_ratio / angle_ratio)
        return replace(self, size=size, view=drawn_view), replace(self, view=shown_view)

    @property
    def view_from_world(self) -> np.ndarray:
        """See :class:`pvibr.maths.views.View`."""
        return self.view.view_from_world

    @property
    def clip_from_view(self) -> np.ndarray:
        """See :class:`pvibr.maths.views.View`."""
        return self.view.clip_from_view

    @property
    def pixel_from_view(self) -> np.ndarray:
        """Matrix from view space to clip x and y, then z (parallel) or w, and 1."""
        # A fragment's depth is exact in w of perspective views and in z of parallel ones.
        clip = self.clip_from_view
        return np.stack([clip[0], clip[1], clip[2 if self.parallel else 3], [0, 0, 0, 1.0]])

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

    def before(self, points) -> np.ndarray:
        """Return points moved slightly toward the eye, off their surfaces."""
        if not self.parallel:
            return points + _BEFORE * (self.eye - points)
        eye_distances = -(points @ self.view_from_world[2, :3] + self.view_from_world[2, 3])
        return points + _BEFORE * eye_distances[:, None] * self.view_from_world[2, :3]

    def once(self, make):
        """Return what a function makes of the frame, made once for all things."""
        if make not in self._made:
            self._made[make] = make(self)
        return self._made[make]

    def vary(self, name) -> tuple[float, float]:
        """Return two numbers, 0 to 1, that jitter an effect's sampling; 0 without samples."""
        return (0.0, 0.0) if self.sample is None else self.sample.pair(name)

    @property
    def whole(self) -> tuple[float, float]:
        """Width and height of the whole subplot in pixels; `size` is that of the tile."""
        left, bottom, right, top = self.tile
        return self.size[0] / (right - left or 1), self.size[1] / (top - bottom or 1)

    @cached_property
    def pixel_scales(self) -> tuple[float, float]:
        """Pixels per unit of tan(angle) in perspective, per world unit in parallel projection."""
        width, height = np.diag(self.clip_from_view)[:2] * self.size / 2
        return float(width), float(height)

    @cached_property
    def pixel_scale(self) -> float:
        """Pixels per unit along y, or the larger scale where pixels are oblong."""
        width, height = self.pixel_scales
        return max(width, height) if self.depth_map or width > _OBLONG * height else height

    @property
    def scene_size(self) -> float:
        """Diagonal of the visible scene, world units."""
        low, high = np.reshape(self.renderer.ComputeVisiblePropBounds(), (3, 2)).T
        return max(float(np.linalg.norm(high - low)), 1e-12)

    def pixel_at(self, point) -> float:
        """Return the size of a pixel at a point, world units."""
        view_depth = -float(self.view_from_world[2, :3] @ point + self.view_from_world[2, 3])
        return (1.0 if self.parallel else max(view_depth, self.near)) / self.pixel_scale


def _zoomed(view, x, y) -> View:
    """Return a view with its angles scaled along each axis."""
    clip_from_view = view.clip_from_view.copy()
    clip_from_view[0, 0] *= x
    clip_from_view[1, 1] *= y
    return replace(view, clip_from_view=_frozen(clip_from_view, (4, 4)))


def _tile(renderer, window):
    """Return origin, size and fraction of a subplot in the tile of a large screenshot."""
    tile, viewport, size = window.GetTileViewport(), renderer.GetViewport(), window.GetSize()
    tile_corners, drawn_shares = [], []
    for i in range(4):
        view_low, view_high = viewport[i % 2], viewport[2 + i % 2]
        tile_low, tile_high = tile[i % 2], tile[2 + i % 2]
        tile_edge = max(view_low, tile_low) if i < 2 else min(view_high, tile_high)
        drawn_shares.append((tile_edge - view_low) / (view_high - view_low or 1))
        within_tile = min(max(viewport[i], tile_low), tile_high) - tile_low
        tile_corners.append(round(within_tile * size[i % 2]))
    x0, y0, x1, y1 = tile_corners
    return (x0, y0), (x1 - x0, y1 - y0), tuple(drawn_shares)


@lru_cache(maxsize=64)
def _view(view_from_world, clip_from_view, near, far, parallel, position) -> View:
    """Return a view of a camera's numbers; the same object for the same ones."""
    matrices = _frozen(view_from_world, (4, 4)), _frozen(clip_from_view, (4, 4))
    return View(*matrices, near, far, parallel, _frozen(position))


def _frozen(values, shape=(3,)) -> np.ndarray:
    array = np.array(values, np.float64).reshape(shape)
    array.flags.writeable = False
    return array
