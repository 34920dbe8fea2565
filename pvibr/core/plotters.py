"""What pvibr asks of PyVista's plotters that has no public name."""

from __future__ import annotations

import sys


def is_closed(plotter) -> bool:
    """Return True if a plotter was closed."""
    return getattr(plotter, '_closed', False)


def is_never_shown(plotter) -> bool:
    """Return True if a plotter still has to set up its camera and window."""
    return getattr(plotter, '_first_time', False)


def renderers_of(plotter) -> list:
    """Return the renderers of a plotter's subplots, in order."""
    return list(getattr(plotter, 'renderers', [plotter.renderer]))


def frame_callbacks(plotter) -> list:
    """Return what a plotter calls after each frame, such as trame views."""
    return list(getattr(plotter, '_on_render_callbacks', ()))


def border_of(renderer):
    """Return the actor of a subplot's border, or None."""
    return getattr(renderer, '_border_actor', None)


def trame_viewer(plotter):
    """Return the trame viewer of a plotter that can switch between server and client, or None."""
    ui = sys.modules.get('trame_pyvista.ui') or sys.modules.get('pyvista.trame.ui')
    viewer = getattr(ui, '_VIEWERS', {}).get(getattr(plotter, '_id_name', None))
    return viewer if hasattr(viewer, 'SERVER_RENDERING') else None
