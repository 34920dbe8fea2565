"""Figures written as GLB and read again, and clips as series."""

import numpy as np
import pytest
import pyvista as pv
from hypothesis import given, settings
from hypothesis import strategies as st

from pvibr import Figure, PvibrWarning, read_gltf
from pvibr.animation import Clip, FigureMesh, Morphs, Pose, Skeleton, Skin, Track
from pvibr.animation.vertex_animation import VertexAnimation
from pvibr.core import _vtk
from tests.animation.conftest import document, refused
from tests.makers import full_disk, sheet

SEEDS = st.integers(0, 2**32 - 1)


def random_track(rng, node, path, width):
    how = rng.choice(['step', 'linear', 'cubic'])
    k = rng.integers(1, 5)
    values = rng.normal(size=(k, 3, width) if how == 'cubic' else (k, width))
    return Track(node, path, np.cumsum(rng.uniform(0.1, 1.0, k)), values, str(how))


def random_figure(rng, n=4, v=12):
    parents = [rng.integers(-1, i) if i else -1 for i in range(n)]
    rest = Pose(rng.normal(size=(n, 3)), rng.normal(size=(n, 4)), rng.uniform(0.5, 2, (n, 3)))
    skeleton = Skeleton(parents, rest)
    k = rng.integers(1, 9)
    bind = np.linalg.inv(skeleton.world(rest)) + 0.0
    skin = Skin(np.arange(n), bind, rng.integers(0, n, (v, k)), rng.random((v, k)) + 0.01)
    sparse = [([3, 1, 1], rng.normal(size=(3, 3))), rng.normal(size=(v, 3)), None]
    morphs = [
        Morphs(sparse, [None, None, rng.normal(size=(v, 3))], weights=rng.normal(size=3)),
        Morphs(rng.normal(size=(2, v, 3))),
    ]
    mesh = sheet(rng.normal(size=(v, 3)))
    bodies = [
        FigureMesh(mesh, skin=skin, morphs=morphs[0], name='skinned'),
        FigureMesh(mesh, node=1, morphs=morphs[1], name='joint1'),
        FigureMesh(mesh, node=1, name='also held'),
        FigureMesh(mesh, name='free'),
    ]
    paths = [('translation', 3), ('rotation', 4), ('scale', 3)]
    tracks = [random_track(rng, joint, *paths[rng.integers(3)]) for joint in range(n)]
    tracks.append(random_track(rng, 0, 'weights', 3))
    tracks.append(random_track(rng, 3, 'weights', 2))
    last = max(track.times[-1] for track in tracks)
    clips = [Clip('move', tracks, last + rng.choice([0.0, 0.5])), Clip('one', tracks[:1])]
    return Figure(bodies, skeleton, clips, name='random')


def written(figure, folder):
    figure.save(folder / 'figure.glb')
    return read_gltf(folder / 'figure.glb')


def assert_same(figure, again, clip, times):
    for time in times:
        one, two = figure.sample(time, clip), again.sample(time, clip)
        for i, body in enumerate(figure.meshes):
            (j,) = [j for j, other in enumerate(again.meshes) if other.name == body.name]
            (points, normals), (moved, turned) = figure.posed(i, one), again.posed(j, two)
            assert np.abs(points - moved).max() < 1e-4 * max(np.abs(points).max(), 1)
            # Normals are less exact where blended matrices are nearly singular.
            assert np.abs(normals - turned).max() < 1e-2


@settings(max_examples=15, deadline=None)
@given(seed=SEEDS)
def test_a_figure_comes_back_in_every_pose(seed, tmp_path_factory):
    rng = np.random.default_rng(seed)
    figure = random_figure(rng)
    again = written(figure, tmp_path_factory.mktemp('glb'))
    assert [clip.name for clip in again.clips] == ['move', 'one']
    for clip in figure.clips:
        assert again.clip(clip.name).duration == pytest.approx(clip.duration, rel=1e-6)
        # Not at a step itself, where rounding decides.
        assert_same(figure, again, clip.name, rng.uniform(-1, 6, 4))


