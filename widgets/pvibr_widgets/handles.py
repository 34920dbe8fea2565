"""Handles in the scene, moved by mouse, touch or keyboard."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from pvibr_widgets.handles_keys import Control
from pvibr_widgets.handles_marks import HOVERED
from pvibr_widgets.handles_overlay import Overlay, Touch
from pvibr_widgets.handles_stage import Pointer, to_pixels

_STEP, _FINE = 10, 1  # pixels per arrow key press
_NEARER = 0.95  # factor of the distance per key press
_ARROWS = {'Left': (-1, 0), 'Right': (1, 0), 'Up': (0, 1), 'Down': (0, -1)}
_DEPTHS = {'Prior': 1 / _NEARER, 'Next': _NEARER}
_COLOR, _FOCUS = (255, 205, 60), (90, 220, 255)
_SHAPES = {'position': 'square', 'roll': 'triangle', 'angle': 'diamond'}
_MOST = 200  # pixels: largest tolerance of VTK


class Handles(Overlay):
    """Handles of one thing in a scene; created by the functions of this package."""

    def __init__(self, stage, names, *, callback=None, size=28):
        if not 4 <= size <= _MOST:
            raise ValueError(f'size = {size!r}: must be 4 to {_MOST} pixels; fingers need 24')
        super().__init__(stage, callback)
        self._size = float(size)
        self._places: dict = {}
        self._grips = {name: Grip(self, stage, name, size / 2) for name in names}
        self._follow()

    # -- hooks of subclasses ----------------------------------------------------------------------

    def _look(self) -> dict:
        """Return handle positions by name, in world units; missing handles are off."""
        return {}

    def _lines(self) -> list:
        """Return segments (n, 2, 3), world units, with their colours."""
        return []

    def _bound(self, name) -> tuple | None:
        """Return the constraint of a handle, None if it moves freely."""
        return None

    def _put(self, name, point):
        """Change the thing to match a handle position; raise ValueError if it is invalid."""

    # -- user actions -----------------------------------------------------------------------------

    @property
    def pixels(self) -> dict:
        """Window positions of the handles by name: x and y from the lower left corner."""
        frame = self._stage.frame()
        self._places = self._looked()
        at = to_pixels(frame, [*self._places.values()]) + frame.origin
        return dict(zip(self._places, map(tuple, at.tolist()), strict=True))

    @property
    def focused(self) -> str | None:
        """Name of the handle with the keyboard focus."""
        current = self._stage.ring.current
        return next((n for n, grip in self._grips.items() if grip is current), None)

    def focus(self, name):
        """Give a handle the keyboard focus, as Tab does."""
        self._stage.ring.take(self._grips[name])

    def move(self, name, pixel):
        """Move a handle as dragging does."""
        place = self._places[name]
        pointer = Pointer(self._stage.frame(), pixel)
        kind, *bound = self._bound(name) or ('facing', place)
        ways: dict[str, Callable] = {
            'facing': pointer.facing,
            'plane': pointer.on_plane,
            'line': pointer.on_line,
            'sphere': pointer.on_sphere,
        }
        goal = ways[kind](*bound)
        if goal is not None:
            self._try(name, goal)

    def push(self, name, factor):
        """Move a handle along the line of sight."""
        place, frame = self._places[name], self._stage.frame()
        pointer = Pointer(frame, to_pixels(frame, [place])[0] + frame.origin)
        kind, *bound = self._bound(name) or ('facing',)
        if kind == 'facing':
            away = (place - pointer.origin) @ pointer.direction
            self._try(name, place + (factor - 1) * away * pointer.direction)
        elif kind == 'sphere':
            self._try(name, pointer.on_sphere(*bound, far=factor > 1))

    # -- updates ----------------------------------------------------------------------------------

    def _try(self, name, point):
        """Change the thing if the position is valid; a drag continues either way."""
        if self._is_gone() or not np.isfinite(point).all():
            return
        try:
            self._put(name, point)
        except ValueError:
            return
        self._places = self._looked()
        self._tell()

    def _looked(self) -> dict:
        try:
            return {name: np.asarray(p, float) for name, p in self._look().items()}
        except ValueError:  # values set by code may be invalid; the effect reports them
            return {}

    def _rest(self):
        for grip in self._grips.values():
            grip.place(None)

    def _free(self):
        for grip in self._grips.values():
            grip.remove()

    def _under(self, pixel):
        names = [name for name in self._places if self._grips[name].usable]
        if not names:
            return None
        frame = self._stage.frame()
        at = to_pixels(frame, [self._places[name] for name in names]) + frame.origin
        away = np.linalg.norm(at - pixel, axis=1)
        return names[int(away.argmin())] if away.min() <= self._size / 2 else None

    def _update(self, frame):
        self._places = self._looked()
        for name, grip in self._grips.items():
            grip.place(self._places.get(name))
        if not self._places:
            self._marks.hide()
            return
        self._marks.draw_lines(frame, self._lines())
        at = dict(zip(self._places, to_pixels(frame, [*self._places.values()]), strict=True))
        focused = self.focused
        marks = []
        for name, pixel in at.items():
            seen = bool(np.isfinite(pixel).all())
            self._grips[name].touch.reach(seen)
            if seen:
                color = {self._hovered: HOVERED, focused: _FOCUS}.get(name, _COLOR)
                size = self._size * frame.scale
                marks.append((pixel, _SHAPES.get(name, 'circle'), color, size))
        self._marks.draw_marks(marks)
        named = self._hovered if self._hovered in at else focused
        where = at.get(named)
        if where is None or not np.isfinite(where).all():
            self._marks.say('')
        else:
            self._marks.say(named, where + 0.8 * self._size * frame.scale)


class Grip(Control):
    """One handle."""

    def __init__(self, owner, stage, name, tolerance):
        self._owner, self._stage, self._name = owner, stage, name
        self._offset = np.zeros(2)
        self.touch = Touch(stage, tolerance, self._begin, self._drag, self._end)
        stage.ring.add(self)

    @property
    def usable(self) -> bool:
        """Whether the handle is active."""
        return self.touch.usable

    def place(self, point):
        """Move the handle to its position."""
        self.touch.switch(point is not None)
        if point is None:
            self._stage.ring.lose(self)
        else:
            self.touch.place(point)

    def focus(self, on):
        """Show the keyboard focus."""
        self._stage.draw()

    def press(self, key, fine) -> bool:
        """Move the handle by a key."""
        if key in _ARROWS:
            step = _FINE if fine else _STEP
            at = np.array(self._owner.pixels[self._name])
            self._owner.move(self._name, at + np.multiply(_ARROWS[key], step))
        elif key in _DEPTHS:
            self._owner.push(self._name, _DEPTHS[key])
        else:
            return False
        self._stage.draw()
        return True

    def _begin(self):
        # The touched point stays under the finger.
        self._offset = np.subtract(self._owner.pixels[self._name], self._pixel())
        self._stage.ring.take(self)

    def _drag(self):
        self._owner.move(self._name, self._pixel() + self._offset)
        self._stage.draw(by_widget=True)

    def _end(self):
        self._stage.draw(by_widget=True)

    def _pixel(self):
        return np.array(self._stage.interactor.GetEventPosition(), float)

    def remove(self):
        """Remove the handle from the scene."""
        self._stage.ring.drop(self)
        self.touch.remove()
