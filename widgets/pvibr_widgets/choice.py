"""The control panel for the current environment."""

from __future__ import annotations

import sys


def panel(plotter, **settings):
    """Return a control panel for the current environment.

    Within the layout of a trame page, the panel becomes part of the page; a plotter in a Qt window
    gets a dock; in a notebook, the panel is the output of the cell.

    Parameters
    ----------
    plotter : pyvista.BasePlotter
        Plotter to control.
    **settings
        Arguments of :func:`trame_panel`, :func:`qt_dock` or :func:`notebook_panel`.

    Returns
    -------
    object
        Result of that function.

    Raises
    ------
    RuntimeError
        If there is no page, Qt window or notebook.
    TypeError
        If an argument is unknown.

    Examples
    --------
    >>> import pyvista as pv
    >>> pl = pv.Plotter(off_screen=True)
    >>> panel(pl)
    Traceback (most recent call last):
    RuntimeError: no page, Qt window or notebook to put a panel into: call trame_panel, qt_dock ...
    """
    if _is_laid_out():
        from pvibr_widgets.pages import trame_panel

        return trame_panel(plotter, **settings)
    if hasattr(plotter, 'app_window') or _is_qt_widget(plotter):
        from pvibr_widgets.qt import qt_dock

        return qt_dock(plotter, **settings)
    if _is_notebook():
        from pvibr_widgets.notebook import notebook_panel

        return notebook_panel(plotter, **settings)
    raise RuntimeError(
        'no page, Qt window or notebook to put a panel into: call trame_panel, qt_dock or '
        'notebook_panel of pvibr_widgets yourself'
    )


def _is_laid_out() -> bool:
    """Return True during the layout of a trame page, when a parent element is open."""
    core = sys.modules.get('trame_client.widgets.core')
    return core is not None and bool(core.HTML_CTX.element_stack)


def _is_qt_widget(plotter) -> bool:
    return 'qtpy' in sys.modules and hasattr(plotter, 'windowHandle')


def _is_notebook() -> bool:
    """Return True in a Jupyter kernel."""
    ipython = sys.modules.get('IPython')
    shell = None if ipython is None else ipython.get_ipython()
    return shell is not None and hasattr(shell, 'kernel')
