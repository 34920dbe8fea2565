"""The same as ``plotter.ibr`` for a renderer without a plotter."""

from __future__ import annotations

import atexit
import weakref

from pvibr.api.plotter_component import IBRComponent

_attached: weakref.WeakValueDictionary = weakref.WeakValueDictionary()


class _Host:
    """What a component asks of a plotter, for a renderer without one."""

    def __init__(self, renderer):
        self.renderer = renderer
        self._on_render_callbacks: set = set()  # as a plotter's: see `frame_callbacks`

    def show_by(self, draw):
        self._on_render_callbacks = {lambda _: draw()}

    def reset_camera(self, *, render=False):
        self.renderer.ResetCamera()

    def render(self):
        if not self._on_render_callbacks:
            self.renderer.GetRenderWindow().Render()
        for tell in self._on_render_callbacks:
            tell(self)


class _Attached(IBRComponent):
    """A component of a plain renderer."""

    def __init__(self, renderer):
        super().__init__(_Host(renderer))
        # An observer keeps the component as long as the renderer lives, in a way that Python's
        # collector of cycles sees, unlike an attribute of a VTK object.
        renderer.AddObserver('DeleteEvent', self._on_deleted)

    def _on_deleted(self, *_):
        self._closed = True  # too late to release: asking a dying window for its context crashes

    def serves(self, renderer) -> bool:
        """Return True if it is open and of this renderer, not of one that had its address."""
        return not self._closed and self._plotter.renderer is renderer

    def show_by(self, draw):
        """Draw by a function instead of the window's Render."""
        self._plotter.show_by(draw)


def attach(renderer, draw=None) -> IBRComponent:
    """Return ``ibr`` for a plain renderer: VTK scripts, Qt windows, trame applications.

    Parameters
    ----------
    renderer : vtkRenderer
        The renderer; a second call returns the same component.
    draw : callable, optional
        Function that draws and shows a frame, such as the ``update`` of a trame view; by default
        the window's ``Render``. A later call may set it.

    Returns
    -------
    IBRComponent
        Close it before the window, or use it as a context manager. Components still open at the
        end of the program are closed then.

    Raises
    ------
    TypeError
        If `renderer` is not a renderer, or `draw` is not callable.

    Examples
    --------
    >>> from pvibr import attach
    >>> from pvibr.core import _vtk
    >>> window = _vtk.vtkRenderWindow()
    >>> renderer = _vtk.vtkRenderer()
    >>> window.AddRenderer(renderer)
    >>> with attach(renderer) as ibr:
    ...     ibr.effects
    ()
    """
    if not (hasattr(renderer, 'IsA') and renderer.IsA('vtkRenderer')):
        raise TypeError(
            f'renderer must be a vtkRenderer, got {renderer!r}; a plotter has its own plotter.ibr'
        )
    if draw is not None and not callable(draw):
        raise TypeError(
            f'draw must be a function without arguments, such as view.update, got {draw!r}'
        )
    component = _attached.get(id(renderer))
    if component is None or not component.serves(renderer):
        component = _attached[id(renderer)] = _Attached(renderer)
    if draw is not None:
        component.show_by(draw)
    return component


@atexit.register
def _close_all():
    for component in list(_attached.values()):
        component.close()
