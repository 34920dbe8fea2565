"""Picking of the focal plane."""

from __future__ import annotations

import numpy as np
import pyvista as pv

from pvibr.core import _vtk
from pvibr.core.plotters import put_inner
from pvibr.effects.depth_of_field import DepthOfField
from pvibr.gl.scene_pass import hidden_name
from pvibr_widgets.handles_keys import OwnersControl
from pvibr_widgets.handles_marks import HOVERED
from pvibr_widgets.handles_overlay import SCENE, Overlay, Touch
from pvibr_widgets.handles_stage import Pointer, Stage

_COLOR, _OPACITY = (0.2, 0.75, 0.9), 0.4
_MARK = (90, 220, 255)
_SIZE = 28  # pixels
_STEP, _FINE = 10, 1  # pixels per arrow key press
_NEARER = 0.95  # factor of the distance per key press
_ARROWS = {'Left': (-1, 0), 'Right': (1, 0), 'Up': (0, 1), 'Down': (0, -1)}
_DEPTHS = {'Prior': 1 / _NEARER, 'Next': _NEARER}


def pick_focus(pl, lens, *, callback=None):
    """Focus on clicked points until Escape is pressed.

    A click or a drag on the scene sets ``lens.distance``, which is counted along the view. What is
    behind the plane in focus is tinted meanwhile: its edge runs where everything is sharp. A drag
    that begins on the background turns the camera as always. With keys: Tab, then arrows move the
    place that is picked, page up and page down bring the plane away and nearer, Escape ends it.

    Parameters
    ----------
    pl : pyvista.BasePlotter or vtkRenderer
        Where the lens is, in any subplot.
    lens : pvibr.DepthOfField
        Whose distance is set.
    callback : callable, optional
        Called with the lens after each change.

    Returns
    -------
    pvibr_widgets.handles_focus.FocusPick
        With ``remove()``, ``enabled`` and ``callbacks``; it goes with the lens.

    Raises
    ------
    TypeError
        If it is no lens.
    ValueError
        If it is in no subplot of the plotter.
    ClosedError
        If the plotter is closed.

    Examples
    --------
    >>> import pyvista as pv
    >>> import pvibr
    >>> import pvibr_widgets
    >>> pl = pv.Plotter(off_screen=True, window_size=(64, 48))
    >>> _ = pl.add_mesh(pv.Sphere())
    >>> lens = pl.ibr.add(pvibr.DepthOfField(f_number=1.4))
    >>> pl.camera_position = [(0, 0, 4), (0, 0, 0), (0, 1, 0)]
    >>> focus = pvibr_widgets.pick_focus(pl, lens)
    >>> pl.show(auto_close=False)
    >>> focus.pick((32, 24))
    True
    >>> lens.distance
    3.5
    >>> pl.close()
    """
    if not isinstance(lens, DepthOfField):
        raise TypeError(f'lens = {lens!r:.80}: must be a pvibr.DepthOfField')
    return FocusPick(Stage.of(pl, lens), lens, callback)