def test_vtk_reads_the_same_poses(tmp_path):
    """By its own reader, which knows four joints per vertex and not eight."""
    figure = random_figure(np.random.default_rng(5))
    all_of_it = figure.meshes[0].skin
    four = all_of_it.joints[:, :4], all_of_it.weights[:, :4]
    skin = Skin(all_of_it.nodes, all_of_it.inverse_bind, *four)
    body = FigureMesh(figure.meshes[0].mesh, skin=skin)
    path = [Track(2, 'translation', [0, 1], [[0, 0, 0], [1, 2, 3]])]
    Figure([body], figure.skeleton, [Clip('move', path)]).save(tmp_path / 'x.glb')
    reader = _vtk.vtkGLTFReader()
    reader.SetFileName(str(tmp_path / 'x.glb'))
    reader.ApplyDeformationsToGeometryOn()
    reader.UpdateInformation()
    reader.EnableAnimation(0)
    reader.SetFrameRate(10)
    reader.UpdateInformation()
    reader.UpdateTimeStep(0.5)
    found = pv.wrap(reader.GetOutputDataObject(0)).combine().points
    points = Figure([body], figure.skeleton, [Clip('move', path)]).mesh(0.5).points
    assert np.abs(found - points).max() < 1e-5 * np.ptp(points)


def test_key_frames_become_morph_targets(tmp_path):
    rng = np.random.default_rng(0)
    shapes = rng.normal(size=(4, 9, 3))
    for how in ('linear', 'step'):
        frames = VertexAnimation([0.0, 0.5, 2.0, 3.0], shapes, None, how)
        morphs = Morphs(rng.normal(size=(1, 9, 3)), weights=[0.5])
        figure = Figure([FigureMesh(sheet(shapes[0]), frames=frames, morphs=morphs, name='x')])
        assert_same(figure, written(figure, tmp_path), None, [0.1, 0.7, 2.9])
    short = Figure(figure.meshes, clips=[Clip('short', [], 1.25)])
    assert_same(short, written(short, tmp_path), 'short', [0.1, 0.7, 1.2, 1.4])


def test_several_tracks_of_weights_become_one(tmp_path):
    rng = np.random.default_rng(0)
    body = FigureMesh(
        sheet(np.eye(3)), morphs=Morphs(rng.normal(size=(3, 3, 3)), weights=[1, 2, 3])
    )
    tracks = [Track(i, 'weights', [0, 1], rng.normal(size=(2, 1))) for i in (2, 0)]
    figure = Figure([body], clips=[Clip('x', tracks, duration=2.0)])
    again = written(figure, tmp_path)
    for time in (0.2, 0.8, 1.7):
        points = again.mesh(time).points
        assert np.allclose(points, figure.mesh(time).points, atol=1e-5)


def test_a_track_may_drive_several_bodies(tmp_path):
    rng = np.random.default_rng(0)
    bodies = [
        FigureMesh(sheet(np.eye(3)), morphs=Morphs(rng.normal(size=(n, 3, 3))), name=str(n))
        for n in (1, 3, 2)
    ]
    track = Track(0, 'weights', [0, 1], rng.normal(size=(2, 5)))
    figure = Figure(bodies, clips=[Clip('x', [track])])
    assert_same(figure, written(figure, tmp_path), 'x', [0.1, 0.6])


def test_a_series_comes_back(tmp_path):
    figure = Figure.from_series([pv.Sphere(radius=r) for r in (1, 2, 3)])
    again = written(figure, tmp_path)
    assert again.clips[0].name == 'series'
    assert np.allclose(again.mesh(1.5).bounds, figure.mesh(1.5).bounds)


def test_looks_come_back(tmp_path):
    mesh = pv.Plane(i_resolution=2, j_resolution=2).triangulate()
    image = np.random.default_rng(0).integers(0, 255, (4, 4, 3), dtype=np.uint8)
    shown = mesh.copy()
    shown['paint'] = np.arange(27, dtype=np.uint8).reshape(9, 3) * 9
    paint = {'scalars': 'paint', 'rgb': True}
    textured = {'texture': pv.Texture(image), 'culling': 'back'}
    looks = [{'color': (0.2, 0.4, 0.8), 'opacity': 0.5}, textured, textured, paint]
    bodies = [
        FigureMesh(shown if look is paint else mesh, look=look, name=str(i))
        for i, look in enumerate(looks)
    ]
    again = written(Figure(bodies), tmp_path)
    assert np.allclose(again.meshes[0].look['color'], (0.2, 0.4, 0.8), atol=1e-6)
    assert again.meshes[0].look['opacity'] == 0.5
    assert np.array_equal(again.meshes[1].look['texture'].to_array(), image)
    found = again.meshes[1].mesh.active_texture_coordinates
    assert np.allclose(found, mesh.active_texture_coordinates, atol=1e-6)
    assert again.meshes[1].look['culling'] == 'back'
    assert len(document(tmp_path / 'figure.glb')[0]['images']) == 1
    painted = again.meshes[3]
    assert np.array_equal(painted.mesh[painted.look['scalars']], shown['paint'])


