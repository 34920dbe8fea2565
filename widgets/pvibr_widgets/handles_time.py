"""A timeline bar in the scene."""

from __future__ import annotations

import math

import numpy as np

from pvibr_widgets.handles_keys import OwnersControl
from pvibr_widgets.handles_marks import DARK, HOVERED
from pvibr_widgets.handles_overlay import BAR, Overlay, Touch
from pvibr_widgets.handles_stage import Stage

_TOUCHED = 32  # pixels of the touch target
_TRACK = 6  # pixels of the height of the bar
_EDGE = 24  # pixels from the border of the subplot
_STEP, _FINE = 0.01, 0.001  # of the bar, by a key
_STEPS = {'Left': -1, 'Right': 1, 'Down': -1, 'Up': 1, 'Prior': 10, 'Next': -10}
_GREY, _DONE, _KNOB, _FOCUS = (150, 150, 150), (255, 205, 60), (255, 205, 60), (90, 220, 255)


def time_bar(pl, start, stop, *, speed=1.0, loop=True, callback=None):
    """Add a timeline bar for ``pl.ibr.time`` at the lower border of the active subplot.

    The bar is dragged or clicked on; the button at its left or the space bar plays and pauses.
    With keys: Tab to it, then arrows by a hundredth, with Shift by a thousandth, Home and End;
    Escape lets go.

    Parameters
    ----------
    pl : pyvista.BasePlotter or vtkRenderer
        Whose time.
    start, stop : float
        Seconds at its ends.
    speed : float, optional
        Seconds in a second of those who look; backward below 0.
    loop : bool, optional
        Whether it begins again at the end, or stops there.
    callback : callable, optional
        Called with the time after each change by the bar, not while it plays.

    Returns
    -------
    pvibr_widgets.handles_time.TimeBar
        With ``play()``, ``pause()``, ``remove()``, ``enabled`` and ``callbacks``.

    Raises
    ------
    ValueError
        If a number is not allowed.
    TypeError
        If the callback cannot be called.
    ClosedError
        If the plotter is closed.

    Examples
    --------
    >>> import pyvista as pv
    >>> import pvibr
    >>> import pvibr_widgets
    >>> pl = pv.Plotter(off_screen=True)
    >>> bar = pvibr_widgets.time_bar(pl, 0, 4)
    >>> bar.play()
    >>> pl.ibr.playing
    True
    >>> pl.close()
    """
    ends = start, stop, speed
    if not all(math.isfinite(x) for x in ends) or start >= stop:
        raise ValueError(
            f'start, stop, speed = {start!r}, {stop!r}, {speed!r}: finite, start below stop'
        )
    return TimeBar(Stage(pl), float(start), float(stop), float(speed), bool(loop), callback)


