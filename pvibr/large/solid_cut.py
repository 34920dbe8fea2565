"""The triangles of a cut as an actor that is in no scene, for shadow volumes and rays."""

from __future__ import annotations

import numpy as np
import pyvista as pv

from pvibr.core import _vtk
from pvibr.large.cut import gathered


class SolidCut:
    """An actor with the triangles of patches, and nothing else of them."""

    def __init__(self):
        self.actor, self._mapper = pv.Actor(), _vtk.vtkPolyDataMapper()
        self.actor.SetMapper(self._mapper)
        self._key: bytes | None = None
        self._hierarchy = None

    def show(self, hierarchy, patches):
        """Let it be of some patches."""
        key = patches.tobytes()
        if key == self._key and hierarchy is self._hierarchy:
            return
        self._key, self._hierarchy = key, hierarchy
        vertices, triangles = gathered(hierarchy, patches)
        used, places = np.unique(vertices, return_inverse=True)  # patches share their borders
        points = hierarchy.points[used] + hierarchy.origin
        mesh = pv.PolyData.from_regular_faces(points, places[triangles].astype(np.int64))
        self._mapper.SetInputDataObject(mesh)
