"""PyVista's widgets that cut meshes refuse things with a helpful error."""

from __future__ import annotations

import weakref
from functools import wraps

from pvibr.things.thing import Thing

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


def mesh_widgets(plotter) -> dict:
    """Return by name the widgets of a plotter that cut meshes; of things they say what to do."""
    names = [name for name in MESH_WIDGETS if hasattr(type(plotter), name)]
    return {name: _widget(name, weakref.ref(plotter)) for name in names}


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
