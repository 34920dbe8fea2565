"""Other ways to pose a figure: VTK's own reader of glTF, and numpy on the processor."""

from __future__ import annotations

import numpy as np
import pyvista as pv

from pvibr.core import _vtk


def reader_error(path, figure, times, clips) -> float:
    """Return how far a figure's float64 points are from those of VTK's reader."""
    # On its second update vtkGLTFReader writes all primitives of a mesh into the block of the
    # first (BuildMultiBlockDatasetFromMesh never counts blockId up): it must be a new one then.
    renew = len({body.node for body in figure.meshes}) < len(figure.meshes)
    worst = 0.0
    for number in _spread(len(figure.clips), clips) or [0]:
        clip = figure.clips[number] if figure.clips else None
        reader = gltf_reader(path, number, len(figure.clips))
        for time in np.linspace(0, clip.duration, times) if clip else [0.0]:
            reader = gltf_reader(path, number, len(figure.clips)) if renew else reader
            meshes = meshes_at(reader, time)
            theirs = [np.array(m.points, np.float64)[m.regular_faces] for m in meshes]
            pose = figure.sample(time, clip, loop=False)
            faces = [body.mesh.regular_faces for body in figure.meshes]
            ours = [figure.posed(i, pose)[0][cells] for i, cells in enumerate(faces)]
            if [len(part) for part in ours] != [len(part) for part in theirs]:
                raise ValueError(f'{path.name}: vtkGLTFReader finds other triangles')
            away = np.abs(np.concatenate(ours) - np.concatenate(theirs)).max()
            worst = max(worst, away / size_of(theirs))
    return worst


def _spread(n, most):
    """Return numbers of clips."""
    return np.linspace(0, n - 1, min(n, most)).astype(int).tolist()


def gltf_reader(path, number=0, clips=0):
    """Return VTK's reader with one of the clips enabled."""
    reader = _vtk.vtkGLTFReader()
    reader.SetFileName(str(path))
    reader.ApplyDeformationsToGeometryOn()
    reader.UpdateInformation()
    for i in range(clips):
        reader.DisableAnimation(i)
    if clips:
        reader.EnableAnimation(number)
    reader.SetFrameRate(60)
    return reader


def meshes_at(reader, time) -> list:
    """Return what VTK's reader has at a time."""
    reader.UpdateTimeStep(float(time))
    return list(_leaves(reader.GetOutputDataObject(0)))


def _leaves(blocks):
    for i in range(blocks.GetNumberOfBlocks()):
        block = blocks.GetBlock(i)
        if block.IsA('vtkMultiBlockDataSet'):
            yield from _leaves(block)
        else:
            yield pv.wrap(block)


def size_of(parts) -> float:
    """Return the largest side of a box around points."""
    points = np.concatenate([part.reshape(-1, 3) for part in parts])
    return float(np.ptp(points, axis=0).max())


class NumpySkinning:
    """Linear blending as it is written in numpy: float32, over all vertices at once."""

    def __init__(self, body):
        self.skin = body.skin
        self.weights = body.skin.weights.astype(np.float32)[:, None]
        self.points, self.normals = (v.astype(np.float32) for v in (body.points, body.normals))
        self.mesh = pv.PolyData()
        self.mesh.points = self.points.copy()
        self.mesh.regular_faces = body.mesh.regular_faces
        self.mesh.point_data['Normals'] = self.normals.copy()
        self.mesh.point_data.active_normals_name = 'Normals'

    def pose(self, world):
        """Move the mesh."""
        palette = self.skin.matrices(world).astype(np.float32)[:, :3].reshape(-1, 12)
        blend = (self.weights @ palette[self.skin.joints]).reshape(-1, 3, 4)
        points = np.einsum('vij,vj->vi', blend[..., :3], self.points) + blend[..., 3]
        normals = np.einsum('vij,vj->vi', blend[..., :3], self.normals)  # joints do not stretch
        normals /= np.linalg.norm(normals, axis=1, keepdims=True)
        np.copyto(self.mesh.points, points)
        np.copyto(self.mesh.point_data['Normals'], normals)
        self.mesh.GetPoints().Modified()
        self.mesh.GetPointData().GetNormals().Modified()
