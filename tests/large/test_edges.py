"""Edges of the mesh's own faces, where these are as large as some pixels."""

import numpy as np
import pytest
import pyvista as pv
from scipy.ndimage import binary_dilation

from pvibr.large.original_cells import edge_flags
from pvibr.large.sources import source_of
from tests.large.looks import FAR, NEAR, OVER, drawn, pictures
from tests.large.surfaces import terrain
from tests.pictures import off, place, shot


def quads():
    """Return the terrain as a structured grid, with values of its cells."""
    count = int(terrain().n_points ** 0.5)
    points = np.asarray(terrain().points).reshape(count, count, 3)
    grid = pv.StructuredGrid(*points.transpose(2, 0, 1)[..., None])
    grid.cell_data['stripes'] = np.arange(grid.n_cells) % 7
    return grid


LOOKS = {
    'triangles': (terrain, {'color': 'tan'}),
    'quads': (quads, {'color': 'tan', 'line_width': 2, 'edge_color': 'red'}),
    'values of cells': (quads, {'scalars': 'stripes', 'edge_opacity': 0.5}),
    'values of points': (terrain, {'scalars': 'height', 'smooth_shading': True}),
}


@pytest.mark.parametrize('view', [NEAR, OVER], ids=['near', 'over'])
@pytest.mark.parametrize('look', LOOKS)
def test_without_error_edges_are_those_of_the_mesh(look, view):
    make, kwargs = LOOKS[look]
    kwargs = kwargs | {'show_edges': True, 'view': view, 'max_error': 0, 'lighting': False}
    picture, truth, _ = pictures(make(), **kwargs)
    # Quads that are not flat are divided along the other diagonal.
    assert (off(picture, truth) > 20).mean() < 0.04
    plain, _, _ = pictures(make(), **kwargs | {'show_edges': False})
    assert (off(picture, plain) > 20).mean() > 0.15


def dark(picture, rows):
    """Return the share of black pixels in some rows."""
    return (picture[rows].max(-1) < 60).mean()


def test_edges_fade_out_where_faces_are_small():
    look = {'color': 'white', 'lighting': False, 'show_edges': True}
    near, truth, thing = pictures(quads(), view=NEAR, **look)
    foreground = np.s_[140:]
    assert dark(near, foreground) == pytest.approx(dark(truth, foreground), rel=0.05)
    assert thing.report()['triangles'] < thing.n_triangles
    far, truth, thing = pictures(quads(), view=FAR, **look)
    assert dark(far, np.s_[:]) == 0
    assert dark(truth, np.s_[:]) > 0.01


@pytest.mark.parametrize('way', ['perspective', 'parallel', 'ssaa'])
def test_edges_fade_by_size_not_by_patch(way):
    """Faces of one size have equal edges, wherever patches end."""
    plane = pv.Plane(i_resolution=60, j_resolution=60)
    shares = []
    for distance in (0.3, 0.9, 1.5):
        view = {'eye': (0.0, -distance, distance), 'focus': (0.0, 0.0, 0.0)}
        look = {'color': 'white', 'lighting': False, 'show_edges': True, 'view': view}
        pl, _ = drawn(plane, size=(320, 160), **look)
        if way == 'ssaa':
            pl.enable_anti_aliasing('ssaa')
        if way == 'parallel':
            place(pl, **view, parallel=0.27 * distance)
        black = 255 - shot(pl)[..., 1].astype(float)
        black[(shot(pl) == (255, 0, 255)).all(-1)] = 0
        rows = black.reshape(8, 20, 2, 160).mean((1, 3))
        shares.append(rows.mean())
        np.testing.assert_allclose(rows[:, 0], rows[:, 1], atol=4)
        if way == 'parallel' and distance < 1:
            assert np.ptp(rows[1:-1].mean(1)) < 12
    assert shares[2] < 0.4 * max(shares[:2])


@pytest.mark.parametrize('samples', [0, 8])
def test_hidden_edges_leave_no_dots(samples):
    shown = []
    for edges in (True, False):
        pl, _ = drawn(quads(), color='white', lighting=False, view=FAR, show_edges=edges)
        pl.render_window.SetMultiSamples(samples)
        shown.append(shot(pl))
    edged, plain = shown
    is_inside = (plain == 255).all(-1)
    assert is_inside.mean() > 0.04
    assert edged[is_inside].min() > 250


def test_flat_faces_show_their_edges():
    plane = pv.Plane(i_resolution=100, j_resolution=100)
    view = {'eye': (0.0, -0.2, 0.3), 'focus': (0.0, 0.0, 0.0)}
    look = {'color': 'white', 'show_edges': True, 'lighting': False}
    picture, truth, _ = pictures(plane, view=view, **look)
    assert (off(picture, truth) > 20).mean() < 0.02


def test_switched_on_and_off():
    pl, thing = drawn(quads(), view=NEAR, color='white', lighting=False)
    without = shot(pl)
    thing.prop.show_edges = True
    assert dark(shot(pl), np.s_[140:]) > 0.05
    thing.prop.show_edges = False
    np.testing.assert_array_equal(shot(pl), without)


def test_diagonals_of_polygons_are_no_edges():
    pentagon = [(np.cos(a), np.sin(a), 0) for a in np.arange(5) * 2 * np.pi / 5]
    mesh = pv.PolyData(np.array([*pentagon, (2, 0, 0)]), [5, 0, 1, 2, 3, 4, 3, 0, 5, 1])
    source = source_of(mesh)
    shown = (source.mesh.edge_flags[:, None] >> np.arange(3)) & 1 > 0
    faces = source.mesh.faces
    edges = np.sort(np.stack([faces, np.roll(faces, -1, 1)], 2)[shown], axis=1)
    assert {tuple(e) for e in edges.tolist()} == {
        *((0, 1), (1, 2), (2, 3), (3, 4), (0, 4)),
        *((0, 5), (1, 5)),
    }
    assert edge_flags(np.array([[0, 1, 2]]), np.array([0])).tolist() == [7]


def test_edges_of_volumes():
    """Two faces of one cell meet in an edge that shows."""
    grid = pv.ImageData(dimensions=(6, 6, 6), spacing=(0.2,) * 3)
    view = {'eye': (3, 2.5, 2), 'focus': (0.5, 0.5, 0.5)}
    look = {'color': 'white', 'show_edges': True, 'lighting': False}
    picture, truth, _ = pictures(grid, view=view, **look)
    assert (off(picture, truth) > 20).mean() < 0.01


def test_exported_as_lines():
    pl, _ = drawn(quads(), view=NEAR, color='white', lighting=False, show_edges=True)
    copy = pl.ibr.to_plain_plotter()
    place(copy, **NEAR)
    copy.show(auto_close=False)
    edges, found = (shot(p)[140:].max(-1) < 60 for p in (pl, copy))
    wide = np.ones((3, 3))
    assert (found & ~binary_dilation(edges, wide)).sum() < 0.1 * found.sum(), 'diagonals'
    assert (edges & ~binary_dilation(found, wide)).sum() < 0.05 * edges.sum()
