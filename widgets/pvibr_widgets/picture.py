"""The picture of a plotter elsewhere, and what mouse, wheel and keys there do to its view."""

from __future__ import annotations

import imageio.v3 as imageio

from pvibr.core.plotters import is_never_shown
from pvibr.things.clipping_range import reset_clipping_range

_BUTTONS = ('Left', 'Middle', 'Right')
#: What a page calls what is done: events of the interactor; a button's name goes in front.
_BUTTON_EVENTS = {'press': 'ButtonPressEvent', 'release': 'ButtonReleaseEvent'}
_WHEEL_EVENTS = {'in': 'MouseWheelForwardEvent', 'out': 'MouseWheelBackwardEvent'}
#: Degrees of azimuth and elevation of the arrow keys.
_TURNS = {'left': (10, 0), 'right': (-10, 0), 'up': (0, -10), 'down': (0, 10)}


class Picture:
    """The picture of a plotter as JPEG, in the size of its window and in others."""

    def __init__(self, plotter):
        self._plotter = plotter
        self.frame = 0
        self._jpeg = b''
        self._stills: dict[tuple, bytes] = {}
        self._stills_of = b''
        self._draws_still = False
        # What waits for rest, and time that goes on, look for a loop where there are callbacks.
        plotter.add_on_render_callback(lambda *_: None, render_event=False)

    def count(self) -> bool:
        """Count a frame of the window; return False if it is only of a still."""
        if not self._draws_still:
            self.frame, self._jpeg = self.frame + 1, b''
        return not self._draws_still

    @property
    def size(self) -> tuple:
        """Width and height of the window."""
        return tuple(self._plotter.window_size)

    def resize(self, size):
        """Draw the window in another size, and the first time in any."""
        if not self.frame or size != self.size:
            self._plotter.window_size = size
            if is_never_shown(self._plotter):
                self._plotter.screenshot(return_img=False)  # sets up the camera, too
            self._plotter.render()

    def jpeg(self, size=None) -> bytes:
        """Return the last frame, or the same view in another size."""
        if not self._jpeg:
            # As it is: a screenshot would draw it again where its quality is lowered.
            self._jpeg = _encoded(self._plotter.image)
        return self._jpeg if size in (None, self.size) else self._still(size)

    def _still(self, size) -> bytes:
        if self._stills_of != self._jpeg:  # what converged to the same again has the same stills
            self._stills, self._stills_of = {}, self._jpeg
        if size not in self._stills:
            self._draws_still = True
            try:
                self._stills[size] = _encoded(self._plotter.ibr.screenshot(window_size=size))
            finally:
                self._draws_still = False
        return self._stills[size]

    def point(self, action, x, y, button=0, keys=''):
        """Do what mouse, wheel or an arrow key does at a place of the picture, in shares of it.

        ``keys`` are those held: 's' for Shift, 'c' for Control.
        """
        if action in _TURNS:
            self._turn(*_TURNS[action])
        elif self._plotter.iren is not None:
            interactor = self._plotter.iren.interactor
            place = tuple(round(s * n) for s, n in zip((x, y), self.size, strict=True))
            moves = place != interactor.GetEventPosition()  # else a frame more
            interactor.SetEventInformation(*place, 'c' in keys, 's' in keys, '\0', 0, '')
            if moves:
                interactor.MouseMoveEvent()
            if action in _BUTTON_EVENTS:
                getattr(interactor, _BUTTONS[button] + _BUTTON_EVENTS[action])()
            elif action in _WHEEL_EVENTS:
                getattr(interactor, _WHEEL_EVENTS[action])()

    def _turn(self, azimuth, elevation):
        camera = self._plotter.camera
        camera.Azimuth(azimuth)
        camera.Elevation(elevation)
        camera.OrthogonalizeViewUp()
        reset_clipping_range(self._plotter.renderer)
        self._plotter.render()


def _encoded(pixels) -> bytes:
    return imageio.imwrite('<bytes>', pixels[..., :3], extension='.jpg', quality=95, subsampling=0)
