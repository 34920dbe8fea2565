"""The meshes that instances were made of, and whether they have changed since."""

from __future__ import annotations

import pyvista as pv

from pvibr.core import _vtk
from pvibr.instances.levels import content_key

#: Why a mesh is drawn as it is once it has changed.
MESH_CHANGED = 'its mesh was changed since; bake() shows images again'


class Sources:
    """Meshes as they were given, and how their parts are made."""

    def __init__(self, meshes, parts_of, parts):
        self._meshes, self._parts_of = meshes, parts_of
        self._times = [_time_of(mesh) for mesh in meshes]
        # Of now: parts share arrays with what they are made of.
        self._keys = [_key_of(p) if t else '' for p, t in zip(parts, self._times, strict=True)]

    def changed(self) -> dict[int, list]:
        """Return the new parts of meshes whose points, cells or shown arrays have changed."""
        found = {}
        for k, mesh in enumerate(self._meshes):
            time = _time_of(mesh)
            if time == self._times[k]:
                continue
            self._times[k] = time
            parts = self._parts_of(mesh)
            key = _key_of(parts)
            if key != self._keys[k]:
                self._keys[k], found[k] = key, parts
        return found


def _key_of(parts) -> str:
    return content_key(parts)


def _time_of(mesh) -> int:
    """Return VTK's time of the last change of a dataset, 0 for what tells none."""
    if isinstance(mesh, _vtk.vtkActor):
        mapper = mesh.GetMapper()
        return max(mapper.GetMTime(), _time_of(mapper.GetInputDataObject(0, 0)))
    if isinstance(mesh, pv.MultiBlock):
        blocks = mesh.recursive_iterator(skip_none=True)
        return max((block.GetMTime() for block in blocks), default=0)
    return mesh.GetMTime() if isinstance(mesh, _vtk.vtkDataObject) else 0
