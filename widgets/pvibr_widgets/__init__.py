"""Control panels for what pvibr draws: in notebooks, in trame applications and in Qt windows.

A panel has a row for each setting of whatever is in the plotter, and follows it. Handles are in
the scene itself.

Examples
--------
>>> import pvibr_widgets
>>> pvibr_widgets.Presets().path.name
'presets.json'
"""

from __future__ import annotations

from pvibr import lazy_exports

_EXPORTS = {
    'Model': 'pvibr_widgets.model',
    'Presets': 'pvibr_widgets.presets',
    'light_handles': 'pvibr_widgets.handles_light',
    'menu_item': 'pvibr_widgets.pages',
    'notebook_panel': 'pvibr_widgets.notebook',
    'page_keys': 'pvibr_widgets.handles_pages',
    'panel': 'pvibr_widgets.choice',
    'pick_focus': 'pvibr_widgets.handles_focus',
    'projector_handles': 'pvibr_widgets.handles_projector',
    'qt_dock': 'pvibr_widgets.qt',
    'time_bar': 'pvibr_widgets.handles_time',
    'trame_panel': 'pvibr_widgets.pages',
}

__all__ = [*_EXPORTS]  # noqa: PLE0604, RUF100
__getattr__, __dir__ = lazy_exports(__name__, _EXPORTS)
