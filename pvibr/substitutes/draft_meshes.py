"""Coarser meshes of actors that moving planes cut, by averages of points within bins."""

from __future__ import annotations

import numpy as np
import pyvista as pv

from pvibr.core import _vtk
from pvibr.gl.feature import replacements
from pvibr.meshes.surfaces import triangles_of
from pvibr.things.clipping import set_planes

# Side of a bin in units of the allowed error: averaged points stay near a surface that is smooth.
_BIN = 2.0
# Largest share of the triangles at which a draft is worth its memory.
_WORTHWHILE = 0.6
_MOST_BINS = 2**24
_STEPS = 4  # per doubling of the bins
_AVERAGES = _vtk.vtkBinnedDecimation.BIN_AVERAGES


class DraftMesh:
    """A mapper for the coarser mesh of an actor."""

    def __init__(self):
        self._key: tuple = ()
        self._mapper = None

    def mapper_of(self, actor, allowed_error):
        """Return a mapper within an error in world units, None if the actor has to draw itself."""
        if actor.GetTexture() is not None or replacements(actor.GetShaderProperty()):
            return None  # seams, and effects that set values of the mapper's own program
        mapper = actor.GetMapper()
        world_from_model = pv.array_from_vtkmatrix(actor.GetMatrix())[:3, :3]
        bin_side = _BIN * allowed_error / max(float(np.linalg.norm(world_from_model, 2)), 1e-300)
        # In steps, so that a camera that moves changes it seldom.
        bin_step = int(np.floor(_STEPS * np.log2(max(bin_side, 1e-300))))
        data = mapper.GetInput()
        key = mapper, mapper.GetMTime(), data, data.GetMTime(), bin_step
        if key != self._key:
            self.release(None)
            self._key = key
            draft = _binned(data, 2.0 ** (bin_step / _STEPS))
            self._mapper = None if draft is None else _copied(mapper, draft)
        return self._mapper

    def release(self, window):
        """Free GPU memory; the context is current."""
        if self._mapper is not None and window is not None:
            self._mapper.ReleaseGraphicsResources(window)
        self._key, self._mapper = (), None


def _binned(data, bin_side):
    """Return a mesh of the mean points within bins, None if it is hardly smaller."""
    if not data.IsA('vtkPolyData'):
        return None
    triangles = triangles_of(pv.wrap(data))
    size = np.ptp(np.reshape(triangles.bounds, (3, 2)), axis=1)
    bin_counts = np.maximum(np.ceil(size / bin_side), 1.0)
    if bin_counts.prod() > _MOST_BINS:
        return None
    decimation = _vtk.vtkBinnedDecimation()
    decimation.SetInputData(triangles)
    decimation.AutoAdjustNumberOfDivisionsOff()
    decimation.SetNumberOfDivisions(bin_counts.astype(int).tolist())
    decimation.SetPointGenerationMode(_AVERAGES)
    decimation.ProducePointDataOn()
    decimation.ProduceCellDataOn()
    decimation.Update()
    draft = decimation.GetOutput()
    return draft if 0 < draft.GetNumberOfCells() < _WORTHWHILE * triangles.n_cells else None


def _copied(mapper, draft):
    copy = _vtk.vtkPolyDataMapper()
    copy.ShallowCopy(mapper)
    copy.SetInputDataObject(draft)
    set_planes(copy, mapper.GetClippingPlanes() or ())
    return copy
