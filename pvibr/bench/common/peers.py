"""What VTK itself offers for many instances: ``vtkGlyph3DMapper``, with and without levels."""

from __future__ import annotations

import numpy as np
import pyvista as pv
from scipy.spatial.transform import Rotation

from pvibr.capture.offscreen import Stage
from pvibr.core import _vtk

#: Instances that the peers are measured with; their time is extrapolated to all of them.
PART = 500
#: The one level that VTK draws on llvmpipe: nine in ten triangles less, from this many sizes of
#: the bounding box on.
LOD_DISTANCE, LOD_REDUCTION = 3.0, 0.9


def glyph_actors(meshes, poses, index, *, lod=False) -> list:
    """Return actors that draw instances by ``vtkGlyph3DMapper``."""
    actors = []
    for k, parts in enumerate(meshes):
        if (index == k).any():
            points = _points(poses[index == k])
            actors += [_glyphs(part, points, lod) for part in parts]
    return actors


def _points(poses):
    points = pv.PolyData(poses[:, :3, 3].copy())
    scales = np.linalg.norm(poses[:, :3, :3], axis=1)
    turns = Rotation.from_matrix(poses[:, :3, :3] / scales[:, None, :])
    points['turn'] = np.roll(turns.as_quat(), 1, axis=1)
    points['scale'] = scales
    return points


def glyph_mapper(points, mesh, orientation, scale):
    """Return VTK's mapper of instances, oriented and scaled by arrays of the points."""
    mapper = _vtk.vtkGlyph3DMapper()
    mapper.SetInputData(points)
    mapper.SetSourceData(mesh)
    mapper.SetOrientationArray(orientation)
    mapper.SetScaleArray(scale)
    mapper.SetScaleModeToScaleByVectorComponents()
    mapper.ScalarVisibilityOff()
    return mapper


def _glyphs(part, points, lod):
    mapper = glyph_mapper(points, part.mesh, 'turn', 'scale')
    mapper.SetOrientationModeToQuaternion()
    if lod:
        mapper.SetCullingAndLOD(True)
        mapper.SetNumberOfLOD(1)
        mapper.SetLODDistanceAndTargetReduction(0, LOD_DISTANCE, LOD_REDUCTION)
    actor = part.new_actor(mapper)
    colors = part.mesh.active_scalars
    if colors is not None and colors.ndim == 2:
        actor.SetProperty(pv.Property())
        actor.GetProperty().DeepCopy(part.actor.GetProperty())
        actor.GetProperty().SetColor(*(colors[:, :3].mean(0) / 255).tolist())
    return actor


def glyph_seconds(scene, cameras, size, *, lod=False, part=PART, seed=0) -> float:
    """Return VTK's seconds a frame for all instances of a landscape, extrapolated linearly."""
    ids = np.random.default_rng(seed).permutation(len(scene.index))[:part]
    actors = glyph_actors(scene.parts(), scene.matrices[ids], scene.index[ids], lod=lod)
    groups = [[a] for a in actors] if lod else [actors]
    empty = _median(scene, [], cameras, size)
    added = sum(max(_median(scene, group, cameras, size) - empty, 0.0) for group in groups)
    return empty + added * len(scene.index) / len(ids)


def _median(scene, actors, cameras, size):
    with Stage(size, scene.terrain, scene.view_angle, lights=scene.lights()) as stage:
        stage.add(actors)
        found = float(np.median(stage.seconds(cameras)))
        for actor in actors:
            actor.ReleaseGraphicsResources(stage.window)
    return found
