"""One setting as a control shows it: text, slider stops, and errors of invalid input."""

from __future__ import annotations

from pvibr_widgets.scales import scale_of


class Row:
    """One setting of a thing."""

    def __init__(self, thing, param, size=1.0):
        self.thing, self.param, self.name = thing, param, param.name
        self._refused: tuple = ('', None)
        self.kind = _kind_of(param)
        if self.kind == 'number':
            self._scale = scale_of(param, size)

    # -- what is shown --------------------------------------------------------------------------

    @property
    def value(self):
        """Current value of the setting."""
        return getattr(self.thing, self.name)

    @property
    def label(self) -> str:
        """Name and unit."""
        unit = self.param.unit
        words = self.name.removesuffix(f'_{unit}').replace('_', ' ')
        return f'{words} ({unit})' if unit else words

    @property
    def help(self) -> str:
        """Meaning, allowed values and default, in one line."""
        return self.param.describe()

    @property
    def optional(self) -> bool:
        """Whether it may be None, which is derived from the scene."""
        return self.param.optional

    @property
    def derived(self) -> bool:
        """Whether it is None, derived from the scene."""
        return self.value is None

    @property
    def text(self) -> str:
        """The value as text; empty if derived."""
        return '' if self.derived else text_of(self.value)

    @property
    def scale(self):
        """Scale of the slider; values beyond its ends extend it."""
        if not self.derived:
            self._scale = self._scale.holding(self.value)
        return self._scale

    @property
    def stop(self) -> int:
        """Position of the slider; the middle if the value is derived."""
        scale = self.scale
        return scale.last // 2 if self.derived else scale.stop(self.value)

    @property
    def choices(self) -> list[str]:
        """Labels of the choices."""
        return [text_of(c) or 'none' for c in self.param.choices or ()]

    @property
    def choice(self) -> int:
        """Index of the current choice."""
        return 0 if self.derived else self.param.choices.index(self.value)

    @property
    def color(self) -> str:
        """The colour as ``#rrggbb``."""
        return to_hex(self.value or (0.0, 0.0, 0.0))

    @property
    def error(self) -> str:
        """Error of the last input; empty if it was valid or the value changed since."""
        why, value = self._refused
        return why if value == self.value else ''

    # -- what users do --------------------------------------------------------------------------

    def set(self, value) -> bool:
        """Set the value; return False if it is invalid."""
        try:
            setattr(self.thing, self.name, value)
        except (TypeError, ValueError) as error:
            self._refused = str(error), self.value
            return False
        self._refused = '', None
        return True

    def write(self, text) -> bool:
        """Set the value from text."""
        return self.set(self._parsed(text.strip()))

    def _parsed(self, text):
        try:
            if self.param.kind is tuple:
                return tuple(float(part) for part in text.strip('()[]').split(','))
            return text if self.param.kind is str else self.param.kind(text)
        except ValueError:
            return text  # the setting raises its own error

    def move(self, stop) -> bool:
        """Set the value at a slider stop."""
        # A slider that was not moved keeps a value between two stops.
        if not self.derived and stop == self.stop:
            return self.set(self.value)
        return self.set(self.scale.at(stop))

    def choose(self, index) -> bool:
        """Set the value to a choice by index."""
        if not 0 <= index < len(self.choices):
            return self.set(index)  # an error
        return self.set(self.param.choices[index])

    def paint(self, color) -> bool:
        """Set the colour from ``#rrggbb``."""
        if not self.derived and color == self.color:
            return self.set(self.value)
        return self.set(from_hex(color))

    def derive(self, derived) -> bool:
        """Derive the value from the scene, or set the value shown."""
        if derived == self.derived:
            return True
        return self.set(None if derived else self._shown())

    def _shown(self):
        """Return the value that the control shows while it is derived."""
        if self.kind == 'number':
            return self.scale.at(self.stop)
        if self.kind == 'choice':
            return self.param.choices[0]
        empty = {'switch': False, 'text': '', 'color': (0.0, 0.0, 0.0)}
        return self.param.default or empty.get(self.kind, (0.0, 0.0, 0.0, 1.0))

    def reset(self) -> bool:
        """Restore the default."""
        return self.set(self.param.default)


def _kind_of(param) -> str:
    """Return the kind of control of a setting."""
    if param.choices is not None:
        return 'choice'
    if param.kind is tuple:
        channels = param.default is not None and len(param.default) == 3
        bounds = param.range and (param.range.low, param.range.high)
        return 'color' if channels and bounds == (0, 1) else 'numbers'
    return {bool: 'switch', int: 'number', float: 'number', str: 'text'}[param.kind]


def text_of(value) -> str:
    """Return a value as text for people."""
    if isinstance(value, tuple):
        return ', '.join(map(text_of, value))
    if isinstance(value, float):
        return repr(int(value)) if value == int(value) and abs(value) < 1e6 else repr(value)
    return str(value)


def to_hex(color) -> str:
    """Return a colour as ``#rrggbb``."""
    return '#' + ''.join(f'{round(255 * c):02x}' for c in color)


def from_hex(text) -> tuple[float, float, float] | str:
    """Return the colour of ``#rrggbb``, or the text if it is none."""
    digits = text.removeprefix('#')
    try:
        red, green, blue = bytes.fromhex(digits)
    except ValueError:
        return text
    return round(red / 255, 5), round(green / 255, 5), round(blue / 255, 5)
