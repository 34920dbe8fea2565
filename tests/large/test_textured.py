"""Textures by the mesh's own coordinates: seams stay, and nothing slides on the surface."""

from dataclasses import replace

import numpy as np
import pytest
import pyvista as pv
import trimesh
from PIL import Image

from pvibr.core.errors import PvibrError
from pvibr.instances.cache import AtlasCache
from pvibr.large import large_mesh as module
from pvibr.large import stored
from pvibr.large.build import build_hierarchy
from pvibr.large.build_job import BuildJob
from pvibr.large.checked_file import open_checked, write_checked
from pvibr.large.cut import cell_pixels, gathered, gathered_coordinates, patches_within
from pvibr.large.sources import source_of
from pvibr.large.textured_cell import closest_weights
from pvibr.maths.flip import flip
from tests.large.looks import FAR, NEAR, OVER, SIZE, drawn, pictures
from tests.large.surfaces import terrain, views_of
from tests.large.textured import charts, checks, globe, photograph
from tests.pictures import off, place, plotter, shot
from tests.refusals import refused

BALL = {
    'near': {'eye': (1.3, -0.6, 0.9), 'focus': (0.6, -0.3, 0.6)},
    'middle': {'eye': (3, -1.2, 1.4), 'focus': (0, 0, 0)},
    'pole': {'eye': (0.3, -0.2, 2.2), 'focus': (0, 0, 0.9)},
    'far': {'eye': (9, -3, 4), 'focus': (0, 0, 0)},
}
GROUND = {'near': NEAR, 'middle': OVER, 'far': FAR}
CASES = [
    *((globe, name, view) for name, view in BALL.items()),
    *((charts, name, view) for name, view in GROUND.items()),
]
IDS = [f'{make.__name__}, {name}' for make, name, _ in CASES]
LOOK = {'smooth_shading': True}


def texture():
    image = pv.Texture(photograph())
    image.mipmap = image.interpolate = True
    return image


@pytest.mark.parametrize(('make', 'name', 'view'), CASES, ids=IDS)
def test_it_is_the_mesh_without_error_and_looks_alike_with(make, name, view):
    # The normals of meshes with several charts differ along seams, which a large mesh smooths.
    look = {'texture': texture(), 'view': view, 'lighting': False if make is charts else None}
    picture, truth, _ = pictures(make(), max_error=0, **look, **LOOK)
    assert (off(picture, truth) > 3).mean() < 3e-3
    coarse, _, thing = pictures(make(), max_error=1, **look, **LOOK)
    assert thing.report()['triangles'] < 0.5 * thing.n_triangles
    assert np.abs(coarse - truth).mean() < 3


@pytest.mark.parametrize('max_error', [0.5, 2.0, 8.0])
def test_triangles_stay_in_their_charts(max_error):
    mesh, tiles = charts(), 5
    hierarchy = build_hierarchy(source_of(mesh).mesh)
    for view in views_of(hierarchy, 6):
        patches = patches_within(hierarchy, cell_pixels(hierarchy, view), max_error)
        _, triangles = gathered(hierarchy, patches)
        places = gathered_coordinates(hierarchy, patches)[triangles] * tiles
        tile = np.floor(places.mean(1))
        inside = (np.abs(places - tile[:, None] - 0.5) <= 0.5).all((1, 2))
        assert inside.all()


@pytest.mark.parametrize('triangles', [2**17, 2**13], ids=['one block', 'blocks'])
def test_seams_cost_little(triangles, monkeypatch):
    """Samples are compared on their own side of a seam, also where cells and blocks end."""
    for name in ('build', 'distribution'):
        monkeypatch.setattr(f'pvibr.large.{name}.BLOCK_TRIANGLES', triangles)
    mesh = source_of(charts()).mesh
    textured, plain = (build_hierarchy(m) for m in (mesh, replace(mesh, texture_coordinates=None)))
    assert np.median(textured.errors) < 2 * np.median(plain.errors)
    assert textured.errors.max() < 4 * plain.errors.max()


