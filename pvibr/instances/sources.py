"""The meshes that instances were made of, and whether they have changed since."""

from __future__ import annotations

from functools import partial

import pyvista as pv

from pvibr.core import _vtk
from pvibr.instances.levels import content_key

#: Why a mesh is drawn as it is once it has changed.
MESH_CHANGED = 'its mesh was changed since; bake() shows images again'


class Sources:
    """Meshes as they were given, and how their parts are made."""

    def __init__(self, meshes, parts_of, parts):
        self._meshes, self._parts_of = meshes, parts_of
        self._times = [_times_of(mesh) for mesh in meshes]
        # Of now: parts share arrays with what they are made of.
        pairs = zip(parts, self._times, strict=True)
        self._keys = [content_key(found) if times else '' for found, times in pairs]

    def ask(self, **look):
        """Ask for another look of the meshes when they change."""
        self._parts_of = partial(self._parts_of, **look)

    def changed(self) -> dict[int, list]:
        """Return the new parts of meshes whose points, cells or shown arrays have changed."""
        found: dict[int, list] = {}
        times = [_times_of(mesh) for mesh in self._meshes]
        if times == self._times:
            return found
        keys = list(self._keys)
        for k, mesh in enumerate(self._meshes):
            if times[k] != self._times[k]:
                parts = self._parts_of(mesh)
                keys[k] = content_key(parts)
                if keys[k] != self._keys[k]:
                    found[k] = parts
        self._times, self._keys = times, keys
        return found


def _times_of(mesh) -> tuple:
    """Return VTK's times of the last changes of all in a dataset, none for what tells none."""
    if isinstance(mesh, _vtk.vtkActor):
        mapper = mesh.GetMapper()
        return mapper.GetMTime(), *_times_of(mapper.GetInputDataObject(0, 0))
    if isinstance(mesh, pv.MultiBlock):
        return tuple(block.GetMTime() for block in mesh.recursive_iterator(skip_none=True))
    return (mesh.GetMTime(),) if isinstance(mesh, _vtk.vtkDataObject) else ()
