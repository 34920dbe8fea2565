"""Models of the real world: the points that VTK's own reader of glTF finds, at ten times."""

from __future__ import annotations

import shutil
import warnings

import numpy as np
import pytest
import pyvista as pv
from PIL import Image

import pvibr
from pvibr import _vtk

pytestmark = pytest.mark.data
MODELS = [
    'AnimatedMorphCube.glb',
    'BoxAnimated.glb',
    'CesiumMan.glb',
    'Fox.glb',
    'InterpolationTest.glb',
    'Knight.glb',
    'MorphStressTest.glb',
    'RiggedSimple.glb',
    'SimpleMorph/SimpleMorph.gltf',
    'SimpleSkin/SimpleSkin.gltf',
    'robot.glb',
]
#: Of more clips than this the first, the last and one between.
MANY = 9


def reader_of(path, number, clips):
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


def corners_at(reader, time):
    """Return the corners of the triangles of each primitive, arrays of shape (t, 3, 3)."""
    reader.UpdateTimeStep(float(time))
    meshes = list(_leaves(reader.GetOutputDataObject(0)))
    return [np.array(mesh.points, np.float64)[mesh.regular_faces] for mesh in meshes]


def _leaves(blocks):
    for i in range(blocks.GetNumberOfBlocks()):
        block = blocks.GetBlock(i)
        if block.IsA('vtkMultiBlockDataSet'):
            yield from _leaves(block)
        else:
            yield pv.wrap(block)


def assert_same_points(path):
    with warnings.catch_warnings():
        warnings.simplefilter('ignore', pvibr.PvibrWarning)  # of textures
        figure = pvibr.read_gltf(path)
    # On its second update vtkGLTFReader writes all primitives of a mesh into the block of the
    # first (BuildMultiBlockDatasetFromMesh never counts blockId up): it must be a new one then.
    renew = len({body.node for body in figure.bodies}) < len(figure.bodies)
    n = len(figure.clips)
    for number in range(n) if n <= MANY else (0, n // 2, n - 1):
        clip = figure.clips[number]
        reader = reader_of(path, number, n)
        for time in np.linspace(0, clip.duration, 10):
            reader = reader_of(path, number, n) if renew else reader
            theirs = corners_at(reader, time)
            pose = figure.sample(time, clip, loop=False)
            ours = [
                figure.posed(i, pose)[0][body.mesh.regular_faces]
                for i, body in enumerate(figure.bodies)
            ]
            assert [len(part) for part in ours] == [len(part) for part in theirs]
            ours, theirs = np.concatenate(ours), np.concatenate(theirs)
            size = np.ptp(theirs, axis=(0, 1)).max()
            assert np.abs(ours - theirs).max() <= 1e-4 * size, (clip.name, time)


@pytest.mark.parametrize('name', MODELS)
def test_posed_points_are_those_of_vtk(data_dir, name):
    assert_same_points(data_dir / 'gltf' / name)


def test_a_figure_of_parts_is_posed_as_vtk_does(data_dir, tmp_path):
    # Its picture is in another folder here; VTK does not read it without.
    path = shutil.copy(data_dir / 'meshes' / 'kenney' / 'character.glb', tmp_path)
    (tmp_path / 'Textures').mkdir()
    Image.new('RGB', (2, 2)).save(tmp_path / 'Textures' / 'colormap.png')
    assert_same_points(path)


def test_what_vtk_reads_without_clips(data_dir):
    path = data_dir / 'gltf' / 'VertexColorTest.glb'
    figure = pvibr.read_gltf(path)
    theirs = corners_at(reader_of(path, 0, 0), 0)
    for i, corners in enumerate(theirs):
        faces = figure.bodies[i].mesh.regular_faces
        np.testing.assert_allclose(figure.posed(i)[0][faces], corners, atol=1e-6)
