"""PyVista's exporters, made to write a plotter's plain plotter, since they know only meshes."""

from __future__ import annotations

import warnings
import weakref
from contextlib import contextmanager
from functools import wraps

from pvibr.core.errors import warn
from pvibr.core.hooks import Hooks
from pvibr.core.plotters import is_closed

#: Methods of plotters that write the scene as data.
EXPORTERS = 'export_gltf', 'export_html', 'export_obj', 'export_vrml', 'export_vtksz'


def plain_exporters(plotter, ibr) -> dict:
    """Return by name the exporters of a plotter; they write what is baked into a plain one."""
    wrap = _wrapper(weakref.ref(plotter), weakref.ref(ibr))
    names = [name for name in EXPORTERS if hasattr(type(plotter), name)]
    exporters = {name: wrap(plotter, name) for name in names}
    components = vars(plotter).get('_components')
    if type(components) is list:  # PyVista 0.49 has `pl.trame` there once it is asked for
        exporters['_components'] = _Components(components, wrap)
    return exporters


class _Components(list):
    """The components of a plotter, such as `pl.trame`, whose exporters are wrapped."""

    def __init__(self, components, wrap):
        super().__init__(components)
        self._components, self._wrap, self._hooks = components, wrap, []
        for component in components:
            self._hook(component)

    def append(self, component):
        self._components.append(component)
        super().append(component)
        self._hook(component)

    def _hook(self, component):
        kind = type(component)
        if kind.__name__ == 'TrameComponent':
            names = [name for name in dir(kind) if name.startswith('export_')]
            hooks = Hooks(component)
            hooks.put({name: self._wrap(component, name, 'trame') for name in names})
            self._hooks.append(hooks)

    def take_off(self):
        """Leave the exporters of the components as they were."""
        for hooks in self._hooks:
            hooks.take_off()


def release_exporters(plotter):
    """Leave the exporters of a plotter's components as they were."""
    components = vars(plotter).get('_components')
    if isinstance(components, _Components):
        components.take_off()


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
