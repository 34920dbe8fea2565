import numpy as np
import pytest
import pyvista as pv

from pvibr import Figure
from pvibr.animation import FigureMesh
from pvibr.figures.as_figure import as_figure
from tests.animation.conftest import refused


def series():
    return [pv.Sphere(radius=r) for r in (1.0, 2.0, 3.0)]


@pytest.mark.parametrize('wrap', [list, tuple, pv.MultiBlock])
def test_a_series_is_one_mesh_a_second(wrap):
    figure = as_figure(wrap(series()))
    assert figure.clips[0].duration == 2.0
    assert figure.mesh(1.5).length == pytest.approx(pv.Sphere(radius=2.5).length)


def test_a_mesh_and_a_body_are_figures_of_one_body():
    body = FigureMesh(pv.Cube())
    assert as_figure(body).meshes[0] is body
    assert as_figure(pv.Cube()).mesh().n_cells == 6
    assert as_figure(pv.ImageData(dimensions=(3, 3, 3))).mesh().n_cells == 24


def test_trimesh():
    trimesh = pytest.importorskip('trimesh')
    box = trimesh.creation.box()
    assert as_figure(box).mesh().n_cells == 12
    assert len(as_figure(trimesh.Scene({'box': box})).skeleton) == 2


@pytest.mark.parametrize('kind', [str, lambda path: path])
def test_files(tmp_path, kind):
    path = tmp_path / 'cube.GLB'
    saved = tmp_path / 'cube.glb'
    Figure([FigureMesh(pv.Cube().triangulate())]).save(saved)
    saved.rename(path)
    np.testing.assert_allclose(as_figure(kind(path)).mesh().bounds, pv.Cube().bounds)
    refused('nothing', as_figure, kind(tmp_path / 'nothing.glb'), kind=FileNotFoundError)


@pytest.mark.parametrize(
    ('name', 'words'),
    [
        ('a.fbx', 'save it as .glb, with Blender or FBX2glTF'),
        ('b.USDZ', 'Blender or usd2gltf'),
        ('c.blend', 'with Blender'),
        ('d.mb', 'the exporter of the program'),
    ],
)
def test_files_that_must_be_converted(name, words):
    refused(f'got .*{name}: .*{words}', as_figure, name)


@pytest.mark.parametrize('name', ['ball.vtp', 'ball.stl', 'ball.obj', 'ball.vtu'])
def test_files_of_one_mesh(tmp_path, name):
    ball = pv.Sphere(radius=2.0, center=(1, 0, 0))
    (ball if name != 'ball.vtu' else ball.cast_to_unstructured_grid()).save(tmp_path / name)
    figure = as_figure(tmp_path / name)
    np.testing.assert_allclose(figure.mesh().bounds, ball.bounds, atol=1e-5)
    refused('nothing', as_figure, tmp_path / f'nothing{name[4:]}', kind=FileNotFoundError)


def test_files_of_trimesh_and_of_several_meshes(tmp_path):
    trimesh = pytest.importorskip('trimesh')
    trimesh.creation.box().export(tmp_path / 'box.off')
    assert as_figure(tmp_path / 'box.off').mesh().n_cells == 12
    blocks = pv.MultiBlock([pv.Cube(), pv.MultiBlock([pv.Sphere()])])
    blocks.save(tmp_path / 'two.vtm')
    assert len(as_figure(tmp_path / 'two.vtm').meshes) == 2


def test_vrm_is_gltf(tmp_path):
    Figure([FigureMesh(pv.Cube().triangulate())]).save(tmp_path / 'a.glb')
    (tmp_path / 'a.glb').rename(tmp_path / 'a.vrm')
    assert len(as_figure(tmp_path / 'a.vrm').meshes) == 1


def test_a_figure_is_itself():
    figure = as_figure(pv.Cube())
    assert as_figure(figure) is figure


@pytest.mark.parametrize('wrong', [None, 3, object(), pv.Actor()])
def test_what_is_no_figure_is_said(wrong):
    refused(type(wrong).__name__, as_figure, wrong, kind=TypeError)


def test_what_is_animated_grows_with_time():
    pl = pv.Plotter(off_screen=True)
    growing = pl.ibr.add_animated(series())
    assert growing.bounds[1] == pytest.approx(1.0, rel=1e-2)
    pl.ibr.time = 1.0
    assert growing.bounds[1] == pytest.approx(2.0, rel=1e-2)
    refused('NoneType', pl.ibr.add_animated, None, kind=TypeError)
    assert len(pl.ibr.effects) == 1
    pl.close()
