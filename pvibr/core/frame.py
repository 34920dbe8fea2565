"""What one frame is made of."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np


@dataclass(frozen=True, eq=False)
class Frame:
    """One frame of one subplot; read-only, the only thing that is passed to effects."""

    renderer: Any
    window: Any
    size: tuple[int, int]
    origin: tuple[int, int]
    view_from_world: np.ndarray
    clip_from_view: np.ndarray
    parallel: bool
    near: float
    far: float
    eye: np.ndarray
    index: int = 0
    time: float = 0.0
    picking: bool = False
    casting: bool = False
    tile: tuple[float, float, float, float] = (0.0, 0.0, 1.0, 1.0)
    scale: int = 1
    quality: float = 1.0

    @classmethod
    def of(cls, renderer, *, index=0, time=0.0, quality=1.0) -> Frame:
        """Return the frame that a renderer is about to draw."""
        camera = renderer.GetActiveCamera()
        near, far = camera.GetClippingRange()
        projection = camera.GetProjectionTransformMatrix(renderer.GetTiledAspectRatio(), -1, 1)
        window = renderer.GetRenderWindow()
        scale = tuple(window.GetTileScale())
        origin, size, tile = _whole(renderer) if scale == (1, 1) else _tile(renderer, window)
        return cls(
            renderer=renderer,
            window=window,
            size=size,
            origin=origin,
            view_from_world=_matrix(camera.GetModelViewTransformMatrix()),
            clip_from_view=_matrix(projection),
            parallel=bool(camera.GetParallelProjection()),
            near=near,
            far=far,
            eye=_frozen(camera.GetPosition()),
            index=index,
            time=time,
            picking=renderer.GetSelector() is not None,
            tile=tile,
            scale=scale[1],
            quality=quality,
        )

    @property
    def whole(self) -> tuple[float, float]:
        """Width and height of the subplot in pixels, where `size` is those of a tile of it."""
        left, bottom, right, top = self.tile
        return self.size[0] / (right - left), self.size[1] / (top - bottom)

    @property
    def pixel_scale(self) -> float:
        """Pixels per unit of tan(angle) in perspective, per world unit in parallel projection."""
        return float(self.clip_from_view[1, 1] * self.size[1] / 2)

    @property
    def own(self) -> bool:
        """Whether it is what the renderer's own camera shows, not what a light or another sees."""
        if self.casting:
            return False
        matrix = self.renderer.GetActiveCamera().GetModelViewTransformMatrix()
        return bool(np.array_equal(_matrix(matrix), self.view_from_world))

    def pixel_at(self, point) -> float:
        """Return the size of a pixel at a point, in world units."""
        away = -float(self.view_from_world[2, :3] @ point + self.view_from_world[2, 3])
        return (1.0 if self.parallel else max(away, self.near)) / self.pixel_scale


def _whole(renderer):
    """Return origin and size of a subplot, in pixels of the framebuffer, and the shares drawn."""
    return tuple(renderer.GetOrigin()), tuple(renderer.GetSize()), (0.0, 0.0, 1.0, 1.0)


def _tile(renderer, window):
    """Return the same where a tile of a large screenshot is drawn."""
    tile, view, whole = window.GetTileViewport(), renderer.GetViewport(), window.GetSize()
    corners, shares = [], []
    for i in range(4):
        side = view[2 + i % 2] - view[i % 2]
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
