"""PyVista's exporters, made to write a plotter's plain plotter, since they know only meshes."""

from __future__ import annotations

import warnings
import weakref
from contextlib import contextmanager
from functools import wraps

from pvibr.core.errors import warn
from pvibr.core.plotters import is_closed

#: Methods of plotters that write the scene as data.
EXPORTERS = 'export_gltf', 'export_html', 'export_obj', 'export_vrml', 'export_vtksz'


def export_plain(plotter, ibr):
    """Make a plotter's exporters write its plain plotter if anything must be baked."""
    wrap = _wrapper(weakref.ref(plotter), weakref.ref(ibr))
    for name in EXPORTERS:
        if hasattr(type(plotter), name):
            vars(plotter)[name] = wrap(plotter, name)
    components = vars(plotter).get('_components')
    if type(components) is list:  # PyVista 0.49 adds `pl.trame` there on first access
        vars(plotter)['_components'] = _Components(components, wrap)


class _Components(list):
    """A plotter's components, such as `pl.trame`, with wrapped exporters."""

    def __init__(self, components, wrap):
        super().__init__()
        self._wrap = wrap
        for component in components:
            self.append(component)

    def append(self, component):
        component_type = type(component)
        for name in dir(component_type) if component_type.__name__ == 'TrameComponent' else ():
            if name.startswith('export_'):
                vars(component)[name] = self._wrap(component, name, 'trame')
        super().append(component)


def _wrapper(plotter, ibr):
    """Return a function that wraps an exporter of the plotter or of its attribute."""

    def wrap(owner, name, attribute=None):
        method, owner = getattr(type(owner), name), weakref.ref(owner)

        @wraps(method)
        def export(*args, **kwargs):
            is_closed_plotter = is_closed(plotter())  # PyVista raises its own error
            if is_closed_plotter or not any(
                row.state == 'baked' for row in ibr().web_report().rows
            ):
                with _warnings_at_the_user():
                    return method(owner(), *args, **kwargs)
            plain = ibr().to_plain_plotter()
            try:
                with _warnings_at_the_user():
                    exporter_owner = plain if attribute is None else getattr(plain, attribute)
                    return getattr(exporter_owner, name)(*args, **kwargs)
            finally:
                plain.close()

        return export

    return wrap


@contextmanager
def _warnings_at_the_user():
    """Report PyVista's warnings, such as deprecations, at the user's line."""
    with warnings.catch_warnings(record=True) as recorded:
        warnings.simplefilter('always')
        yield
    for warning in recorded:
        warn(warning.message, warning.category)
