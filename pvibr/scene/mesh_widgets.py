"""PyVista's widgets that cut meshes refuse things with a helpful error."""

from __future__ import annotations

import weakref
from functools import wraps

from pvibr.scene.thing import Thing

#: Plotter methods that cut a mesh.
MESH_WIDGETS = (
    'add_mesh_clip_plane',
    'add_mesh_clip_box',
    'add_mesh_slice',
    'add_mesh_slice_orthogonal',
    'add_mesh_slice_spline',
    'add_mesh_threshold',
    'add_mesh_isovalue',
)


def refuse_things(plotter):
    """Let a plotter's mesh-cutting widgets raise a helpful error for things."""
    for method_name in MESH_WIDGETS:
        if hasattr(type(plotter), method_name):
            vars(plotter)[method_name] = _widget(method_name, weakref.ref(plotter))


def _widget(name, plotter):
    method = getattr(type(plotter()), name)

    @wraps(method)
    def widget(mesh, *args, **kwargs):
        if isinstance(mesh, Thing):
            raise TypeError(
                f'{name} cuts meshes, and {mesh.name} is not one; clip it by '
                'handle.mapper.AddClippingPlane(plane), and move the plane in the callback of '
                'plotter.add_plane_widget'
            )
        return method(plotter(), mesh, *args, **kwargs)

    return widget