class TimeBar(Overlay):
    """A bar that shows and sets the time; see :func:`time_bar`."""

    def __init__(self, stage, start, stop, speed, loop, callback=None):
        super().__init__(stage, callback)
        self.start, self.stop, self.speed, self.loop = start, stop, speed, loop
        self._plays = self._held = False
        calls = self.hold, self.slide, self.let_go
        self._slider = Touch(stage, _TOUCHED, *calls, area=self._on_bar, priority=BAR)
        calls = self.toggle, self._shown, self._shown
        self._button = Touch(stage, _TOUCHED, *calls, area=self._on_button, priority=BAR)
        self._keys = OwnersControl(self, stage, 'space')
        stage.ring.add(self._keys)
        self._follow()

    @property
    def _time(self) -> float:
        return self._stage.ibr.time

    def _tell(self):
        for call in list(self.callbacks):
            call(self._time)

    # -- what users do ----------------------------------------------------------------------------

    @property
    def playing(self) -> bool:
        """Whether the clock is running."""
        return self._stage.ibr.playing

    def play(self):
        """Start the clock; at the last time restart from the other end."""
        ibr = self._stage.ibr
        first, last = self._way()
        ahead = (last - ibr.time) * (1 if self.speed >= 0 else -1)
        if not self.start <= ibr.time <= self.stop or ahead <= 0:
            ibr.time = first
        self._plays = True
        ibr.play(self.speed)

    def pause(self):
        """Stop the clock."""
        self._plays = False
        self._stage.ibr.stop()

    def toggle(self):
        """Play, or pause."""
        self.pause() if self.playing else self.play()

    def set(self, time):
        """Set the time, as the bar does."""
        self._stage.ibr.time = float(np.clip(time, self.start, self.stop))
        self._tell()

    def press(self, key, fine) -> bool:
        """Handle a key."""
        span = (self.stop - self.start) * (_FINE if fine else _STEP)
        if key == 'space':
            self.toggle()
        elif key in _STEPS:
            self.set(self._time + span * _STEPS[key])
        elif key in ('Home', 'End'):
            self.set(self.start if key == 'Home' else self.stop)
        else:
            return False
        self._stage.draw()
        return True

    # -- by mouse ---------------------------------------------------------------------------------

    def hold(self):
        """Start to drag the time."""
        self._held = self.playing
        if self._held:
            self._stage.ibr.stop()
        self._stage.ring.take(self._keys)
        self.slide()

    def slide(self):
        """Set the time under the pointer."""
        left, right, _ = self._place(self._stage.frame())
        x, _ = self._beside(self._stage.interactor.GetEventPosition())
        self.set(self.start + (self.stop - self.start) * (x - left) / (right - left))
        self._stage.draw(by_widget=True)

    def let_go(self):
        """End the drag; resume if the clock was running."""
        if self._held:
            self._stage.ibr.play(self.speed)
        self._held = False
        self._stage.draw(by_widget=True)

    def _on_bar(self, pixel) -> bool:
        left, right, low = self._place(self._stage.frame())
        x, y = self._beside(pixel)
        near = _TOUCHED / 2
        return left - near <= x <= right + near and abs(y - low) <= near

    def _on_button(self, pixel) -> bool:
        return bool(np.abs(np.subtract(self._beside(pixel), _EDGE)).max() <= _TOUCHED / 2)

    def _under(self, pixel):
        if self._on_button(pixel):
            return 'pause' if self.playing else 'play'
        return 'time' if self._on_bar(pixel) else None

    def _beside(self, pixel):
        """Return a window pixel as a subplot pixel."""
        return np.subtract(pixel, self._stage.frame().origin)

    def _shown(self):
        self._stage.draw(by_widget=True)

    # -- following --------------------------------------------------------------------------------

    def _way(self):
        ends = self.start, self.stop
        return ends if self.speed >= 0 else ends[::-1]

    def _prepare(self, frame):
        """Restart or stop at the end, before the frame is prepared."""
        ibr = self._stage.ibr
        time = ibr.time
        if not (self._plays and ibr.playing) or self.start <= time <= self.stop:
            return
        if self.loop:
            ibr.time = self.start + (time - self.start) % (self.stop - self.start)
        else:
            self.pause()
            ibr.time = self._way()[1]

    def _update(self, frame):
        self._slider.switch(True)
        self._button.switch(True)
        left, right, low = self._place(frame)
        share = float(np.clip((self._time - self.start) / (self.stop - self.start), 0, 1))
        at = left + share * (right - left)
        plain = _FOCUS if self._stage.ring.current is self._keys else _KNOB
        button = plain if self._hovered in (None, 'time') else HOVERED
        knob = HOVERED if self._hovered == 'time' else plain
        shapes = [
            *_framed(_box(left, right, low), _GREY),
            (_box(left, at, low), _DONE),
            *((corners, DARK) for corners in self._glyph(low, 3)),
            *((corners, button) for corners in self._glyph(low, 0)),
            (_disk((at, low), _TOUCHED / 2 - 2), DARK),
            (_disk((at, low), _TOUCHED / 2 - 5), knob),
        ]
        self._marks.draw_polygons([(corners * frame.scale, color) for corners, color in shapes])
        word = f'{self._time:.2f} s'
        if self._hovered is not None:
            word = self._hovered if self._hovered != 'time' else f'time {word}'
        beside = min(at, right - 2.5 * _EDGE), low + 0.6 * _TOUCHED
        self._marks.say(word, np.multiply(beside, frame.scale))

    def _place(self, frame) -> tuple[float, float, float]:
        """Return the bar's ends and its height, in pixels of the subplot."""
        width = frame.whole[0] / frame.scale
        return 2.5 * _EDGE, max(width - _EDGE, 3 * _EDGE), _EDGE

    def _glyph(self, low, wider):
        """Return the pause or play glyph of the button."""
        middle, size = np.array([_EDGE, low]), 9 + wider
        if self.playing or self._held:
            box = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * [3 + wider, size]
            return [middle + box + [x, 0] for x in (-5, 5)]
        return [middle + size * np.array([[-0.8, -1], [1.1, 0], [-0.8, 1]])]

    def _rest(self):
        self._slider.switch(False)
        self._button.switch(False)
        self._stage.ring.lose(self._keys)

    def _free(self):
        self._stage.ring.drop(self._keys)
        self._slider.remove()
        self._button.remove()


def _box(left, right, low):
    half = _TRACK / 2
    return np.array(
        [[left, low - half], [right, low - half], [right, low + half], [left, low + half]]
    )


def _framed(corners, color):
    middle = corners.mean(axis=0)
    return (corners + 3 * np.sign(corners - middle), DARK), (corners, color)


def _disk(middle, radius):
    angles = np.linspace(0, 2 * np.pi, 24, endpoint=False)
    return middle + radius * np.column_stack([np.cos(angles), np.sin(angles)])
