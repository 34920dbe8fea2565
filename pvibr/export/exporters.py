"""PyVista's exporters, which know meshes: those of a plotter are given its plain plotter."""

from __future__ import annotations

import weakref
from functools import wraps

#: Methods of plotters that write the scene as data.
EXPORTERS = 'export_gltf', 'export_html', 'export_obj', 'export_vrml', 'export_vtksz'


def export_plain(plotter, ibr):
    """Have the exporters of a plotter write what is baked into a plain one."""
    for name in EXPORTERS:
        if hasattr(type(plotter), name):
            vars(plotter)[name] = _exporter(name, weakref.ref(plotter), weakref.ref(ibr))


def _exporter(name, plotter, ibr):
    method = getattr(type(plotter()), name)

    @wraps(method)
    def export(*args, **kwargs):
        if not any(row.state == 'baked' for row in ibr().web_report().rows):
            return method(plotter(), *args, **kwargs)
        plain = ibr().to_plain_plotter()
        try:
            return getattr(plain, name)(*args, **kwargs)
        finally:
            plain.close()

    return export
