"""Figures from arrays, from series of meshes and from scenes of trimesh."""

import numpy as np
import pytest
import pyvista as pv
import trimesh

from pvibr import Figure, PvibrWarning
from pvibr.animation import Pose
from tests.animation.conftest import refused

QUAD = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], float)
FACES = [[0, 1, 2], [0, 2, 3]]


def test_arrays_keep_their_precision():
    figure = Figure.from_arrays(QUAD + 1e6, FACES)
    assert figure.mesh().points.dtype == np.float64
    assert np.array_equal(figure.mesh().points, QUAD + 1e6)
    polygons = Figure.from_arrays(QUAD.astype(int), [4, 0, 1, 2, 3])
    assert polygons.mesh().n_cells == 1


def test_a_column_per_joint_is_a_skin_too():
    weights = np.array([[1, 0, 0], [0.5, 0.5, 0], [0, 0, 1], [0, 0, 2]])
    rest = Pose(np.zeros((3, 3)))
    wide = Figure.from_arrays(QUAD, FACES, None, weights, [-1, 0, 0], rest)
    joints, pulls = [[0, 0], [0, 1], [2, 0], [2, 0]], [[1, 0], [0.5, 0.5], [1, 0], [1, 0]]
    narrow = Figure.from_arrays(QUAD, FACES, joints, pulls, [-1, 0, 0], rest)
    pose = Pose(np.random.default_rng(0).normal(size=(3, 3)))
    assert np.allclose(wide.posed(0, pose)[0], narrow.posed(0, pose)[0])
    assert wide.meshes[0].skin.joints.shape == (4, 2)


@pytest.mark.parametrize(
    ('arguments', 'words'),
    [
        ({'faces': [[0, 1, 9]]}, 'faces must be from 0 to 3, got 0 to 9'),
        ({'faces': [[0, 1, -1]]}, 'faces must .* got -1 to 1'),
        ({'faces': [[0.5, 1, 2]]}, 'faces must be whole numbers'),
        ({'points': np.zeros((4, 2))}, r'points must be finite numbers of shape \(v, 3\)'),
        ({'points': np.full((4, 3), np.nan)}, 'points must be finite'),
        ({'parents': [-1]}, 'parents and rest must be given together'),
        ({'joints': np.zeros((4, 1), int)}, 'weights must be given with joints'),
        ({'weights': np.ones((4, 1))}, 'parents and rest must be given with weights'),
        (
            {'weights': np.ones((4, 2)), 'parents': [-1], 'rest': [np.eye(4)]},
            r'weights without joints must be \(v, 1\)',
        ),
        (
            {'weights': np.ones((4, 9)), 'parents': [-1] * 9, 'rest': [np.eye(4)] * 9},
            r'weights\[0\] must have at most 8 joints, got 9',
        ),
        (
            {
                'joints': np.zeros((4, 1), int),
                'weights': -np.ones((4, 1)),
                'parents': [-1],
                'rest': [np.eye(4)],
            },
            'weights must be 0 or more, .* in row 0 and 3 more',
        ),
    ],
)
def test_unusable_arrays_are_named(arguments, words):
    refused(words, Figure.from_arrays, **({'points': QUAD, 'faces': FACES} | arguments))


def growing():
    return [pv.Sphere(radius=r, theta_resolution=6, phi_resolution=6) for r in (1.0, 2.0, 4.0)]


def test_a_series_is_a_clip():
    figure = Figure.from_series(growing(), [0.0, 1.0, 3.0], look={'color': 'red'})
    assert np.allclose(figure.mesh(2.0).points, 3 * growing()[0].points)
    assert np.allclose(figure.mesh(2.0).active_normals, growing()[0].active_normals, atol=1e-5)
    assert np.allclose(figure.mesh(3.5).points, figure.mesh(0.5).points)
    assert np.allclose(figure.mesh(9.0, loop=False).points, growing()[2].points)
    assert figure.meshes[0].look == {'color': 'red'}


def test_a_series_comes_in_many_ways(tmp_path):
    meshes = growing()
    paths = [tmp_path / f'{i}.vtp' for i in range(3)]
    for mesh, path in zip(meshes, paths, strict=True):
        mesh.save(path)
    rows = [f'<DataSet timestep="{t}" file="{t}.vtp"/>' for t in range(3)]
    text = f'<Collection>{"".join(rows)}</Collection>'
    (tmp_path / 'series.pvd').write_text(f'<VTKFile type="Collection">{text}</VTKFile>')
    grids = [mesh.cast_to_unstructured_grid() for mesh in meshes]
    ways = [
        pv.MultiBlock(meshes),
        [pv.MultiBlock([mesh]) for mesh in meshes],
        grids,
        paths,
        tmp_path / 'series.pvd',
        str(tmp_path / 'series.pvd'),
        pv.get_reader(tmp_path / 'series.pvd'),
    ]
    for way in ways:
        assert np.allclose(np.ptp(Figure.from_series(way).mesh(1.5).points[:, 2]), 6.0)


def test_series_that_cannot_be_used_are_named(tmp_path):
    meshes = growing()
    refused(r'meshes\[1\]', Figure.from_series, [meshes[0], pv.Sphere()])
    other = meshes[1].copy()
    other.regular_faces = other.regular_faces[:, ::-1]
    refused('faces', Figure.from_series, [meshes[0], other])
    with pytest.raises(ValueError, match=r'meshes\[0\] must hold one mesh, got 2'):
        Figure.from_series([pv.MultiBlock(meshes[:2])])
    refused(r'times\[0\] must be 0 or later', Figure.from_series, meshes, [-1, 0, 1])
    refused('nowhere', Figure.from_series, tmp_path / 'nowhere.pvd', kind=FileNotFoundError)
    meshes[0].save(tmp_path / 'one.vtp')
    refused('which reads a single mesh', Figure.from_series, tmp_path / 'one.vtp')
    refused('at least one mesh', Figure.from_series, [])


def test_a_scene_keeps_its_graph():
    scene = trimesh.Scene()
    box = trimesh.creation.box()
    box.visual.vertex_colors = [255, 0, 0, 255]
    move = trimesh.transformations.translation_matrix
    scene.add_geometry(box, node_name='body', transform=move([1, 0, 0]))
    ball = trimesh.creation.icosphere(subdivisions=1)
    scene.add_geometry(ball, node_name='hand', parent_node_name='body', transform=move([0, 2, 0]))
    figure = Figure.from_scene(scene)
    assert figure.skeleton.names == ('world', 'body', 'hand')
    assert figure.skeleton.parents.tolist() == [-1, 0, 1]
    assert [body.name for body in figure.meshes] == ['body', 'hand']
    assert figure.meshes[0].look['rgb']
    raised = figure.skeleton.rest.matrices()
    raised[1, 2, 3] += 5.0
    posed = figure.mesh(pose=figure.skeleton.world(raised), merge=False)
    assert np.allclose(posed['hand'].center, [1, 2, 5], atol=1e-6)


def test_data_that_change_from_mesh_to_mesh_are_named():
    meshes = [pv.Cube() for _ in range(2)]
    for i, mesh in enumerate(meshes):
        mesh['same'] = np.full(mesh.n_points, np.nan)
        mesh['heat'] = np.full(mesh.n_points, i)
        mesh.cell_data['load'] = np.full(mesh.n_cells, i)
    with pytest.warns(PvibrWarning, match="'heat', 'load' differ"):
        figure = Figure.from_series(meshes)
    assert not figure.mesh(1.0)['heat'].any()
