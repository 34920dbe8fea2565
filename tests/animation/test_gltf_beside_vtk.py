"""Models of the real world: the points that VTK's own reader of glTF finds, at ten times."""

import shutil

import pytest
from PIL import Image

from benchmarks.figures import errors as figures_errors
from benchmarks.figures import peers as figures_peers

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
    'VertexColorTest.glb',  # without clips
    'robot.glb',
]
#: Of more clips than this the first, the last and one between.
MANY = 9


def assert_same_points(path):
    figure = figures_errors.quiet_read(path)
    assert figures_peers.reader_error(path, figure, 10, MANY) <= 1e-4


@pytest.mark.parametrize('name', MODELS)
def test_posed_points_are_those_of_vtk(data_dir, name):
    assert_same_points(data_dir / 'gltf' / name)


def test_a_figure_of_parts_is_posed_as_vtk_does(data_dir, tmp_path):
    # Its picture is in another folder here; VTK does not read it without.
    path = shutil.copy(data_dir / 'meshes' / 'kenney' / 'character.glb', tmp_path)
    (tmp_path / 'Textures').mkdir()
    Image.new('RGB', (2, 2)).save(tmp_path / 'Textures' / 'colormap.png')
    assert_same_points(path)
