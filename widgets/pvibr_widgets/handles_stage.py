"""The renderer and camera of handles, and the rays of pixels."""

from __future__ import annotations

import contextlib
import weakref

import numpy as np

from pvibr.api.plain_renderer import attach
from pvibr.capture.clock import draw, has_page
from pvibr.things.frame import Frame
from pvibr_widgets.handles_keys import Ring

_rings: weakref.WeakKeyDictionary = weakref.WeakKeyDictionary()
_EDGE_ON = 0.05  # cosine below which a plane is too flat to be pointed at
_NEAREST = 1e-9  # of w: what is nearer to the eye's own plane is behind it


class Stage:
    """A subplot with handles."""

    def __init__(self, plotter, renderer=None):
        is_renderer = hasattr(plotter, 'IsA') and plotter.IsA('vtkRenderer')
        if not is_renderer and not hasattr(plotter, 'ibr'):
            raise TypeError(f'pl = {plotter!r:.80}: must be a PyVista plotter or a vtkRenderer')
        self.plotter = plotter
        self.ibr = attach(plotter) if is_renderer else plotter.ibr
        pipeline = self.ibr.pipeline  # says so where the plotter is closed
        self.renderer = pipeline.renderer if renderer is None else renderer
        window = self.renderer.GetRenderWindow()
        interactor = None if window is None else window.GetInteractor()
        if interactor is None:
            raise ValueError(
                'pl has no interactor, which tells of the mouse and keys: give its window one'
            )
        self.interactor = interactor
        if self.ibr not in _rings:
            _rings[self.ibr] = Ring(self.interactor)
        self.ring: Ring = _rings[self.ibr]

    @classmethod
    def of(cls, plotter, effect):
        """Return the subplot of an effect."""
        active = cls(plotter)
        renderer = None if effect.pipeline is None else effect.pipeline.renderer
        window = active.renderer.GetRenderWindow()
        if renderer is None or renderer.GetRenderWindow() is not window:
            raise ValueError(f'{effect.name} is in no subplot of pl: add it by pl.ibr.add first')
        return cls(plotter, renderer)

    def frame(self) -> Frame:
        """Return the current frame."""
        return Frame.of(self.renderer)

    def draw(self, *, by_widget=False):
        """Render the changes."""
        asked = by_widget and bool(self.interactor.GetEnabled())
        if asked and not has_page(self.plotter):
            return
        if hasattr(self.plotter, 'render'):
            draw(self.plotter)
        else:
            self.renderer.GetRenderWindow().Render()

    @contextlib.contextmanager
    def still(self):
        """Switch widgets without rendering for each."""
        was = self.interactor.GetEnableRender()
        self.interactor.EnableRenderOff()
        try:
            yield
        finally:
            self.interactor.SetEnableRender(was)


def to_pixels(frame, points):
    """Return the pixels of points."""
    clip = _clip(frame, points)
    shown = clip[:, 3] > _NEAREST * max(frame.far, 1e-300) if not frame.parallel else True
    with np.errstate(divide='ignore', invalid='ignore'):
        pixels = _pixels(frame, clip)
    return np.where(np.broadcast_to(shown, len(clip))[:, None], pixels, np.nan)


def lines_to_pixels(frame, segments):
    """Return the pixels of lines, clipped at the near plane."""
    segments = np.asarray(segments, float).reshape(-1, 2, 3)
    ends = _clip(frame, segments.reshape(-1, 3)).reshape(-1, 2, 4)
    if not frame.parallel:
        least = 1e-3 * frame.near
        first, last = ends[:, 0, 3] - least, ends[:, 1, 3] - least
        ends, first, last = (a[(first > 0) | (last > 0)] for a in (ends, first, last))
        with np.errstate(divide='ignore', invalid='ignore'):
            share = np.where(first * last < 0, first / (first - last), 0.0)[:, None]
        middle = ends[:, 0] + share * (ends[:, 1] - ends[:, 0])
        ends[first < 0, 0], ends[last < 0, 1] = middle[first < 0], middle[last < 0]
    return _pixels(frame, ends)


def _pixels(frame, clip):
    # Of the whole subplot, where a tile of a large screenshot is drawn: so 2D actors are placed.
    tile = np.multiply(frame.tile[:2], frame.whole)
    return (clip[..., :2] / clip[..., 3:] + 1) / 2 * frame.size + tile


def _clip(frame, points):
    points = np.asarray(points, float).reshape(-1, 3)
    homogeneous = np.column_stack([points, np.ones(len(points))])
    # Far from the origin the view's product is the one that must be exact.
    return homogeneous @ frame.view_from_world.T @ frame.clip_from_view.T


class Pointer:
    """The ray through a pixel."""

    def __init__(self, frame, pixel):
        x, y = 2 * (np.asarray(pixel, float) - frame.origin) / frame.size - 1
        ends = np.linalg.solve(frame.clip_from_view, np.array([[x, y, -1, 1], [x, y, 1, 1]]).T).T
        near, far = ends[:, :3] / ends[:, 3:]
        turn = frame.view_from_world[:3, :3].T  # world from view
        self.ahead = -turn[:, 2]
        self.direction = turn @ (far - near)
        self.direction /= np.linalg.norm(self.direction)
        eye = -turn @ frame.view_from_world[:3, 3]
        self.origin = eye + turn @ np.array([*near[:2], 0.0]) if frame.parallel else eye

    def facing(self, point):
        """Return the intersection with the plane through a point parallel to the image plane."""
        away = (np.asarray(point, float) - self.origin) @ self.ahead
        return self.origin + self.direction * away / (self.direction @ self.ahead)

    def on_plane(self, point, normal):
        """Return the intersection with a plane, or the closest point if they are parallel."""
        point, normal = np.asarray(point, float), np.asarray(normal, float)
        slope = self.direction @ normal
        if abs(slope) > _EDGE_ON:
            away = (point - self.origin) @ normal / slope
            if away > 0:
                return self.origin + away * self.direction
        hit = self.facing(point)
        return hit - normal * ((hit - point) @ normal)

    def on_line(self, point, direction):
        """Return the point of a line nearest to the ray."""
        point, direction = np.asarray(point, float), np.asarray(direction, float)
        cosine = self.direction @ direction
        if 1 - cosine**2 < _EDGE_ON**2:
            return None
        between = self.origin - point
        along = (between @ direction - cosine * (between @ self.direction)) / (1 - cosine**2)
        return point + along * direction

    def on_sphere(self, center, place, *, far=None):
        """Return the intersection with a sphere around a point, or the nearest on its rim."""
        center = np.asarray(center, float)
        arm = np.asarray(place, float) - center
        radius = float(np.linalg.norm(arm))
        if far is None:
            far = arm @ self.direction > 0
        along = (center - self.origin) @ self.direction
        off = self.origin + along * self.direction - center
        away = float(np.linalg.norm(off))
        if away >= radius:
            return center + off * radius / away
        half = np.sqrt(radius**2 - away**2)
        return center + off + (half if far else -half) * self.direction