def test_nothing_slides():
    """Texture coordinates that are places stay those of the surface, at every level."""
    mesh = terrain().copy()
    places = np.asarray(mesh.points)[:, :2]
    mesh.active_texture_coordinates = places.copy()
    hierarchy = build_hierarchy(source_of(mesh).mesh)
    for patch in range(len(hierarchy.patch_cells)):
        own = slice(*hierarchy.vertex_starts[patch : patch + 2])
        points = hierarchy.points[hierarchy.vertices[own]] + hierarchy.origin
        slides = np.linalg.norm(points[:, :2] - hierarchy.texture_coordinates[own], axis=1)
        maker = hierarchy.patch_cells[patch, 0]
        error = hierarchy.errors[maker] if maker >= 0 else 1e-6
        assert np.percentile(slides, 98) <= max(error, 1e-6)


def test_flat_surface_whose_picture_is_bent():
    """Nothing is lost by fewer triangles but the texture, and so they stay."""
    mesh = pv.Plane(i_resolution=150, j_resolution=150).triangulate()
    x, y = np.asarray(mesh.points)[:, :2].T
    bent = np.stack([x + 0.05 * np.sin(20 * y), y + 0.05 * np.sin(20 * x)], 1) + 0.5
    mesh.active_texture_coordinates = bent
    image = pv.Texture(checks())
    view = {'eye': (0.0, -0.6, 0.9), 'focus': (0.0, 0.0, 0.0)}
    picture, truth, thing = pictures(mesh, view=view, texture=image, max_error=1.2)
    assert 500 < thing.report()['triangles'] < 0.8 * thing.n_triangles
    assert flip(picture / 255, truth / 255).mean() < 0.02
    straight = mesh.copy()
    straight.active_texture_coordinates = np.stack([x, y], 1) + 0.5
    picture, truth, thing = pictures(straight, view=view, texture=image, max_error=1.0)
    assert thing.report()['triangles'] < 0.15 * thing.n_triangles
    assert (off(picture, truth) > 8).mean() < 0.01


def test_one_colour_each():
    """Triangles that each show one texel have no size in the picture."""
    mesh = terrain().copy()
    centers = mesh.cell_centers().points
    kinds = (centers[:, 0] * 8).astype(int) % 4
    points, faces = mesh.points[mesh.regular_faces].reshape(-1, 3), np.arange(3 * mesh.n_cells)
    palette = pv.PolyData.from_regular_faces(points, faces.reshape(-1, 3))
    coordinates = np.repeat(np.c_[kinds / 4 + 0.125, np.full(len(kinds), 0.5)], 3, axis=0)
    palette.active_texture_coordinates = coordinates
    image = pv.Texture(np.array([[(200, 0, 0), (0, 200, 0), (0, 0, 200), (90, 90, 0)]], np.uint8))
    image.interpolate = False
    picture, truth, thing = pictures(palette, texture=image, max_error=1.0, **LOOK)
    assert thing.report()['triangles'] < 0.7 * thing.n_triangles
    assert (off(picture, truth) > 40).mean() < 0.02


def test_weights_are_those_of_the_closest_point():
    rng = np.random.default_rng(0)
    corners, places = rng.random((500, 3, 3)), 2 * rng.random((500, 3)) - 0.5
    corners[:20, 2] = corners[:20, 1]  # without an area
    weights = closest_weights(places, corners)
    np.testing.assert_allclose(weights.sum(1), 1)
    assert weights.min() >= 0
    own = np.einsum('ij,ijk->ik', weights, corners)
    truth = trimesh.triangles.closest_point(corners[20:], places[20:])
    np.testing.assert_allclose(own[20:], truth, atol=1e-9)