def test_physically_based_looks_come_back(tmp_path):
    mesh = pv.Plane(i_resolution=1, j_resolution=1).triangulate()
    rng = np.random.default_rng(0)
    images = {
        name: rng.integers(0, 255, (4, 4, 3), dtype=np.uint8)
        for name in ('albedoTex', 'materialTex', 'emissiveTex')
    }
    look = {
        'color': (0.2, 0.4, 0.8),
        'pbr': True,
        'metallic': 0.25,
        'roughness': 0.75,
        'pbr_textures': {name: pv.Texture(image) for name, image in images.items()},
        'emissive_factor': (1.0, 0.5, 0.0),
    }
    path = tmp_path / 'figure.glb'
    Figure([FigureMesh(mesh, look=look)]).save(path)
    again = read_gltf(path, pbr=True).meshes[0].look
    for name in ('color', 'metallic', 'roughness', 'emissive_factor'):
        assert np.allclose(again[name], look[name], atol=1e-6)
    for name, image in images.items():
        assert np.array_equal(again['pbr_textures'][name].to_array(), image)


def test_what_is_left_out_is_said(tmp_path):
    mesh = sheet(np.eye(3))
    mesh['heat'] = [1.0, 2.0, 3.0]
    morphs = Morphs(np.ones((1, 3, 3)), colors=np.ones((1, 3, 3)))
    bodies = [FigureMesh(mesh, look={'scalars': 'heat'}), FigureMesh(mesh, morphs=morphs)]
    bodies.append(FigureMesh(pv.PolyData(np.eye(3))))
    figure = Figure(bodies, clips=[Clip('still', [])], lights=[object()])
    words = 'lights, scalars other than point colours, colors of morph targets, meshes '
    with pytest.warns(PvibrWarning, match=words + "without polygons, the empty clip 'still'"):
        figure.save(tmp_path / 'x.glb')
    Figure([]).save(tmp_path / 'nothing.glb')


def test_what_gltf_cannot_say_is_refused(tmp_path):
    body = FigureMesh(
        sheet(np.eye(3)), frames=VertexAnimation([0, 1], np.stack([np.eye(3)] * 2), None, 'cubic')
    )
    path = tmp_path / 'x.glb'
    path.write_bytes(b'before')
    refused(r'linear or stepped key frames .* got cubic', Figure([body]).save, path)
    up = Track(0, 'translation', [0, 1], np.zeros((2, 3)))
    skeleton = Skeleton([-1], [np.eye(4)])
    with pytest.raises(ValueError, match=r'last until its last key at 1.0 s.* got 0.5'):
        Figure([], skeleton, [Clip('up', [up], 0.5)]).save(path)
    two = [Track(i, 'weights', [0, i + 1.0], np.ones((2, 1))) for i in range(2)]
    twice = FigureMesh(sheet(np.eye(3)), morphs=Morphs(np.ones((2, 3, 3))))
    refused('by equal keys', Figure([twice], clips=[Clip('x', two)]).save, path)
    refused(r'must end in .glb', Figure([]).save, tmp_path / 'x.gltf')
    assert [(p.name, p.read_bytes()) for p in tmp_path.iterdir()] == [('x.glb', b'before')]


def test_a_failed_write_leaves_what_was_there(tmp_path, monkeypatch):
    path = tmp_path / 'x.glb'
    path.write_bytes(b'before')
    monkeypatch.setattr('pathlib.Path.replace', full_disk)
    refused('the disk is full', Figure([]).save, path, kind=OSError)
    assert [(p.name, p.read_bytes()) for p in tmp_path.iterdir()] == [('x.glb', b'before')]


def test_a_clip_is_a_series():
    up = Track(0, 'translation', [0, 0.3], [[0, 0, 0], [0, 0, 3]])
    skeleton = Skeleton([-1], [np.eye(4)])
    figure = Figure([FigureMesh(pv.Cube(), 0)], skeleton, [Clip('up', [up])])
    times, meshes = figure.series('up', 10)
    assert np.allclose(times, [0, 0.1, 0.2, 0.3])
    assert np.allclose([mesh.center[2] for mesh in meshes], [0, 1, 2, 3])
    again = Figure.from_series(meshes, times)
    assert np.allclose(again.mesh(0.15).points, figure.mesh(0.15).points)
    refused(r'fps must .*got 0', figure.series, 'up', 0)
