"""VTK's own instancing: ``vtkGlyph3DMapper``, with and without levels of detail."""

from __future__ import annotations

from functools import partial

import numpy as np
import pyvista as pv
from scipy.spatial.transform import Rotation

from pvibr.cli.timing import frame_at
from pvibr.core import _vtk
from pvibr.scenes.stage import stage

#: Instances with which peers are measured; times are extrapolated to all.
PART = 300
#: The one level that VTK draws on llvmpipe: from this many sizes of the bounding box, with this
#: share of triangles removed.
LOD_DISTANCE, LOD_REDUCTION = 3.0, 0.9


def glyph_actors(meshes, poses, index, *, lod=False) -> list:
    """Return actors that draw instances by ``vtkGlyph3DMapper``."""
    actors = []
    for k, parts in enumerate(meshes):
        if (index == k).any():
            actors += [_glyphs(part, _points(poses[index == k]), lod) for part in parts]
    return actors


def _points(poses):
    points = pv.PolyData(poses[:, :3, 3].copy())
    axis_scales = np.linalg.norm(poses[:, :3, :3], axis=1)
    rotations = Rotation.from_matrix(poses[:, :3, :3] / axis_scales[:, None, :])
    points['turn'] = np.roll(rotations.as_quat(), 1, axis=1)
    points['scale'] = axis_scales
    return points


def glyph_mapper(points, mesh, orientation, scale):
    """Return a glyph mapper, oriented and scaled by arrays of the points."""
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
    vertex_colors = part.mesh.active_scalars
    if vertex_colors is not None and vertex_colors.ndim == 2:
        actor.SetProperty(pv.Property())
        actor.GetProperty().DeepCopy(part.actor.GetProperty())
        actor.GetProperty().SetColor(*(vertex_colors[:, :3].mean(0) / 255).tolist())
    return actor


class GlyphFrames:
    """Frames of VTK's own instances, extrapolated linearly from a random sample.

    The time of the same stage without instances is subtracted first.
    """

    def __init__(self, new_stage, meshes, poses, index, *, lod=False, part=PART, seed=0):
        sampled_ids = np.random.default_rng(seed).permutation(len(index))[:part]
        self.part, self._scale = len(sampled_ids), len(index) / len(sampled_ids)
        actors = glyph_actors(meshes, poses[sampled_ids], index[sampled_ids], lod=lod)
        # VTK's levels need a window per actor.
        actor_groups = [[actor] for actor in actors] if lod else [actors]
        self._groups = [[], *actor_groups]
        self._stages = [new_stage() for _ in self._groups]
        for empty, group in zip(self._stages, self._groups, strict=True):
            empty.add(group)

    def __enter__(self):
        return self

    def __exit__(self, *error):
        for each, group in zip(self._stages, self._groups, strict=True):
            for actor in group:
                actor.ReleaseGraphicsResources(each.window)
            each.close()

    def sample(self, multi_samples):
        """Set the multisamples of the next frames."""
        for each in self._stages:
            each.window.SetMultiSamples(multi_samples)

    def seconds(self, camera) -> np.ndarray:
        """Return the seconds of a frame of all instances, on both clocks."""
        empty, *parts = (np.array(frame_at(each, camera)) for each in self._stages)
        return empty + self._scale * sum(np.maximum(part - empty, 0.0) for part in parts)


def tree_glyphs(scene, size, **options) -> GlyphFrames:
    """Return frames of the trees of a landscape as VTK's own instances."""
    new_stage = partial(stage, scene, size)
    return GlyphFrames(new_stage, scene.parts(), scene.matrices, scene.index, **options)


def beside_peers(own_stage, peers, cameras, interval, limit=np.inf) -> dict[str, list]:
    """Return the seconds of alternating frames on both clocks, of ``'pvibr'`` and of each peer.

    Peers draw at each `interval`-th camera; after `limit` seconds pvibr draws no more.
    """
    frame_seconds: dict[str, list] = {'pvibr': [], **{name: [] for name in peers}}
    frame_at(own_stage, cameras[0])  # the first frames upload and compile
    for peer in peers.values():
        peer.seconds(cameras[0])
    for k, camera in enumerate(cameras):
        if sum(wall for _, wall in frame_seconds['pvibr']) < limit:
            frame_seconds['pvibr'].append(frame_at(own_stage, camera))
        elif all(frame_seconds.values()):
            break
        if k % interval == interval // 2:
            for name, peer in peers.items():
                frame_seconds[name].append(peer.seconds(camera))
    return frame_seconds
