"""What VTK itself offers for many instances: ``vtkGlyph3DMapper``, with and without levels."""

from __future__ import annotations

from functools import partial

import numpy as np
import pyvista as pv
from scipy.spatial.transform import Rotation

from pvibr.cli.timing import frame_at
from pvibr.core import _vtk
from pvibr.scenes.scenery import stage

#: Instances that the peers are measured with; their time is extrapolated to all of them.
PART = 300
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


class GlyphFrames:
    """Frames of VTK's own instances: a part is drawn, and its time extrapolated linearly.

    The part is drawn by lot, and its time taken over that of the same stage without instances.
    """

    def __init__(self, new_stage, meshes, poses, index, *, lod=False, part=PART, seed=0):
        rows = np.random.default_rng(seed).permutation(len(index))[:part]
        self.part, self._scale = len(rows), len(index) / len(rows)
        actors = glyph_actors(meshes, poses[rows], index[rows], lod=lod)
        # Actors of several levels each have a window of their own.
        groups = [[actor] for actor in actors] if lod else [actors]
        self._groups = [[], *groups]
        self._stages = [new_stage() for _ in self._groups]
        for empty, group in zip(self._stages, self._groups, strict=True):
            empty.add(group)

    def __enter__(self):
        return self

    def __exit__(self, *error):
        for drawn, group in zip(self._stages, self._groups, strict=True):
            for actor in group:
                actor.ReleaseGraphicsResources(drawn.window)
            drawn.close()

    def sample(self, multi_samples):
        """Set the multisamples of the next frames."""
        for each in self._stages:
            each.window.SetMultiSamples(multi_samples)

    def seconds(self, camera) -> np.ndarray:
        """Return the seconds of a frame of all instances, of both clocks."""
        empty, *parts = (np.array(frame_at(each, camera)) for each in self._stages)
        return empty + self._scale * sum(np.maximum(part - empty, 0.0) for part in parts)


def tree_glyphs(scene, size, **options) -> GlyphFrames:
    """Return frames of the trees of a landscape as VTK's own instances."""
    new_stage = partial(stage, scene, size)
    return GlyphFrames(new_stage, scene.parts(), scene.matrices, scene.index, **options)


def beside_peers(own, peers, cameras, every, limit=np.inf) -> dict[str, list]:
    """Return the seconds of frames by turns, of both clocks: of ``'pvibr'``, and by peer.

    Peers draw at one camera of so many; after `limit` seconds of pvibr's only what is missing.
    """
    times: dict[str, list] = {'pvibr': [], **{name: [] for name in peers}}
    frame_at(own, cameras[0])  # the first frames upload and compile
    for peer in peers.values():
        peer.seconds(cameras[0])
    for k, camera in enumerate(cameras):
        if sum(wall for _, wall in times['pvibr']) < limit:
            times['pvibr'].append(frame_at(own, camera))
        elif all(times.values()):
            break
        if k % every == every // 2:
            for name, peer in peers.items():
                times[name].append(peer.seconds(camera))
    return times
