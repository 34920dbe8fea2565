"""The toolkit-independent model of a control panel."""

from __future__ import annotations

import contextlib
import math
import re
import warnings

from pvibr.api.plain_renderer import attach
from pvibr.core.errors import ClosedError, PvibrWarning
from pvibr.core.observers import weakly
from pvibr.core.params import params_of
from pvibr_widgets.presets import Presets
from pvibr_widgets.python_code import code_of
from pvibr_widgets.rows import Row

_MOST_OPEN = 3  # groups that are expanded at first


class Group:
    """An effect or a thing, with a row for each of its settings."""

    def __init__(self, key, name, thing, place, presets, is_open=True):
        self.key, self.name, self.thing, self._presets = key, name, thing, presets
        self.is_open = is_open
        self.title = place + _in_words(name, type(thing).__name__)
        size = _size_of(thing.pipeline.renderer)
        self.rows = [Row(thing, p, size) for p in params_of(type(thing)).values()]

    @property
    def enabled(self) -> bool:
        """Whether the effect is enabled."""
        return self.thing.enabled

    @property
    def why(self) -> str:
        """Error for which the pipeline disabled the effect; empty if none."""
        pipeline = self.thing.pipeline
        if self.enabled or pipeline is None:
            return ''
        rows = zip(pipeline.effects, pipeline.report().rows, strict=True)
        said = next(row.why for effect, row in rows if effect is self.thing)
        return '' if said == 'enabled is False' else said

    def switch(self, on):
        """Enable or disable the effect."""
        self.thing.enabled = bool(on)

    def remove(self):
        """Remove the effect from its subplot."""
        if self.thing.pipeline is not None:
            self.thing.pipeline.remove(self.thing)

    @property
    def presets(self) -> list[str]:
        """Names of presets, the defaults first."""
        return self._presets.names(self.thing)

    def apply(self, preset):
        """Apply a preset."""
        self._presets.apply(self.thing, preset)

    def keep(self, preset):
        """Save the settings as a user preset."""
        self._presets.keep(self.thing, preset)

    def forget(self, preset):
        """Delete a user preset."""
        self._presets.forget(self.thing, preset)


