"""State as values and as files: methods of ``plotter.ibr``."""

from __future__ import annotations

from pvibr.core import state_files
from pvibr.core.params import params_of


class _PlotterState:
    """Time and settings of ``plotter.ibr``, with the state methods of an effect."""

    enabled = True

    def __init__(self, component):
        self._component = component

    def state(self):
        names = ('time', *params_of(type(self._component)))
        return {name: getattr(self._component, name) for name in names}

    def restore(self, state):
        for name, value in state.items():
            setattr(self._component, name, value)
        return []


def state(self) -> dict:
    """Return the time and the settings of everything in every subplot, as JSON values."""
    return state_files.state_of(self.contents, _PlotterState(self).state())


def restore(self, state):
    """Apply settings that :meth:`state` returned: all of them or none.

    Parameters
    ----------
    state : dict
        Settings; a warning lists unknown names.

    Raises
    ------
    TypeError, ValueError
        If a value is not allowed.
    """
    state_files.warn_of(state_files.restore(self.contents, state, plotter=_PlotterState(self)))


def save_state(self, path):
    """Write the settings of everything in every subplot to a JSON file.

    Parameters
    ----------
    path : str or os.PathLike
        The file, in an existing folder; an existing file is replaced once the new one is
        complete.

    Raises
    ------
    OSError
        If the folder does not exist or is not writable; an existing file is unchanged.

    Examples
    --------
    >>> import pathlib, tempfile
    >>> import pvibr
    >>> import pyvista as pv
    >>> pl = pv.Plotter(off_screen=True)
    >>> bloom = pl.ibr.add(pvibr.Bloom(threshold=0.5))
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     pl.ibr.save_state(pathlib.Path(folder) / 'bright.json')
    ...     bloom.threshold = 0.9
    ...     pl.ibr.load_state(pathlib.Path(folder) / 'bright.json')
    >>> bloom.threshold
    0.5
    >>> pl.close()
    """
    state_files.write(path, state_files.to_text('state', self.state()))


def load_state(self, path):
    """Apply settings from a file that :meth:`save_state` wrote.

    A warning lists unknown names and, in a file of another version of pvibr, invalid values.

    Parameters
    ----------
    path : str or os.PathLike
        The file.

    Raises
    ------
    OSError
        If it cannot be read.
    TypeError, ValueError
        If it is not a state file, or a value is not allowed; nothing is changed.
    """
    text = state_files.read(path)
    _load(self, text, str(path))


def load_state_text(self, text):
    """Apply settings from the text of a state file, see :meth:`load_state`.

    Parameters
    ----------
    text : str or bytes
        The content of the file.

    Raises
    ------
    TypeError, ValueError
        If it is not a state file, or a value is not allowed; nothing is changed.
    """
    _load(self, text, 'the text')


def _load(self, text, name):
    plotter_state = _PlotterState(self)
    unknown = state_files.load(self.contents, text, name, plotter=plotter_state)
    state_files.warn_of(unknown)