class FocusPick(Overlay):
    """Picker of the focal plane; see :func:`pick_focus`."""

    def __init__(self, stage, lens, callback=None):
        super().__init__(stage, callback)
        self.thing = lens
        self._pixel = np.zeros(2)  # the picked pixel of the subplot
        self._view: np.ndarray | None = None  # view matrix at the pick
        self._depths: np.ndarray | None = None
        self._plane = _Plane(stage.renderer)
        self._keys = OwnersControl(self, stage, 'Escape')
        stage.ring.add(self._keys)
        calls = self._begin, self._drag, self._end
        self._touch = Touch(stage, _SIZE / 2, *calls, area=self._hits, priority=SCENE)
        self._follow()

    def pick(self, pixel) -> bool:
        """Focus on the point seen at a pixel."""
        away = self._depth_at(pixel)
        if away is None:
            return False
        frame = self._stage.frame()
        self._pixel = np.subtract(pixel, frame.origin).astype(float)
        self._view = frame.view_from_world
        self._focus(away)
        return True

    def _focus(self, away):
        self.thing.distance = away
        self._tell()

    def _depth_at(self, pixel) -> float | None:
        """Return the view depth at a pixel, None on the background."""
        frame = self._stage.frame()
        x, y = (int(i) for i in np.floor(np.subtract(pixel, frame.origin)))
        if not _is_inside(frame, (x, y)) or self._is_gone():
            return None
        depths = self._depths
        if depths is None:
            depths = self.thing.pipeline.buffer('depth').array
        away = float(depths[len(depths) - 1 - y, x])
        return away if 0 < away < np.inf else None

    # -- mouse ------------------------------------------------------------------------------------

    def _event(self):
        return np.array(self._stage.interactor.GetEventPosition(), float)

    def _hits(self, pixel) -> bool:
        """Return True if a press hits the scene; elsewhere the camera is rotated."""
        self._depths = None
        frame = self._stage.frame()
        if not self._is_gone() and _is_inside(frame, np.subtract(pixel, frame.origin)):
            # The focus changes no depth: one depth image serves a whole drag.
            self._depths = self.thing.pipeline.buffer('depth').array
        return self._depth_at(pixel) is not None

    def _begin(self):
        self._stage.ring.take(self._keys)
        self._drag()

    def _drag(self):
        self.pick(self._event())
        self._stage.draw(by_widget=True)

    def _end(self):
        self._depths = None
        self._stage.draw(by_widget=True)

    # -- keyboard ---------------------------------------------------------------------------------

    def press(self, key, fine) -> bool:
        """Move the picked point or the plane, or stop picking."""
        frame = self._stage.frame()
        if key == 'Escape':
            self.remove()
        elif key in _ARROWS:
            at = self._pixel if self._is_shown(frame) else np.divide(frame.size, 2)
            at = at + np.multiply(_ARROWS[key], _FINE if fine else _STEP)
            self._pixel = np.clip(at, 0, np.subtract(frame.size, 1))
            self._view = frame.view_from_world
            self.pick(self._pixel + frame.origin)
        elif key in _DEPTHS:
            self._focus(self.thing.focus(frame) * _DEPTHS[key])
        else:
            return False
        self._stage.draw()
        return True

    # -- updates ----------------------------------------------------------------------------------

    def _is_gone(self):
        pipeline = self.thing.pipeline
        return pipeline is None or pipeline.renderer is not self._stage.renderer

    def _prepare(self, frame):
        self._plane.show(frame, self.thing)

    def _under(self, pixel):
        frame = self._stage.frame()
        if not self._is_shown(frame):
            return None
        away = np.linalg.norm(pixel - frame.origin - self._pixel)
        return 'focus' if away <= _SIZE / 2 else None

    def _update(self, frame):
        self._touch.switch(True)
        if not self._is_shown(frame):
            self._marks.hide()
            return
        at = self._pixel * frame.scale
        color = HOVERED if self._hovered else _MARK
        self._marks.draw_marks([(at, 'circle', color, _SIZE * frame.scale)])
        focused = self._hovered or self._stage.ring.current is self._keys
        self._marks.say('focus' if focused else '', at + 0.8 * _SIZE * frame.scale)

    def _is_shown(self, frame) -> bool:
        """Return True if the camera has not changed since the pick."""
        return self._view is not None and np.array_equal(self._view, frame.view_from_world)

    def _rest(self):
        self._plane.actor.VisibilityOff()
        self._touch.switch(False)
        self._stage.ring.lose(self._keys)

    def _free(self):
        self._stage.ring.drop(self._keys)
        self._touch.remove()
        self._stage.renderer.RemoveViewProp(self._plane.actor)


def _is_inside(frame, pixel) -> bool:
    return 0 <= pixel[0] < frame.size[0] and 0 <= pixel[1] < frame.size[1]


class _Plane:
    """The translucent focal plane."""

    def __init__(self, renderer):
        square = pv.PolyData([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], [4, 0, 1, 2, 3])
        mapper = _vtk.vtkPolyDataMapper()
        mapper.SetInputData(square)
        self._matrix = _vtk.vtkMatrix4x4()
        self.actor = _vtk.vtkActor()
        self.actor.SetMapper(mapper)
        self.actor.SetUserMatrix(self._matrix)
        self.actor.SetObjectName(hidden_name('plane in focus'))
        self.actor.PickableOff()
        self.actor.UseBoundsOff()
        look = self.actor.GetProperty()
        look.LightingOff()
        look.SetColor(*_COLOR)
        look.SetOpacity(_OPACITY)
        put_inner(renderer, self.actor)

    def show(self, frame, lens):
        """Show the plane at the focal distance, as large as the view there."""
        away = lens.focus(frame)
        self.actor.VisibilityOn()
        whole = frame.origin, np.add(frame.origin, frame.size)
        pixels = [(whole[i][0], whole[j][1]) for i, j in ((0, 0), (1, 0), (0, 1))]
        rays = [Pointer(frame, pixel) for pixel in pixels]
        low, right, top = (r.origin + r.direction * away / (r.direction @ r.ahead) for r in rays)
        matrix = np.eye(4)
        matrix[:3, 0], matrix[:3, 1], matrix[:3, 3] = right - low, top - low, low
        matrix[:3, 2] = rays[0].ahead
        self._matrix.DeepCopy(matrix.ravel().tolist())
