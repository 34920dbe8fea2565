"""Points and lines of figures, from glTF files, rigid and posed."""

from __future__ import annotations

import json
import struct

import numpy as np
import pytest
import pyvista as pv

import pvibr
from pvibr import Figure
from pvibr.animation import FigureMesh, Pose, Skeleton, Skin

RNG = np.random.default_rng(11)
POINTS = RNG.uniform(-1, 1, (6, 3)).astype('<f4')
RED = {'color': 'red', 'line_width': 3, 'point_size': 7}


def gltf(folder, mode, corners=None):
    """Write six points with indices as a primitive of a mode."""
    view = {'buffer': 0, 'byteOffset': 0, 'byteLength': POINTS.nbytes}
    accessor = {'bufferView': 0, 'componentType': 5126, 'count': 6, 'type': 'VEC3'}
    document = {
        'asset': {'version': '2.0'},
        'bufferViews': [view],
        'accessors': [accessor],
        'meshes': [{'primitives': [{'attributes': {'POSITION': 0}, 'mode': mode}]}],
        'nodes': [{'mesh': 0, 'scale': [1, 2, 1]}],
    }
    blob = POINTS.tobytes()
    if corners is not None:
        more = {'buffer': 0, 'byteOffset': len(blob), 'byteLength': len(corners)}
        document['bufferViews'].append(more)
        counted = {'bufferView': 1, 'componentType': 5121, 'count': len(corners), 'type': 'SCALAR'}
        document['accessors'].append(counted)
        document['meshes'][0]['primitives'][0]['indices'] = 1
        blob += bytes(corners) + b'\0' * (-len(corners) % 4)
    document['buffers'] = [{'byteLength': len(blob)}]
    text = json.dumps(document).encode()
    text += b' ' * (-len(text) % 4)
    chunks = struct.pack('<I4s', len(text), b'JSON') + text
    chunks += struct.pack('<I4s', len(blob), b'BIN\0') + blob
    path = folder / 'wires.glb'
    path.write_bytes(struct.pack('<4sII', b'glTF', 2, 12 + len(chunks)) + chunks)
    return path


def picture(add):
    plotter = pv.Plotter(off_screen=True, window_size=(160, 120), lighting='none')
    add(plotter)
    plotter.camera_position = [(1, 2, 9), (0, 0, 0), (0, 1, 0)]
    plotter.reset_camera(bounds=(-1, 1, -2, 2, -1, 1))
    shown = plotter.screenshot(return_img=True)
    plotter.close()
    return shown


def cells(kind, rows):
    mesh = pv.PolyData()
    mesh.points = POINTS * np.float32([1, 2, 1])
    setattr(mesh, kind, np.hstack([[len(row), *row] for row in rows]))
    return mesh


@pytest.mark.parametrize(
    ('mode', 'corners', 'kind', 'rows'),
    [
        (0, None, 'verts', [[i] for i in range(6)]),
        (0, [4, 1], 'verts', [[4], [1]]),
        (1, [0, 3, 5, 2], 'lines', [[0, 3], [5, 2]]),
        (2, [0, 3, 5], 'lines', [[0, 3], [3, 5], [5, 0]]),
        (3, None, 'lines', [[i, i + 1] for i in range(5)]),
    ],
)
def test_every_mode_is_drawn_as_by_pyvista(tmp_path, mode, corners, kind, rows):
    figure = pvibr.read_gltf(gltf(tmp_path, mode, corners))
    found = picture(lambda plotter: plotter.ibr.add_animated(figure, **RED))
    mesh = cells(kind, rows)
    wanted = picture(lambda plotter: plotter.add_mesh(mesh, lighting=False, **RED))
    assert (wanted != wanted[0, 0]).any()
    assert (found != wanted).mean() < 0.002
    assert figure.mesh().n_cells == len(rows)


def test_lines_that_are_no_pairs_are_named(tmp_path):
    with pytest.raises(pvibr.animation.GltfError, match='multiple of 2 indices, got 3'):
        pvibr.read_gltf(gltf(tmp_path, 1, [0, 1, 2]))
    with pytest.raises(pvibr.animation.GltfError, match='2 indices or more as line loops, got 1'):
        pvibr.read_gltf(gltf(tmp_path, 2, [0]))


def test_lines_follow_a_skin_far_from_the_origin():
    far = np.array([5e5, 4e6, 0])
    mesh = pv.PolyData()
    mesh.points = POINTS.astype(float)
    mesh.lines = [6, *range(6)]
    joints = np.arange(6)[:, None] % 2
    skin = Skin([0, 1], np.tile(np.eye(4), (2, 1, 1)), joints, np.ones((6, 1)))
    skeleton = Skeleton([-1, -1], Pose(np.zeros((2, 3))))
    figure = Figure([FigureMesh(mesh, skin=skin)], skeleton)
    pose = Pose(far + np.array([[0, 0, 0], [0.3, -0.2, 0]]))
    posed = figure.mesh(pose=pose)
    wanted = POINTS + far + np.array([[0, 0, 0], [0.3, -0.2, 0]])[joints[:, 0]]
    np.testing.assert_allclose(posed.points, wanted, atol=1e-8)

    def animated(plotter):
        actor = plotter.ibr.add_animated(figure, lighting=False, **RED)
        actor.pose = pose
        actor.position = -far
        assert actor.pick(80, 60) is None

    near = posed.copy()
    near.points = wanted - far
    found = picture(animated)
    wanted = picture(lambda plotter: plotter.add_mesh(near, lighting=False, **RED))
    assert (found != wanted).mean() < 0.01


def test_a_figure_of_lines_and_triangles_in_a_crowd():
    edges = pv.Cube().extract_all_edges()
    figure = Figure([FigureMesh(pv.Cube()), FigureMesh(edges, look={'color': 'red'})])
    plotter = pv.Plotter(off_screen=True, window_size=(100, 80))
    crowd = plotter.ibr.add_animated(figure, [[0, 0, 0], [2, 0, 0]], cache=False)
    shown = plotter.screenshot(return_img=True)
    assert (shown != shown[0, 0]).any()
    assert len(crowd.poses) == 2
    plotter.close()
