"""PyVista's exporters, which know meshes: those of a plotter are given its plain plotter."""

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
    """Have the exporters of a plotter write what is baked into a plain one."""
    wrap = _wrapper(weakref.ref(plotter), weakref.ref(ibr))
    for name in EXPORTERS:
        if hasattr(type(plotter), name):
            vars(plotter)[name] = wrap(plotter, name)
    components = vars(plotter).get('_components')
    if type(components) is list:  # PyVista 0.49 has `pl.trame` there once it is asked for
        vars(plotter)['_components'] = _Components(components, wrap)


class _Components(list):
    """What is registered on a plotter, such as `pl.trame`; its exporters are wrapped."""

    def __init__(self, found, wrap):
        super().__init__()
        self._wrap = wrap
        for component in found:
            self.append(component)

    def append(self, component):
        kind = type(component)
        for name in dir(kind) if kind.__name__ == 'TrameComponent' else ():
            if name.startswith('export_'):
                vars(component)[name] = self._wrap(component, name, 'trame')
        super().append(component)


def _wrapper(plotter, ibr):
    """Return a function that wraps an exporter of an owner: the plotter, or its attribute."""

    def wrap(owner, name, at=None):
        method, owner = getattr(type(owner), name), weakref.ref(owner)

        @wraps(method)
        def export(*args, **kwargs):
            closed = is_closed(plotter())  # PyVista says so in its own words
            if closed or not any(row.state == 'baked' for row in ibr().web_report().rows):
                with _warnings_at_the_user():
                    return method(owner(), *args, **kwargs)
            plain = ibr().to_plain_plotter()
            try:
                with _warnings_at_the_user():
                    exporting = plain if at is None else getattr(plain, at)
                    return getattr(exporting, name)(*args, **kwargs)
            finally:
                plain.close()

        return export

    return wrap


@contextmanager
def _warnings_at_the_user():
    """Have PyVista's warnings, such as of deprecation, at the user's line."""
    with warnings.catch_warnings(record=True) as seen:
        warnings.simplefilter('always')
        yield
    for found in seen:
        warn(found.message, found.category)