class Model:
    """The contents of a plotter as groups of rows, and the actions of a panel.

    The model follows the plotter: effects that code adds, removes or changes are updated with the
    next frame, or by `refresh`.

    Parameters
    ----------
    plotter : pyvista.BasePlotter or vtkRenderer
        Plotter with ``plotter.ibr``, or renderer for :func:`pvibr.attach`.
    presets : Presets, optional
        Presets; those of the user's file by default.

    Attributes
    ----------
    groups : list of Group
        Effects and things.
    own : list of Row
        Settings of the plotter itself.
    message : str
        Result of the last action.

    Examples
    --------
    >>> import pvibr
    >>> import pyvista as pv
    >>> pl = pv.Plotter(off_screen=True)
    >>> bloom = pl.ibr.add(pvibr.Bloom())
    >>> model = Model(pl)
    >>> [group.title for group in model.groups]
    ['Bloom']
    >>> model.do(model.groups[0].apply, 'strong')
    >>> bloom.intensity
    2.0
    >>> pl.close()
    >>> model.groups, model.message
    ([], 'the plotter is closed')
    """

    def __init__(self, plotter, *, presets=None):
        self.plotter = plotter
        self.ibr = plotter.ibr if hasattr(plotter, 'ibr') else attach(plotter)
        self.groups: list[Group] = []
        self.own = [Row(self.ibr, param) for param in params_of(type(self.ibr)).values()]
        self.message = ''
        self._presets = Presets() if presets is None else presets
        self._listeners: list = []
        self._shown: tuple = ()
        self._is_doing = False
        self._tags: list = []
        self._watch()
        self.refresh()

    # -- following the plotter ------------------------------------------------------------------

    def _watch(self):
        """Refresh after each frame and when the plotter closes, as long as someone holds this."""
        look = weakly(self.refresh)
        self.ibr.on_close(look)
        self.each_frame(look)

    def each_frame(self, tell):
        """Call a function after each frame of the window, until this is closed.

        Parameters
        ----------
        tell : callable
            Takes the window and the name of the event.
        """
        window = self._window
        if window is not None:
            self._tags.append((window, window.AddObserver('EndEvent', tell)))

    @property
    def _window(self):
        if hasattr(self.plotter, 'ibr'):
            return self.plotter.render_window
        return self.plotter.GetRenderWindow()

    def close(self):
        """Stop following the plotter; calling it again is fine."""
        while self._tags:
            window, tag = self._tags.pop()
            window.RemoveObserver(tag)
        self._listeners = []

    def listen(self, tell):
        """Call a function after each change of the panel.

        Parameters
        ----------
        tell : callable
            Takes whether there are other groups than before.
        """
        self._listeners.append(tell)

    def refresh(self):
        """Read the plotter, and notify listeners of changes."""
        if self._is_doing:
            return
        before = {(g.key, g.name, id(g.thing)): g for g in self.groups}
        now = {
            (key, name, id(thing)): thing
            for key, named in self._contents().items()
            for name, thing in named.items()
        }
        rebuilt = [*before] != [*now]
        if rebuilt:
            is_open = len(now) <= _MOST_OPEN
            self.groups = [
                before.get(at) or Group(*at[:2], thing, self._place(at[0]), self._presets, is_open)
                for at, thing in now.items()
            ]
        looks = [(_look_of(g.thing, g.rows), g.thing.enabled) for g in self.groups]
        shown = self.message, _look_of(self.ibr, self.own), looks
        if rebuilt or shown != self._shown:
            self._shown = shown
            for tell in list(self._listeners):
                tell(rebuilt)

    def _contents(self) -> dict:
        try:
            return self.ibr.contents
        except ClosedError:
            self.message = 'the plotter is closed'
            return {}

    def _place(self, key) -> str:
        """Return row and column of a subplot as text, if there are several."""
        place_of = self._place_of()
        if place_of is None:
            return ''
        place = place_of(int(key))
        return ', '.join(str(int(i)) for i in _as_tuple(place)) + ': '

    def _place_of(self):
        renderers = getattr(self.plotter, 'renderers', ())
        return getattr(renderers, 'index_to_loc', None) if len(renderers) > 1 else None

    # -- what users do --------------------------------------------------------------------------

    def do(self, action, *args):
        """Perform an action of a control, render, and update the panel.

        Parameters
        ----------
        action : callable
            See :meth:`act`.
        *args
            Its arguments.
        """
        self.act(action, *args)
        self.show()

    def act(self, action, *args):
        """Perform an action of a control; `show` renders it.

        Parameters
        ----------
        action : callable
            Such as a method of a row or a group. Where it raises because of what it was given,
            why is in `message`; so is what pvibr warns of.
        *args
            Its arguments.
        """
        self.message = ''
        with self._hearing():
            action(*args)

    def show(self):
        """Render the plotter, unless it is closed, and notify listeners."""
        if self._window is not None:
            draw = getattr(self.plotter, 'render', None) or self._window.Render
            with self._hearing():
                draw()
        self._shown = ()  # what was typed and refused is to be put back too
        self.refresh()

    @contextlib.contextmanager
    def _hearing(self):
        """Keep warnings of pvibr as the message; notify listeners once afterwards."""
        self._is_doing = True
        try:
            with warnings.catch_warnings(record=True) as said:
                warnings.simplefilter('always', PvibrWarning)
                yield
        except (TypeError, ValueError, OSError, ClosedError) as error:
            self.message = str(error)
        finally:
            self._is_doing = False
        for warning in said:
            if issubclass(warning.category, PvibrWarning):
                self.message = self.message or str(warning.message)
            else:
                warnings.warn_explicit(
                    warning.message, warning.category, warning.filename, warning.lineno
                )

    def reset(self):
        """Reset all settings."""
        for row in self.own:
            row.reset()
        for group in self.groups:
            group.apply('defaults')

    def code(self) -> str:
        """Return Python that gives another plotter the same effects and settings.

        Returns
        -------
        str
            See :func:`pvibr_widgets.python_code.code_of`.
        """
        own = {row.name: row.value for row in self.own if row.value != row.param.default}
        if self.ibr.time:
            own['time'] = self.ibr.time
        return code_of(self._contents(), own, self._place_of())

    def save(self, path):
        """Write all settings to a file, see ``pl.ibr.save_state``.

        Parameters
        ----------
        path : str
            Where to.
        """
        self.ibr.save_state(_named(path))
        self.message = f'saved to {path}'

    def load(self, path):
        """Set all settings to those of a file, see ``pl.ibr.load_state``.

        Parameters
        ----------
        path : str
            The file.
        """
        self.ibr.load_state(_named(path))


def _in_words(name, kind) -> str:
    """Return the name of an effect in words where it is that of its class: "Depth of field"."""
    if not name.startswith(kind):
        return name
    words = re.sub(r'(?<=[a-z])(?=[A-Z])', ' ', kind)
    return words[:1] + words[1:].lower() + name.removeprefix(kind)


def _look_of(owner, rows) -> tuple:
    """Return a key that changes with the shown settings."""
    return id(owner), getattr(owner, 'revision', 0), *(row.error for row in rows)


def _size_of(renderer) -> float:
    """Return the diagonal of a scene, 1 if it is empty."""
    bounds = renderer.ComputeVisiblePropBounds()
    size = math.dist(bounds[::2], bounds[1::2])
    return size if bounds[0] <= bounds[1] and 0 < size < math.inf else 1.0


def _as_tuple(place):
    return tuple(place) if hasattr(place, '__len__') else (place,)


def _named(path):
    if not str(path).strip():
        raise ValueError('path is empty: write the name of a file')
    return path
