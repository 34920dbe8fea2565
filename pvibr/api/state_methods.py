"""Common base of the parts of ``plotter.ibr``, and state as values and files."""

from __future__ import annotations

from pvibr.core import state_files
from pvibr.core.errors import ClosedError
from pvibr.core.params import params_of
from pvibr.core.plotters import is_closed, renderers_of
from pvibr.core.spelling import Spelled


class Facade(Spelled):
    """A plotter and the pipelines of its subplots.

    Parameters are those of :class:`pvibr.api.plotter_component.IBRComponent`.
    """

    def __init__(self, plotter):
        self._plotter = plotter
        self._pipelines: list = []
        self._closed = False

    @property
    def _is_closed(self) -> bool:
        return self._closed or is_closed(self._plotter)

    def _check_open(self):
        if self._is_closed:
            raise ClosedError('the plotter is closed; create a new one and add to its ibr')

    @property
    def pipeline(self):
        """The active subplot's pipeline."""
        self._check_open()
        return self._pipeline_of(self._plotter.renderer)

    def _pipeline_of(self, renderer):
        """Return a subplot's pipeline, created on first use."""
        raise NotImplementedError

    def _every_pipeline(self) -> list:
        return [self._pipeline_of(renderer) for renderer in renderers_of(self._plotter)]

    def _subplots(self) -> dict:
        """Return the pipelines by subplot index."""
        self._check_open()
        renderers = renderers_of(self._plotter)
        return {renderers.index(p.renderer): p for p in self._pipelines}

    def _all_effects(self) -> list:
        return [effect for pipeline in self._pipelines for effect in pipeline.effects]

    def _show(self, reset_camera=None, render=False):
        """Reset the camera, by default only if it was never set, and optionally render."""
        renderer = self._plotter.renderer
        if reset_camera or (reset_camera is None and not getattr(renderer, 'camera_set', True)):
            self._plotter.reset_camera(render=False)
        if render:
            self._plotter.render()


class _PlotterState:
    """Time and settings of ``plotter.ibr``, with the state methods of an effect."""

    enabled = True

    def __init__(self, facade):
        self._facade = facade

    def state(self):
        names = ('time', *params_of(type(self._facade)))
        return {name: getattr(self._facade, name) for name in names}

    def restore(self, state):
        for name, value in state.items():
            setattr(self._facade, name, value)
        return []


class StateFacade(Facade):
    """Settings of everything in a plotter, as values and as files.

    Parameters are those of :class:`pvibr.api.plotter_component.IBRComponent`.
    """

    @property
    def contents(self) -> dict:
        """Effects and things by subplot index (as text) and by name, as in the state.

        A second one of the same name is called ``'Name 2'``.
        """
        subplots = self._subplots().items()
        return {str(n): state_files.named(p.effects) for n, p in subplots if p.effects}

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
        self._load(text, str(path))

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
        self._load(text, 'the text')

    def _load(self, text, name):
        plotter_state = _PlotterState(self)
        unknown = state_files.load(self.contents, text, name, plotter=plotter_state)
        state_files.warn_of(unknown)
