"""Forwarding of key events from web pages to controls in the scene."""

from __future__ import annotations

from pvibr_widgets.handles_stage import Stage

#: What browsers call a key, and what windows do.
_NAMES = {
    'ArrowLeft': 'Left',
    'ArrowRight': 'Right',
    'ArrowUp': 'Up',
    'ArrowDown': 'Down',
    'PageUp': 'Prior',
    'PageDown': 'Next',
    ' ': 'space',
    ',': 'comma',
    '.': 'period',
}


def page_keys(pl) -> dict:
    """Return the arguments of a trame view that forward key events to handles and bars.

    By itself such a view tells of mouse and fingers only. In a page Tab goes on to
    what else is there; full stop and comma go from one handle to the next or previous.

    Parameters
    ----------
    pl : pyvista.BasePlotter
        Whose pictures come from a server.

    Returns
    -------
    dict
        Arguments for ``plotter_ui(pl, mode='server', **page_keys(pl))``.

    Raises
    ------
    TypeError, ValueError
        If it is no plotter, or has no interactor.
    ClosedError
        If the plotter is closed.

    Examples
    --------
    >>> import pyvista as pv
    >>> import pvibr_widgets
    >>> pl = pv.Plotter(off_screen=True)
    >>> sorted(pvibr_widgets.page_keys(pl))
    ['KeyDown', 'interactor_events']
    >>> pl.close()
    """
    ring = Stage(pl).ring

    def hear(event):
        key = event.get('key') or ''
        ring.hear(_NAMES.get(key, key), bool(event.get('shiftKey')))

    return {
        'interactor_events': (f'pvibr_keys_{id(ring):x}', ['KeyDown']),
        'KeyDown': (hear, '[utils.vtk.event($event)]'),
    }