def test_seams_have_no_cracks():
    hierarchy = build_hierarchy(source_of(globe()).mesh)
    for view in views_of(hierarchy, 8):
        patches = patches_within(hierarchy, cell_pixels(hierarchy, view), 1.0)
        vertices, triangles = gathered(hierarchy, patches)
        corners = vertices[triangles]
        ends = np.sort(np.stack([corners, np.roll(corners, -1, 1)], 2).reshape(-1, 2), 1)
        _, counts = np.unique(ends, axis=0, return_counts=True)
        assert (counts == 2).all()


def test_other_scalars_replace_it():
    mesh = globe().copy()
    mesh['z'] = np.asarray(mesh.points)[:, 2]
    pl, thing = drawn(mesh, view=BALL['middle'], texture=texture(), max_error=0)
    thing.set_scalars('z')
    other, _ = drawn(mesh, view=BALL['middle'], large=False, scalars='z')
    assert (off(shot(pl), shot(other)) > 3).mean() < 3e-3


def test_file_and_job_keep_it(tmp_path, monkeypatch):
    path = globe().ibr.large(tmp_path / 'a.pvl', progress=False)
    look = {'view': BALL['middle'], 'texture': texture()}
    (from_file, _), (from_mesh, _) = (drawn(m, **look) for m in (path, globe()))
    np.testing.assert_array_equal(shot(from_file), shot(from_mesh))
    mesh = source_of(globe()).mesh
    job = BuildJob(mesh, 32 * 'a', AtlasCache(tmp_path))
    assert job.wait(60)
    hierarchy = job.newest('globe')
    assert len(hierarchy.texture_coordinates) == len(hierarchy.vertices)
    monkeypatch.setattr(module, '_SMALL', 1000)
    drafted, thing = drawn(globe(), wait=False, cache=False, **look)
    assert (off(shot(drafted), shot(from_mesh)) > 3).mean() < 3e-3
    assert not thing.is_draft
    entry = open_checked(path)
    forged = dict(entry) | {'texture_coordinates': entry['texture_coordinates'][:-1]}
    forged_path = tmp_path / 'forged.pvl'
    write_checked(forged_path, {name: [array] for name, array in forged.items()}, entry.meta)
    refused('belong together', stored.load, forged_path, kind=PvibrError)


def test_mesh_without_coordinates_is_refused(tmp_path):
    refused('texture coordinates', drawn, terrain(), texture=texture(), kind=ValueError)
    path = terrain().ibr.large(tmp_path / 'a.pvl', progress=False)
    refused('texture coordinates', drawn, path, texture=texture(), kind=ValueError)


def textured_trimesh():
    mesh = globe()
    material = trimesh.visual.material.PBRMaterial(baseColorTexture=Image.fromarray(photograph()))
    coordinates = np.asarray(mesh.active_texture_coordinates)
    visual = trimesh.visual.TextureVisuals(coordinates, material)
    return trimesh.Trimesh(mesh.points, mesh.regular_faces, visual=visual, process=False)


def test_files_with_one_material(tmp_path):
    mesh = textured_trimesh()
    look = {'view': BALL['middle'], 'smooth_shading': True, 'max_error': 0}
    expected, _ = drawn(globe(), texture=texture(), **look)
    mesh.export(tmp_path / 'a.glb')
    for source in (mesh, tmp_path / 'a.glb'):
        found, _ = drawn(source, **look)
        assert np.abs(shot(found) - shot(expected)).mean() < 2


@pytest.mark.parametrize('pbr', [False, True])
def test_materials_are_those_of_instances(pbr, tmp_path):
    textured_trimesh().export(tmp_path / 'a.glb')
    pl = plotter(SIZE)
    pl.ibr.add_instances(tmp_path / 'a.glb', [[0, 0, 0]], pbr=pbr, smooth_shading=True)
    pl.set_background('magenta')
    place(pl, **BALL['middle'])
    pl.show(auto_close=False)
    look = {'view': BALL['middle'], 'smooth_shading': True, 'max_error': 0, 'pbr': pbr}
    found, _ = drawn(tmp_path / 'a.glb', **look)
    assert np.abs(shot(found) - shot(pl)).mean() < 1
