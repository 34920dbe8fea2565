"""What is drawn until the hierarchy of a large mesh is built."""

import numpy as np
import pytest
import pyvista as pv
from scipy.ndimage import binary_erosion

import pvibr
from pvibr.large import large_mesh as module
from pvibr.large.cut import gathered
from pvibr.large.draft import _PATCH_TRIANGLES, build_draft
from pvibr.large.full_picking import nearest_triangle
from pvibr.large.large_mesh import LargeMesh
from pvibr.large.sources import source_of
from tests.large.looks import NEAR, OVER, pictures
from tests.large.surfaces import blob, folded, hierarchy_of, terrain, views_of, whole_cut
from tests.large.test_as_a_thing import lit
from tests.large.textured import charts, checks
from tests.pictures import off, shot

#: Start, direction, and first and last distance, about the origin.
RAY = np.array([0.1, -1.0, 0.5]), np.array([-0.1, 1.1, -0.5]), 0.0, np.inf
SURFACES = {'terrain': terrain, 'folded': folded, 'blob': blob}


@pytest.fixture
def drafts(monkeypatch):
    """Drafts in place of hierarchies."""
    monkeypatch.setattr(module, 'built', lambda mesh, *_: build_draft(mesh))
    monkeypatch.setattr(LargeMesh, 'is_draft', True)


def corners(hierarchy, patches):
    """Return the corners of the triangles of patches, (n, 3, 3)."""
    vertices, triangles = gathered(hierarchy, patches)
    return hierarchy.points[vertices[triangles]].astype(float) + hierarchy.origin


@pytest.mark.parametrize('name', SURFACES)
def test_finest_level_is_the_mesh(name):
    mesh = SURFACES[name]()
    draft = build_draft(source_of(mesh).mesh)
    draft.check()
    found = np.unique(draft.mesh_cells, return_index=True)
    np.testing.assert_array_equal(found[0], np.arange(mesh.n_cells))
    own = corners(draft, draft.full_patches)[found[1]]
    np.testing.assert_allclose(own, mesh.points[mesh.regular_faces], atol=1e-6)
    np.testing.assert_allclose(np.ravel(draft.bounds, order='F'), mesh.bounds, atol=1e-6)


@pytest.mark.parametrize('name', SURFACES)
def test_cuts_keep_about_their_error(name):
    mesh = SURFACES[name]()
    draft = build_draft(source_of(mesh).mesh)
    counts = []
    for view in views_of(draft, 6):
        patches = whole_cut(draft, view, 2.0)
        counts.append(int(draft.triangle_counts[patches].sum()))
        cut = corners(draft, patches).reshape(-1, 3)
        cut = pv.PolyData.from_regular_faces(cut, np.arange(len(cut)).reshape(-1, 3))
        points = np.asarray(mesh.points)[::7]
        nearest = cut.find_closest_cell(points, return_closest_point=True)[1]
        distances = np.linalg.norm(points - draft.origin - view.eye, axis=1)
        pixels = np.linalg.norm(nearest - points, axis=1) * view.pixels_per_unit / distances
        assert np.percentile(pixels, 95) < 2
        assert pixels.max() < 10
    assert min(counts) < 0.3 * mesh.n_cells < max(counts)


def test_few_points_of_many():
    mesh = source_of(terrain()).mesh
    draft = build_draft(mesh, 2000)
    draft.check()
    assert 1000 < len(draft.areas) < 4000
    assert len(draft.vertex_of_point) == len(mesh.points)
    shift = draft.points[draft.vertex_of_point] + draft.origin - mesh.points
    assert np.abs(shift).max() < 0.05
    facing = corners(draft, draft.full_patches)
    normals = np.cross(facing[:, 1] - facing[:, 0], facing[:, 2] - facing[:, 0])
    up = normals[:, 2] / np.linalg.norm(normals, axis=1)
    assert (up < -0.5).mean() < 0.001, 'folds are turned'


def test_dense_and_flat_meshes():
    rng = np.random.default_rng(0)
    dense = 1e-3 * rng.random((50_000, 3))
    points = np.concatenate([dense, [[0, 0, 0], [1000, 0, 0], [0, 1000, 0]]])
    faces = np.concatenate([rng.permuted(np.arange(50_001).reshape(-1, 3)), [[0, 50_001, 50_002]]])
    draft = build_draft(source_of(pv.PolyData.from_regular_faces(points, faces)).mesh)
    draft.check()
    assert draft.triangle_counts.max() <= _PATCH_TRIANGLES
    line = np.array([[0.0, 0, 0], [1, 0, 0], [2, 0, 0]])
    build_draft(source_of(pv.PolyData.from_regular_faces(line, [[0, 1, 2]])).mesh).check()


@pytest.mark.parametrize('view', [NEAR, OVER], ids=['near', 'over'])
@pytest.mark.usefixtures('drafts')
def test_no_cracks_between_levels(view):
    for mesh in (terrain(), folded()):
        look = {'color': 'white', 'ambient': 1.0, 'diffuse': 0.0, 'specular': 0.0}
        found, truth, thing = pictures(mesh, view=view, max_error=2.0, **look)
        assert thing.report()['triangles'] < mesh.n_cells
        inside = binary_erosion((truth == 255).all(-1), np.ones((9, 9)))
        assert (found[inside] == 255).all()


@pytest.mark.usefixtures('drafts')
def test_values_of_cells_and_textures():
    mesh = terrain().copy()
    mesh.cell_data['stripes'] = np.arange(mesh.n_cells) // 400 % 7
    look = {'scalars': 'stripes', 'lighting': False}
    found, truth, _ = pictures(mesh, max_error=0.2, **look)
    assert off(found, truth).mean() < 3
    textured = charts()
    look = {'texture': pv.Texture(checks()), 'lighting': False}
    found, truth, thing = pictures(textured, max_error=1.0, **look)
    assert thing.report()['triangles'] < textured.n_cells
    assert off(found, truth).mean() < 6


@pytest.mark.usefixtures('drafts')
def test_shadows_and_picks_of_drafts():
    found, thing = lit(lambda pl: pl.ibr.add(pvibr.Shadows(method='pcf')), large=True)
    truth, _ = lit(lambda pl: pl.ibr.add(pvibr.Shadows(method='pcf')), large=False)
    assert (off(shot(found), shot(truth)) > 24).mean() < 0.03
    thing.max_error = 4.0
    found.render()
    ray = nearest_triangle(thing._built, *RAY)
    assert ray == pytest.approx(nearest_triangle(hierarchy_of(terrain), *RAY))
