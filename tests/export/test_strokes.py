"""Lines and vertices of meshes are in plain plotters and in glTF files, where they are drawn."""

import numpy as np
import pytest
import pyvista as pv

from tests.animation.conftest import document
from tests.pictures import shot

SIZE = (150, 110)
TURN = pv.Transform().rotate_x(30).scale(0.8).translate(2.5, 0.3, 0.0).matrix
POSES = np.stack([np.eye(4), TURN])
RED_BLUE = np.array([[255, 0, 0], [0, 0, 255]], np.uint8)


def mixed(box=True):
    parts = [pv.Line((0, 0, 0.5), (0, 0, 2.0)), pv.PolyData([[0.4, 0.0, 1.5], [-0.4, 0.0, 1.7]])]
    parts += [pv.Cube().extract_surface(algorithm=None)] * box
    return pv.merge(parts, merge_points=False).extract_surface(algorithm=None)


def stage(add):
    pl = pv.Plotter(off_screen=True, window_size=SIZE)
    add(pl)
    pl.camera_position = [(2, -9, 3), (1.2, 0, 0.8), (0, 0, 1)]
    return pl, shot(pl)


def primitives(path):
    """Return mode, lowest and highest position, and colours or None of each primitive."""
    file, body = document(path)
    accessors, views = file['accessors'], file['bufferViews']

    def numbers(index):
        accessor = accessors[index]
        view = views[accessor['bufferView']]
        kind = {5126: np.float32, 5125: np.uint32}[accessor['componentType']]
        start = view.get('byteOffset', 0) + accessor.get('byteOffset', 0)
        width = {'VEC3': 3, 'VEC4': 4, 'VEC2': 2, 'SCALAR': 1}[accessor['type']]
        flat = np.frombuffer(body, kind, accessor['count'] * width, start)
        return flat.reshape(-1, width)

    middle = file['nodes'][file['scenes'][0]['nodes'][0]]['translation']
    middle = np.array([middle[0], -middle[2], middle[1]])  # y up
    for mesh in file['meshes']:
        for primitive in mesh['primitives']:
            own = primitive['attributes']
            used = numbers(primitive['indices']).ravel()
            colors = numbers(own['COLOR_0'])[used] if 'COLOR_0' in own else None
            yield primitive.get('mode', 4), numbers(own['POSITION'])[used] + middle, colors


@pytest.mark.parametrize('colors', [None, RED_BLUE])
def test_of_instances(tmp_path, colors):
    look = {'line_width': 4, 'point_size': 8, 'color': 'tan'}
    how = {'colors': colors} if colors is not None else {}
    mesh = mixed()
    pl, shown = stage(lambda pl: pl.ibr.add_instances(mesh, POSES, **look, **how))
    plain = pl.ibr.to_plain_plotter()
    found = shot(plain)
    plain.close()
    seen = shown[:60], found[:60]  # above the boxes
    outline = [(image != image[0, 0]).any(2) for image in seen]
    assert outline[0].sum() > 100
    assert (outline[0] != outline[1]).mean() < 0.004
    pl.ibr.export_glb(tmp_path / 'scene.glb')
    by_mode = {mode: (points, tint) for mode, points, tint in primitives(tmp_path / 'scene.glb')}
    assert set(by_mode) == {0, 1, 4}
    ends = np.array([[0, 0, 0.5], [0, 0, 2.0]]), np.array([[0.4, 0, 1.5], [-0.4, 0, 1.7]])
    for mode, own in ((1, ends[0]), (0, ends[1])):
        points, tint = by_mode[mode]
        wanted = [own @ m[:3, :3].T + m[:3, 3] for m in POSES]
        for two, right in zip(points.reshape(2, 2, 3), wanted, strict=True):
            rows = np.argsort(two[:, 2])
            np.testing.assert_allclose(two[rows], right[np.argsort(right[:, 2])], atol=1e-5)
        if colors is not None:
            np.testing.assert_allclose(tint[:, :3], np.repeat(colors / 255, 2, 0), atol=1e-6)


@pytest.mark.parametrize('box', [True, False])
def test_of_actors_that_were_moved(tmp_path, box):
    pl, _ = stage(lambda pl: pl.add_mesh(mixed(box), user_matrix=TURN))
    pl.ibr.export_glb(tmp_path / 'scene.glb')
    found = {mode: points for mode, points, _ in primitives(tmp_path / 'scene.glb')}
    assert set(found) == {0, 1, 4} - ({4} if not box else set())
    line = np.array([[0, 0, 0.5], [0, 0, 2.0]]) @ TURN[:3, :3].T + TURN[:3, 3]
    np.testing.assert_allclose(found[1], line, atol=1e-5)


def test_of_instances_that_have_nothing_else(tmp_path):
    pl, _ = stage(lambda pl: pl.ibr.add_instances(mixed(box=False), POSES))
    pl.ibr.export_glb(tmp_path / 'scene.glb')
    found = {mode: points for mode, points, _ in primitives(tmp_path / 'scene.glb')}
    assert set(found) == {0, 1}
    assert [len(points) for points in found.values()] == [4, 4]
