"""Parts as CAD files have them: slivers that clean() made lines of, edges, struts."""

import numpy as np
import pytest
import pyvista as pv

from pvibr.meshes.surfaces import polygons_of
from pvibr.things.actor_watch import has_strays_only
from tests.pictures import place, plotter, shot


def cleaned(seed, scalars=None):
    """Return a closed ball with lines where triangles were that had no area."""
    rng = np.random.default_rng(seed)
    ball = pv.Sphere(theta_resolution=30, phi_resolution=20)
    points, faces = ball.points.copy(), ball.regular_faces
    for k in rng.choice(len(faces), 6, replace=False):
        points[faces[k][0]] = points[faces[k][1]]
    found = pv.PolyData.from_regular_faces(points, faces).clean()
    assert 6 <= found.n_lines < 30
    if scalars:
        values = found.cell_centers().points[:, 2] > 0
        values[: found.n_lines] = rng.random(found.n_lines) > 0.5
        found.cell_data['half'] = values.astype(float)
    return found


@pytest.mark.parametrize('scalars', [None, 'half'])
@pytest.mark.parametrize('seed', [1, 2])
def test_slivers_take_no_image_away(seed, scalars):
    pl = plotter((200, 150))
    mesh = cleaned(seed, scalars)
    actor = pl.add_mesh(mesh, scalars=scalars, color='tan', show_scalar_bar=False)
    place(pl, (1, -3, 1.5))
    impostor = pl.ibr.add_impostor(actor, only_if_faster=False)
    pl.show(auto_close=False)
    for change in (lambda: None, lambda: mesh.points.__imul__([1, 1, 0.6])):
        change()
        mesh.GetPoints().Modified()
        found = shot(pl)
        assert impostor.report()['meshes'] == {}
        impostor.enabled = False
        plain = shot(pl)
        impostor.enabled = True
        assert (np.abs(found - plain).max(-1) > 60).mean() < 0.01


def test_values_of_cells_stay_with_theirs():
    mesh = cleaned(3)
    mesh['number'] = np.arange(mesh.n_cells)
    kept = polygons_of(mesh)
    assert kept.n_lines == kept.n_verts == 0
    assert kept['number'].tolist() == list(range(mesh.n_lines, mesh.n_cells))
    assert mesh.n_lines > 0
    ball = pv.Sphere()
    assert polygons_of(ball) is ball


def with_lines(*lines):
    mesh = pv.PolyData.from_regular_faces(
        [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0.0], [5, 5, 5]], [[0, 1, 2], [0, 2, 3]]
    )
    mesh.lines = np.concatenate([[len(line), *line] for line in lines])
    return mesh


def test_what_else_there_is_to_see_is_no_stray():
    assert has_strays_only(with_lines((0, 1), (2, 1, 0), (3, 0)))
    for strut in ((1, 3), (0, 4), (0, 1, 3)):
        assert not has_strays_only(with_lines((0, 1), strut))
    pl = plotter((100, 75))
    ball = pv.Sphere(center=(2, 0, 0))
    actors = [
        pl.add_mesh(pv.Sphere(), show_edges=True),
        pl.add_mesh(with_lines((1, 3)).clean()),  # without the far point
        pl.add_mesh(ball, scalars=ball.points[:, 2], opacity='linear', show_scalar_bar=False),
        pl.add_mesh(pv.PolyData(np.eye(3))),
    ]
    pl.camera_position = [(20, -30, 20), (0, 0, 0), (0, 0, 1)]
    impostor = pl.ibr.add_impostor(actors, only_if_faster=False)
    pl.show(auto_close=False)
    told = impostor.report()
    assert told['meshes'] == {'translucent': 1}
    assert told['images'] == 3  # with the lines
    assert set(told['meshes_ms']) == set(told['meshes'])
    assert told['meshes_ms']['translucent'] > 0.05  # a mesh of 1 680 triangles
