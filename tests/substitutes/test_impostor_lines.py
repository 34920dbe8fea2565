"""Edges, lines and points in images: where they are, how wide, how smooth, in which colours."""

import numpy as np
import pytest
import pyvista as pv
from scipy.ndimage import label

from pvibr.core import _vtk
from pvibr.maths.flip import flip
from tests.pictures import place, plotter, shot, uncut

SIZE = 240, 180
LATTICE = pv.CylinderStructured(
    radius=[0.7, 0.71], height=2.0, theta_resolution=16, z_resolution=2, direction=(0, 0, 1)
).extract_surface(algorithm=None)


def orbit(step, radius=9.0):
    angle = np.radians(0.25 * step)
    return radius * np.cos(angle), radius * np.sin(angle), 1.5


def lined_actors(pl):
    """Add one actor of each kind that draws lines or points."""
    ball = pv.Sphere(theta_resolution=12, phi_resolution=12)
    cylinder = pv.Cylinder(resolution=20)
    grid = pv.ImageData(dimensions=(4, 4, 4), spacing=(0.3,) * 3).cast_to_unstructured_grid()
    values = np.arange(grid.n_cells, dtype=float)
    points = np.random.default_rng(0).normal(size=(12, 3)) * 0.4
    meshes = [
        (ball, {'color': 'tan', 'show_edges': True, 'edge_color': 'red', 'line_width': 2}),
        (pv.Box(), {'color': 'blue', 'show_edges': True, 'lighting': False, 'line_width': 3}),
        (ball, {'style': 'wireframe', 'color': 'green', 'line_width': 2}),
        (ball, {'style': 'points', 'color': 'green', 'point_size': 5}),
        (ball, {'style': 'wireframe', 'color': 'green', 'smooth_shading': True}),
        (cylinder, {'color': 'white'}),
        (cylinder.extract_feature_edges(), {'color': 'black', 'line_width': 2}),
        (grid, {'show_edges': True, 'scalars': values, 'edge_opacity': 0.5}),
        (pv.MultipleLines(points), {'color': 'purple', 'line_width': 2}),
    ]
    places = [(1.6 * (k % 3 - 1), 0, 1.6 * (k // 3 - 1)) for k in (0, 1, 2, 3, 4, 5, 5, 6, 7)]
    return [
        pl.add_mesh(mesh.scale(0.6).translate(where), show_scalar_bar=False, **look)
        for (mesh, look), where in zip(meshes, places, strict=True)
    ]


def beside_meshes(pl, actors, **settings):
    """Return pictures of actors and of their images, after all have got images."""
    plain = shot(pl)
    impostor = pl.ibr.add_impostor(actors, only_if_faster=False, **settings)
    pl.render()
    images = shot(pl)
    assert impostor.report()['meshes'] == {}
    return plain, images


def look_in_perspective(pl):
    place(pl, (2, -12, 3), angle=25)


def look_in_parallel(pl):
    place(pl, (2, -12, 3), parallel=2.8)


def look_supersampled(pl):
    look_in_perspective(pl)
    pl.enable_anti_aliasing('ssaa')


def look_peeled(pl):
    look_in_perspective(pl)
    pl.disable_anti_aliasing()
    pl.render_window.SetMultiSamples(0)
    pl.enable_depth_peeling()
    pl.add_mesh(
        pv.Cube(center=(0, -2, 0), x_length=2, y_length=0.1, z_length=2),
        color='yellow',
        opacity=0.4,
    )


LOOKS = look_in_perspective, look_in_parallel, look_supersampled, look_peeled


@pytest.mark.parametrize('look', LOOKS)
@pytest.mark.parametrize('samples', [0, 8])
def test_lines_and_points_look_as_those_of_meshes(look, samples):
    pl = plotter((320, 240))
    pl.render_window.SetMultiSamples(samples)
    actors = lined_actors(pl)
    look(pl)
    pl.show(auto_close=False)
    plain, images = beside_meshes(pl, actors)
    seen = (plain != plain[0, 0]).any(-1)
    off = np.abs(plain - images).max(-1)
    assert off[seen].mean() < (16 if samples else 24)
    # As much of each colour: lines are neither thinner nor bolder.
    totals = [(255 - p).sum((0, 1)).astype(float) for p in (plain, images)]
    np.testing.assert_allclose(totals[0], totals[1], rtol=0.03)


def test_lines_in_subplots_and_images_of_several_actors():
    pl = pv.Plotter(off_screen=True, window_size=(500, 180), shape=(1, 2))
    actors = {}
    for side in range(2):
        pl.subplot(0, side)
        actors[side] = lined_actors(pl)
        look_in_perspective(pl)
    pl.show(auto_close=False)
    plain = shot(pl)
    for side, hierarchical in enumerate((False, True)):
        pl.subplot(0, side)
        pl.ibr.add_impostor(actors[side], only_if_faster=False, hierarchical=hierarchical)
    pl.render()
    off = np.abs(shot(pl) - plain).max(-1)
    assert off.mean() < 4
    assert off.max() > 0


@pytest.mark.parametrize('samples', [0, 8])
@pytest.mark.parametrize('width', [1.0, 2.0, 4.0])
def test_lines_move_with_their_surface(width, samples):
    plain, images = (pv.Plotter(off_screen=True, window_size=SIZE) for _ in range(2))
    rendered = []
    for pl in (plain, images):
        pl.render_window.SetMultiSamples(samples)
        look = {'color': 'white', 'lighting': False, 'show_edges': True, 'line_width': width}
        actor = pl.add_mesh(LATTICE, **look)
        if pl is images:
            impostor = pl.ibr.add_impostor(actor, only_if_faster=False)
        pl.show(auto_close=False)
    for step in range(24):
        for pl in (plain, images):
            place(pl, orbit(step))
        lines = [1 - uncut(pl)[70:110, :, 1] / 255.0 for pl in (plain, images)]
        rendered.append(impostor.rendered)
        assert impostor.report()['meshes'] == {}
        shifts, widths = shifts_along_rows(width, *lines)
        assert len(shifts) > 150
        assert np.percentile(np.abs(shifts), 97) < 0.5
        assert np.median(np.abs(shifts)) < 0.15
        assert np.mean(widths[1]) == pytest.approx(np.mean(widths[0]), rel=0.15)
    assert np.diff(rendered).sum() < 8  # most frames show an image of another eye


def shifts_along_rows(width, *lines):
    """Return how far lines apart are in the second picture from the first, and their widths."""
    shifts, widths = [], []
    for pair in zip(*lines, strict=True):
        segments, count = label(np.maximum(*pair) > 0.05)
        sums = [np.bincount(segments, row, count + 1)[1:] for row in pair]
        # Not those that touch others at the outline.
        is_line = np.abs(np.log(np.add(sums, 1e-3) / width)).max(0) < np.log(1.4)
        column = np.arange(len(segments))
        moments = [np.bincount(segments, row * column, count + 1)[1:] for row in pair]
        centers = [m[is_line] / total[is_line] for m, total in zip(moments, sums, strict=True)]
        shifts += (centers[1] - centers[0]).tolist()
        widths += np.transpose(sums)[is_line].tolist()
    return np.array(shifts), np.array(widths).T


def test_lines_stay_as_wide_when_the_eye_comes_and_goes():
    pl = pv.Plotter(off_screen=True, window_size=SIZE)
    look = {'color': 'white', 'lighting': False, 'show_edges': True, 'line_width': 3}
    actor = pl.add_mesh(LATTICE, **look)
    pl.show(auto_close=False)
    impostor = pl.ibr.add_impostor(actor, only_if_faster=False, max_error=2.0)
    for away in (9.0, 10.0, 12.0, 18.0, 13.0, 8.0):
        place(pl, orbit(0, away))
        images = 255 - uncut(pl)
        impostor.enabled = False
        plain = 255 - uncut(pl)
        impostor.enabled = True
        assert images.sum() == pytest.approx(plain.sum(), rel=0.1)


def test_planes_cut_lines():
    pl = plotter((320, 240))
    actors = lined_actors(pl)
    look_in_perspective(pl)
    plane = _vtk.vtkPlane()
    plane.SetNormal(-1, 0, 0.2)
    for actor in actors:
        actor.mapper.AddClippingPlane(plane)
    pl.show(auto_close=False)
    impostor = pl.ibr.add_impostor(actors, only_if_faster=False)
    pl.render()
    pl.render()
    images = shot(pl)
    told = impostor.report()['meshes']
    impostor.enabled = False
    off = np.abs(images - shot(pl)).max(-1)
    assert set(told) <= {'clipped away'}
    assert off.mean() < 4


def test_outlines_and_edges_are_as_smooth_as_those_of_meshes():
    pictures = {}
    for kind, scale in {'fine': 3, 'plain': 1, 'images': 1}.items():
        pl = pv.Plotter(off_screen=True, window_size=(320 * scale, 240 * scale))
        rng = np.random.default_rng(4)
        actors = []
        for k in range(36):
            shape = (pv.Cylinder(resolution=24), pv.Cube(), pv.Sphere(radius=0.6))[k % 3]
            shape = shape.rotate_vector(rng.normal(size=3), rng.uniform(0, 360))
            look = {'show_edges': True, 'line_width': scale} if k % 4 == 0 else {}
            where = 1.6 * np.array([k % 6 - 2.5, rng.uniform(-1, 1), k // 6 - 2.5])
            actors.append(
                pl.add_mesh(shape.translate(where), color=rng.uniform(0.3, 1, 3), **look)
            )
        place(pl, (0, -22, 2))
        pl.show(auto_close=False)
        if kind == 'images':
            pl.ibr.add_impostor(actors, only_if_faster=False)
        for step in range(5):
            place(pl, (0.1 * step, -22, 2))
            picture = uncut(pl) / 255.0
        pictures[kind] = picture.reshape(240, scale, 320, scale, 3).mean((1, 3))
    errors = {k: flip(pictures[k], pictures['fine']).mean() for k in ('plain', 'images')}
    assert errors['images'] < 1.25 * errors['plain']


def test_tubes_and_spheres_stay_meshes_and_the_report_says_so():
    pl = plotter()
    tubes = pl.add_mesh(pv.Line(), render_lines_as_tubes=True, line_width=5)
    impostor = pl.ibr.add_impostor(tubes, only_if_faster=False)
    pl.show(auto_close=False)
    assert impostor.report()['meshes'] == {'tubes or spheres': 1}


def test_picks_hit_the_actor_whose_lines_an_image_shows():
    pl = plotter()
    actor = pl.add_mesh(pv.Sphere(), show_edges=True)
    place(pl, (0, -6, 0))
    impostor = pl.ibr.add_impostor(actor, only_if_faster=False)
    pl.show(auto_close=False)
    assert impostor.report()['images'] == 1
    assert pl.ibr.pick(60, 45).actor is actor
