"""Which control in a window has the keys: Tab goes from one to the next, Escape lets go."""

from __future__ import annotations

_NEXT, _PREVIOUS = ('Tab', 'period'), ('ISO_Left_Tab', 'comma')
_FIRST = 20.0  # before plotters and styles, whose keys these may be too


class Control:
    """What may have the keys of a window."""

    @property
    def usable(self) -> bool:
        """Whether it can be reached now."""
        return True

    def focus(self, on):
        """Show whether it has the keys."""

    def press(self, key, fine) -> bool:
        """Take a key while it has the keys."""
        return False

    def overhear(self, key) -> bool:
        """Take a key that nothing else wants."""
        return False


class OwnersControl(Control):
    """The keys of something that is one control as a whole."""

    def __init__(self, owner, stage, hears):
        self._owner, self._stage, self._hears = owner, stage, hears

    @property
    def usable(self) -> bool:
        """Whether its owner is on."""
        return self._owner.enabled

    def focus(self, on):
        """Draw its owner anew, which shows whether it has the keys."""
        self._stage.draw()

    def press(self, key, fine) -> bool:
        """Hand a key on."""
        return self._owner.press(key, fine)

    def overhear(self, key) -> bool:
        """Hand on the one key that it always hears."""
        return key == self._hears and self.usable and self._owner.press(key, False)


class Ring:
    """The controls of a window, one after the other."""

    def __init__(self, interactor):
        self._interactor = interactor
        self._controls: list[Control] = []
        self._tag: int | None = None
        self.current: Control | None = None

    def add(self, control):
        """Put a control behind the others."""
        self._controls.append(control)
        if self._tag is None:
            self._tag = self._interactor.AddObserver('KeyPressEvent', self._on_key, _FIRST)

    def drop(self, control):
        """Take a control out."""
        self.lose(control)
        self._controls.remove(control)
        if not self._controls and self._tag is not None:
            self._interactor.RemoveObserver(self._tag)
            self._tag = None

    def lose(self, control):
        """Take the keys from a control that is off, and tells so itself."""
        if self.current is control:
            self.current = None

    def take(self, control):
        """Give the keys to a control."""
        old, self.current = self.current, control
        if old is control:
            return
        for changed in (old, control):
            if changed is not None:
                changed.focus(changed is control)

    def _on_key(self, interactor, _event):
        key, fine = interactor.GetKeySym() or '', bool(interactor.GetShiftKey())
        tag = self._tag  # a control may take itself out
        command = interactor.GetCommand(tag)
        if self.hear(key, fine) and command is not None:
            command.AbortFlagOn()

    def hear(self, key, fine=False) -> bool:
        """Take a key."""
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
        """Give the keys to the next; after the last nothing has them, so that nobody is caught."""
        ring = [None, *(c for c in self._controls if c.usable)]
        place = ring.index(self.current) if self.current in ring else 0
        self.take(ring[(place + step) % len(ring)])
        return len(ring) > 1
