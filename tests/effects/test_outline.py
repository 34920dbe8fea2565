"""Outlines: where the silhouette is, nowhere else, as wide as asked for."""

import numpy as np
import pytest
import pyvista as pv
from scipy.spatial import cKDTree

import pvibr
from benchmarks.effects.outline import MESHES, agreement, contour, inner
from pvibr.gl import scene_pass
from pvibr.things import buffers
from tests import makers
from tests.pictures import shown
from tests.refusals import refused

pytestmark = pytest.mark.sampled

SIZE = (320, 240)
RED = (1.0, 0.0, 0.0)


def plotter(*meshes, **look):
    pl = pv.Plotter(window_size=SIZE)
    for mesh in meshes:
        pl.add_mesh(mesh, color='white', **look)
    pl.set_background('gray')
    pl.camera_position = [(1.4, -2.2, 1.5), (0, 0, 0), (0, 0, 1)]
    pl.camera.clipping_range = (1, 10)
    return pl


def red(image):
    """Where red is drawn on gray and white, half at least."""
    return image[..., 0] - image[..., 1] > 120


@pytest.mark.parametrize(
    ('where', 'depth', 'look', 'least'),
    [(contour, False, {'lighting': False}, 0.95), (inner, True, {}, 0.9)],
    ids=['silhouette', 'inner edges'],
)
@pytest.mark.parametrize('name', MESHES)
def test_lines_are_where_the_polylines_are(name, where, depth, look, least):
    mesh = MESHES[name].triangulate()
    pl = plotter(mesh, **look)
    pl.ibr.add(pvibr.Outline(width=2, color=RED, depth=depth, normal=False))
    precision, recall = agreement(red(shown(pl)), where(mesh, pl.camera, SIZE))
    assert precision >= 0.95
    assert recall >= least


@pytest.mark.parametrize('name', MESHES)
def test_polylines_are_around_what_is_covered(name):
    mesh = MESHES[name].triangulate()
    pl = plotter(mesh)
    places = inner(mesh, pl.camera, SIZE)
    off, _ = cKDTree(places).query(contour(mesh, pl.camera, SIZE))
    assert (off <= 0.5).mean() >= 0.98
    every = pvibr.silhouette_lines(mesh, pl.camera, hidden=True, size=SIZE)
    assert cKDTree(mesh.points).query(every.points)[0].max() < 1e-6


@pytest.mark.parametrize('width', [1, 2, 4, 9])
def test_width_is_in_pixels(width):
    pl = plotter(pv.Plane(), lighting=False)
    pl.set_background('white')
    pl.view_xy()
    pl.enable_parallel_projection()
    pl.camera.parallel_scale = 1.0  # a side is 120 pixels
    pl.ibr.add(pvibr.Outline(width=width))
    ink = 1 - shown(pl)[120, :, 0] / 255
    assert ink.sum() == pytest.approx(2 * width, abs=0.02)


def test_planes_have_no_lines_however_grazing():
    pl = plotter(pv.Plane(i_size=40, j_size=40), lighting=False)
    pl.camera_position = [(0, -15, 0.2), (0, 0, 0), (0, 0, 1)]
    pl.camera.clipping_range = (0.1, 100)
    pl.ibr.add(pvibr.Outline(color=RED, ids=False))
    image = shown(pl)
    assert red(image).any()
    assert not red(image)[150:].any()


def test_creases():
    pl = plotter(pv.Cube(), ambient=1.0, diffuse=0.0)
    outline = pl.ibr.add(pvibr.Outline(color=RED, depth=False))
    inside = red(shown(pl))[110:130, 100:220].any()
    outline.crease = 120
    assert inside
    assert not red(shown(pl))[110:130, 130:170].any()


