"""The user's meshes of instances, and whether they have changed since."""

from __future__ import annotations

from functools import partial

import pyvista as pv

from pvibr.core import _vtk
from pvibr.core._vtk import method
from pvibr.instances.levels import content_key

#: Why a mesh has no images once it has changed.
MESH_CHANGED = 'its mesh has changed since the bake; bake() makes images again'


class Sources:
    """Meshes as passed by the user, and how to make their parts."""

    def __init__(self, meshes, parts_of, parts):
        self._meshes, self._parts_of = meshes, parts_of
        #: Functions that return each mesh's times.
        self.time_getters = [_getter_of_times(mesh) for mesh in meshes]
        self._times = [get() for get in self.time_getters]
        # Computed now: parts share arrays with their meshes.
        pairs = zip(parts, self._times, strict=True)
        self._keys = [content_key(mesh_parts) if times else '' for mesh_parts, times in pairs]

    def set_look(self, **look):
        """Set keywords of the look that changed meshes get."""
        self._parts_of = partial(self._parts_of, **look)

    def changed(self) -> dict[int, list]:
        """Return the new parts of meshes whose points, cells or shown arrays have changed."""
        changed_parts: dict[int, list] = {}
        times = [get() for get in self.time_getters]
        if times == self._times:
            return changed_parts
        keys = list(self._keys)
        for k, mesh in enumerate(self._meshes):
            if times[k] != self._times[k]:
                parts = self._parts_of(mesh)
                keys[k] = content_key(parts)
                if keys[k] != self._keys[k]:
                    changed_parts[k] = parts
        self._times, self._keys = times, keys
        return changed_parts


def _getter_of_times(mesh):
    """Return what returns VTK's modification times of a mesh, quickly for a dataset."""
    if isinstance(mesh, _vtk.vtkDataSet):
        return method(mesh, 'GetMTime')
    return partial(_times_of, mesh)


def _times_of(mesh) -> tuple:
    """Return VTK's modification times of a dataset, none if it has none."""
    if isinstance(mesh, _vtk.vtkActor):
        mapper = mesh.GetMapper()
        return mapper.GetMTime(), *_times_of(mapper.GetInputDataObject(0, 0))
    if isinstance(mesh, pv.MultiBlock):
        return tuple(block.GetMTime() for block in mesh.recursive_iterator(skip_none=True))
    return (mesh.GetMTime(),) if isinstance(mesh, _vtk.vtkDataObject) else ()
