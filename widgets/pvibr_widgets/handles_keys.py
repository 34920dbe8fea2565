"""Keyboard focus of the controls in a window: Tab moves it, Escape releases it."""

from __future__ import annotations

_NEXT, _PREVIOUS = ('Tab', 'period'), ('ISO_Left_Tab', 'comma')
_FIRST = 20.0  # before interactor styles, which may use the same keys


class Control:
    """A control that can have the keyboard focus."""

    @property
    def usable(self) -> bool:
        """Whether the control can take the focus."""
        return True

    def focus(self, on):
        """Show the keyboard focus."""

    def press(self, key, fine) -> bool:
        """Handle a key while the control has the focus."""
        return False

    def overhear(self, key) -> bool:
        """Handle a key that the focused control ignored."""
        return False


class OwnersControl(Control):
    """The keyboard focus of an owner that is a single control."""

    def __init__(self, owner, stage, hears):
        self._owner, self._stage, self._hears = owner, stage, hears

    @property
    def usable(self) -> bool:
        """Whether the owner is enabled."""
        return self._owner.enabled

    def focus(self, on):
        """Redraw the owner, which shows the keyboard focus."""
        self._stage.draw()

    def press(self, key, fine) -> bool:
        """Forward a key."""
        return self._owner.press(key, fine)

    def overhear(self, key) -> bool:
        """Forward the key that the owner always handles."""
        return key == self._hears and self.usable and self._owner.press(key, False)


class Ring:
    """The controls of a window in tab order."""

    def __init__(self, interactor):
        self._interactor = interactor
        self._controls: list[Control] = []
        self._tag: int | None = None
        self.current: Control | None = None

    def add(self, control):
        """Append a control."""
        self._controls.append(control)
        if self._tag is None:
            self._tag = self._interactor.AddObserver('KeyPressEvent', self._on_key, _FIRST)

    def drop(self, control):
        """Remove a control."""
        self.lose(control)
        self._controls.remove(control)
        if not self._controls and self._tag is not None:
            self._interactor.RemoveObserver(self._tag)
            self._tag = None

    def lose(self, control):
        """Take the focus from a control that reports itself disabled."""
        if self.current is control:
            self.current = None

    def take(self, control):
        """Focus a control."""
        old, self.current = self.current, control
        if old is control:
            return
        for changed in (old, control):
            if changed is not None:
                changed.focus(changed is control)

    def _on_key(self, interactor, _event):
        key, fine = interactor.GetKeySym() or '', bool(interactor.GetShiftKey())
        tag = self._tag  # a control may remove itself
        command = interactor.GetCommand(tag)
        if self.hear(key, fine) and command is not None:
            command.AbortFlagOn()

    def hear(self, key, fine=False) -> bool:
        """Handle a key."""
        if key in (*_NEXT, *_PREVIOUS):
            return self._step(-1 if key in _PREVIOUS or (key == 'Tab' and fine) else 1)
        current = self.current
        if current is not None and current.usable and current.press(key, fine):
            return True
        if key == 'Escape' and current is not None:
            self.take(None)
            return True
        return any(control.overhear(key) for control in reversed(self._controls))

    def _step(self, step) -> bool:
        """Focus the next control; after the last one nothing is focused, so that Tab can leave."""
        ring = [None, *(c for c in self._controls if c.usable)]
        place = ring.index(self.current) if self.current in ring else 0
        self.take(ring[(place + step) % len(ring)])
        return len(ring) > 1