def test_luminance_of_a_flat_picture():
    plane = pv.Plane(i_resolution=2, j_resolution=1)
    plane['v'] = np.repeat([0.0, 0.5], plane.n_cells // 2)
    pl = pv.Plotter(window_size=SIZE, lighting='none')
    pl.add_mesh(plane, scalars='v', cmap='gray', clim=(0, 1), show_scalar_bar=False)
    pl.view_xy()
    only = {'ids': False, 'depth': False, 'normal': False, 'luminance': True}
    outline = pl.ibr.add(pvibr.Outline(color=RED, contrast=0.4, **only))
    assert red(shown(pl))[110:130, 158:162].any()
    outline.contrast = 0.6
    assert not red(shown(pl))[110:130, 150:170].any()


@pytest.mark.parametrize('hidden', ['absent', 'dashed'])
def test_only_the_chosen_and_hidden_parts(hidden):
    pl = plotter()
    chosen = pl.add_mesh(pv.Sphere(center=(0, 1, 0)), color='white')
    pl.add_mesh(pv.Cube(center=(0, 0, 0), x_length=0.6), color='white')
    alone = pl.ibr.add(pvibr.Outline(actors=[chosen], color=RED, hidden=hidden, normal=False))
    drawn = red(shown(pl))
    pl.ibr.remove(alone)
    cube = shown(pl)
    pl.renderer.RemoveActor(pl.renderer.actors[next(reversed(pl.renderer.actors))])
    pl.ibr.add(alone)
    whole = red(shown(pl))
    before = (np.abs(cube - shot_without(pl, alone)).max(2) > 0) & whole
    assert before.sum() > 20
    kept = (drawn & before).sum() / before.sum()
    assert kept < 0.15 if hidden == 'absent' else 0.3 < kept < 0.75
    assert (drawn & ~whole).sum() <= 4  # they touch in a point


def shot_without(pl, effect):
    effect.enabled = False
    image = shown(pl)
    effect.enabled = True
    return image


def test_nothing_else_is_touched():
    pl = plotter(pv.Sphere())
    pl.add_text('text')
    plain = shown(pl)
    clear = pl.screenshot(transparent_background=True).astype(int)
    outline = pl.ibr.add(pvibr.Outline(opacity=0))
    np.testing.assert_array_equal(shown(pl), plain)
    assert pl.ibr.report().rows[0].why == 'opacity is 0'
    outline.opacity = 1.0
    drawn = shown(pl)
    changed = (drawn != plain).any(2)
    assert 100 < changed.sum() < 0.05 * changed.size
    again = pl.screenshot(transparent_background=True).astype(int)
    outside = ~changed
    np.testing.assert_array_equal(again[outside], clear[outside])
    assert (again[changed][:, 3] > 0).all()
    pl.ibr.remove(outline)
    np.testing.assert_array_equal(shown(pl), plain)


def test_instances_that_become_meshes_have_lines_at_once():
    """Meshes share a mapper; that of a new one has no program with numbers yet."""
    pl = pv.Plotter(window_size=SIZE)
    pl.enable_anti_aliasing('msaa')
    places = np.random.default_rng(0).uniform(-190, 190, (60, 3)) * (1, 1, 0)
    cone = pv.Cone(radius=8, height=30, direction=(0, 0, 1))
    pl.ibr.add_instances(cone, places, color='white', bake=True)
    pl.ibr.add(pvibr.Outline(color=RED))
    pl.camera_position = [(-120, -220, 90), (20, 20, 25), (0, 0, 1)]
    pl.show(auto_close=False)
    pl.camera.zoom(3.0)
    found = []
    for _ in range(2):
        pl.render()
        found.append(pl.screenshot().astype(int))
    assert red(found[0]).sum() > 100
    np.testing.assert_array_equal(*found)


def test_instances_have_lines_and_ids():
    pl = plotter()
    trees = pl.ibr.add_instances(pv.Sphere(radius=0.2), [(0, 0, 0), (0.6, 0.3, 0)])
    ball = pl.add_mesh(pv.Sphere(radius=0.2, center=(-0.6, 0, 0)))
    pl.ibr.add(pvibr.Outline(actors=[trees], color=RED))
    drawn = red(shown(pl))
    ids = pl.ibr.buffer('id')
    assert pl.ibr.buffer_objects == [ball, trees]
    assert [(ids == k).sum() > 100 for k in (-1, 0, 1)] == [True] * 3
    near = ids == 1
    assert drawn.any()
    assert drawn[~near].sum() < drawn.sum()
    rows, columns = np.nonzero(drawn)
    inside = np.stack(np.nonzero(near), 1)
    assert cKDTree(inside).query(np.stack([rows, columns], 1))[0].max() <= 2


def test_bad_input():
    pl, other = plotter(pv.Sphere()), plotter(pv.Sphere())
    refused(r'actors must be .* got 3', pvibr.Outline, kind=TypeError, actors=[3])
    with pytest.raises(ValueError, match='must be in this subplot'):
        pl.ibr.add(pvibr.Outline(actors=list(other.renderer.actors.values())))
    assert not pl.ibr.effects
    refused(r'Outline\.width must be .*, got 99', pvibr.Outline, width=99)


def test_edges_can_be_shown():
    pl = plotter(pv.Sphere())
    pl.ibr.add(pvibr.Outline(color=RED, debug='edges'))
    edges = shown(pl)
    assert (edges.max(2) == 255).sum() < 0.05 * edges[..., 0].size
    assert not edges[..., 2].any()


def test_lines_cross_the_seams_of_tiles():
    pl = plotter(lighting=False)
    pl.add_mesh(pv.Plane(i_size=1.2, j_size=1.2), lighting=False, color='white')
    pl.view_xy()
    pl.enable_parallel_projection()
    pl.camera.parallel_scale = 1.0
    pl.ibr.add(pvibr.Outline(width=6, color=RED))
    shown(pl)
    image = red(pl.screenshot(scale=2))
    # The seams are the middle row and column; there the square's sides are as wide as elsewhere.
    assert image[240].sum() == image[239].sum() == image[200].sum() == 24
    assert image[:, 320].sum() == image[:, 319].sum() == image[:, 280].sum() == 24


ENABLED = {name: makers.ENABLED[name] for name in ('ssaa', 'fxaa', 'edl', 'ssao', 'peeling')} | {
    'msaa': lambda pl: pl.enable_anti_aliasing('msaa', multi_samples=4),
    'gradient': lambda pl: pl.set_background('gray', top='white'),
}


@pytest.mark.parametrize('chosen', [False, True])
@pytest.mark.parametrize('name', ENABLED)
def test_beside_what_plotters_enable(name, chosen):
    mesh = MESHES['torus'].triangulate()
    pl = plotter()
    actor = pl.add_mesh(mesh, color='white')
    pl.add_mesh(pv.Sphere(radius=0.1, center=(0, 0, 0.5)), opacity=0.4)
    ENABLED[name](pl)
    pl.ibr.add(pvibr.Outline(actors=actor if chosen else None, color=RED, normal=False))
    shown(pl)
    pl.render()
    found = agreement(red(pl.screenshot().astype(int)), inner(mesh, pl.camera, SIZE))
    assert min(found) >= 0.9


def test_outlines_and_buffers_share_one_drawing(monkeypatch):
    pl = plotter()
    ball = pl.add_mesh(pv.Sphere())
    outlines = [pvibr.Outline(), pvibr.Outline(actors=ball, width=4), pvibr.Outline(normal=False)]
    for outline in outlines:
        pl.ibr.add(outline)
    drawn = []
    monkeypatch.setattr(buffers.Drawn, 'draw', lambda *_: drawn.append('again'))
    attach = scene_pass.ScenePass.attach_surfaces
    monkeypatch.setattr(
        scene_pass.ScenePass, 'attach_surfaces', lambda *a: drawn.append('with') or attach(*a)
    )
    pl.show(auto_close=False)
    drawn.clear()
    pl.render()
    assert drawn == ['with']
    for outline in outlines:
        outline.ids = outline.depth = outline.normal = False
        outline.luminance = True
    pl.render()
    assert drawn == ['with']
