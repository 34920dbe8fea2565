"""What cameras see and light reaches, as data: closed forms and rays."""

import numpy as np
import pytest
import pyvista as pv

import pvibr
from benchmarks.common.rays import Rays
from pvibr.maths.camera_views import view_of
from pvibr.maths.orthographic import Orthographic
from pvibr.maths.pinhole import Pinhole
from pvibr.visibility import embree_rays
from pvibr.visibility.surface_samples import Samples, sides_of
from tests.makers import OVER_A_SQUARE, grid, lamp, turn_of
from tests.refusals import refused

ABOVE = Orthographic.from_extent(-1, 1, -1, 1, zmax=5)


def bumpy(offset=0.0):
    mesh = grid(6.0, 80).triangulate()
    x, y, _ = points = np.array(mesh.points, float).T
    points[2] = 0.8 * np.sin(2 * x) * np.cos(1.7 * y)
    mesh.points = points.T + offset * np.array([1.0, -0.7, 0.3]) * 6
    return mesh


def looking(eye, focus, size=(200, 150)):
    eye, focus = np.array(eye, float), np.array(focus, float)
    turn = turn_of(focus - eye)
    K = [[180.0, 0, 99.5], [0, 180.0, 74.5], [0, 0, 1]]
    return Pinhole(K, turn, -turn @ eye, size)


def off_band(mesh, true):
    """Cells whose neighbours by any corner have the same truth."""
    faces = mesh.regular_faces
    low, high = np.full(mesh.n_points, 2.0), np.full(mesh.n_points, -1.0)
    for corner in faces.T:
        np.minimum.at(low, corner, true)
        np.maximum.at(high, corner, true)
    return (low == high)[faces].all(1)


@pytest.mark.parametrize('kind', [tuple, list, dict])
def test_intrinsics_ask_for_the_size_of_their_picture(kind):
    mesh, camera = grid(), looking((0.2, -4, 3), (0, 0, 0))
    bare = {'K': camera.K, 'R': camera.R, 't': camera.t}
    given = bare if kind is dict else kind(bare.values())
    refused('size must be the width and height', pvibr.visible, mesh, given)
    wanted = pvibr.visible(mesh, camera)
    assert 0 < wanted.sum() < len(wanted) or wanted.all()
    np.testing.assert_array_equal(pvibr.visible(mesh, given, size=camera.size), wanted)
    named = bare | {'size': camera.size}
    np.testing.assert_array_equal(pvibr.visible(mesh, named, size=camera.size), wanted)


@pytest.mark.parametrize('to', ['points', 'cells'])
def test_a_roof_hides_what_is_under_it(to):
    mesh = grid(3.0, 41)
    kept = np.array(mesh.points)
    roof = pv.Plane(center=(0, 0, 1), i_size=1, j_size=1)
    seen = pvibr.visible(mesh, ABOVE, casters=[roof], to=to)
    points = mesh.points if to == 'points' else mesh.cell_centers().points
    out = np.abs(points[:, :2]).max(1)
    sure = (np.abs(out - 1) > 0.04) & (np.abs(out - 0.5) > 0.04)
    np.testing.assert_array_equal(seen[sure], ((out > 0.5) & (out < 1))[sure])
    np.testing.assert_array_equal(mesh.points, kept)
    np.testing.assert_array_equal(roof.center, (0, 0, 1))


@pytest.mark.parametrize('offset', [0.0, 1e6, 1e9])
def test_visible_is_as_rays_say(offset):
    mesh = bumpy(offset)
    shift = offset * np.array([1.0, -0.7, 0.3]) * 6
    camera = looking(shift + np.array([-4, -5, 3]), shift)
    samples = Samples.of(mesh, 'cells')
    light = lamp(tuple(camera.position), cone=90)
    normals = samples.turned(camera.toward(samples.points))
    true = Rays([mesh]).lit(samples.points, normals, light)
    uv, _ = camera.project(samples.points)
    true *= ((uv >= 0) & (uv <= 1)).all(1)
    seen = pvibr.visible(mesh, camera, to='cells')
    sure = off_band(mesh, true)
    assert (true[sure] == 1).sum() > 2000
    assert seen[sure & (true == 0)].mean() < 0.003
    assert (~seen[sure & (true == 1)]).mean() < 0.003


def test_a_closed_mesh_is_not_seen_from_behind():
    ball = pv.Sphere(radius=0.5, theta_resolution=40, phi_resolution=40)
    seen = pvibr.visible(ball, ABOVE)
    z = np.asarray(ball.points)[:, 2]
    assert seen[z > 0.05].all()
    assert not seen[z < -0.05].any()
    inside_out = ball.flip_faces()
    np.testing.assert_array_equal(pvibr.visible(inside_out, ABOVE), seen)


def test_points_without_faces_and_volumes():
    cloud = pv.PolyData(np.array([[0.0, 0, 0], [0.8, 0, 0], [3.0, 0, 0]]))
    roof = pv.Plane(center=(0, 0, 1))
    assert pvibr.visible(cloud, ABOVE, casters=[roof]).tolist() == [False, True, False]
    block = pv.ImageData(dimensions=(3, 3, 3), spacing=(0.4, 0.4, 0.4), origin=(-0.4, -0.4, 0))
    seen = pvibr.visible(block, ABOVE, to='cells')
    assert seen.tolist() == [False] * 4 + [True] * 4
    assert pvibr.visible(block, ABOVE).sum() == 9


def test_nothing_is_seen_behind_a_camera():
    camera = looking((0, 0, 0), (0, 1, 0))
    behind = grid().rotate_x(90).translate((0, -2, 0))
    assert not pvibr.visible(behind, camera).any()
    assert view_of(camera, [behind.bounds], 64) is None
    ahead = grid().rotate_x(90).translate((0, 2, 0))
    assert pvibr.visible(ahead, camera).sum() > 100


def test_a_pyvista_camera_and_casters_that_are_actors():
    camera = pv.Camera()
    camera.position, camera.focal_point, camera.up = (0, 0, 8), (0, 0, 0), (0, 1, 0)
    pl = pv.Plotter(off_screen=True)
    roof = pl.add_mesh(pv.Plane(i_size=0.5, j_size=0.5))
    roof.position = (0, 0, 1)
    mesh = grid(count=20)
    hidden = ~pvibr.visible(mesh, camera, casters=[roof], to='cells', size=(300, 300))
    assert 16 <= hidden.sum() <= 36
    assert np.abs(mesh.cell_centers().points[hidden]).max() < 0.36


@pytest.mark.parametrize(('light', 'half'), OVER_A_SQUARE)
def test_shadow_of_a_square_in_closed_form(light, half):
    mesh = grid(2.0, 80)
    roof = pv.Plane(center=(0, 0, 1), i_size=0.5, j_size=0.5)
    lit = pvibr.shadow_mask(mesh, light, [roof], to='cells', method='map')
    out = np.abs(mesh.cell_centers().points[:, :2]).max(1)
    sure = np.abs(out - half) > 0.02
    np.testing.assert_array_equal(lit[sure], (out > half)[sure])
    assert pvibr.shadowed_area(mesh, lit) == pytest.approx((2 * half) ** 2, rel=0.1)


def test_outside_a_cone_there_is_no_light():
    lit = pvibr.shadow_mask(grid(4.0, 80), lamp((0, 0, 2), cone=20), to='cells')
    assert lit.sum() * 0.05**2 == pytest.approx(
        np.pi * (2 * np.tan(np.radians(20))) ** 2, rel=0.03
    )


@pytest.mark.parametrize('kind', ['directional', 'point'])
def test_shadows_of_hills_are_as_rays_say(kind):
    mesh = bumpy()
    light = lamp((-6, -4, 3)) if kind == 'directional' else lamp((-2, -1, 3), cone=90)
    found = pvibr.shadow_mask(mesh, light, to='cells', method='map') > 0.5
    samples = Samples.of(mesh, 'cells')
    normals = np.where(samples.normals[:, 2:] < 0, -samples.normals, samples.normals)
    true = Rays([mesh]).lit(samples.points, normals, light)
    sure = off_band(mesh, true)
    assert found[sure & (true == 0)].mean() < 0.005
    assert (~found[sure & (true == 1)]).mean() < 0.005


def test_samples_of_a_light_make_soft_edges():
    mesh = grid(2.0, 60)
    roof = pv.Plane(center=(0, 0, 1), i_size=1, j_size=1)
    light = lamp((0, 0, 3), cone=90)
    found = pvibr.shadow_mask(
        mesh, light, [roof], to='cells', samples=24, extent=0.4, method='map'
    )
    true = Rays([mesh, roof]).lit(mesh.cell_centers().points, [0, 0, 1], light, extent=0.4)
    assert ((found > 0.1) & (found < 0.9)).sum() > 200
    assert np.abs(found - true).mean() < 0.03


def test_areas_by_point_and_cell():
    mesh = pv.Sphere(radius=2.0)
    assert pvibr.shadowed_area(mesh, np.zeros(mesh.n_cells)) == pytest.approx(mesh.area, rel=1e-5)
    assert pvibr.shadowed_area(mesh, np.full(mesh.n_points, 0.5)) == pytest.approx(mesh.area / 2)
    refused('shape', pvibr.shadowed_area, mesh, [1.0])


@pytest.mark.parametrize(
    ('call', 'message'),
    [
        (lambda: pvibr.visible(grid(), ABOVE, to='faces'), "one of 'points', 'cells'"),
        (lambda: pvibr.visible(grid(), 3), 'camera'),
        (lambda: pvibr.shadow_mask(grid(), pv.Light(light_type='headlight')), 'scene light'),
        (lambda: pvibr.shadow_mask(grid(), lamp((0, 0, 0))), 'direction'),
        (lambda: pvibr.shadow_mask(grid(), lamp((0, 0, 1)), samples=0), 'samples'),
        (lambda: pvibr.shadow_mask(grid(), lamp((0, 0, 1), cone=30), samples=4), 'extent'),
    ],
)
def test_bad_input_is_named(call, message):
    refused(message, call)


def test_what_is_no_mesh_is_named():
    refused(r'casters must be .* got 3', pvibr.visible, grid(), ABOVE, kind=TypeError, casters=[3])


@pytest.mark.parametrize('split', [False, True])
def test_what_is_closed_is_lit_outside(split):
    """Closed meshes, whatever points their triangles share, as VTK's own count of open edges."""
    rng = np.random.default_rng(5)
    for whole in (pv.Icosahedron(), pv.Cube().triangulate(), pv.Cone(resolution=5).triangulate()):
        for how in ('whole', 'inside out', 'hole', 'twice'):
            faces = whole.regular_faces[:, :: -1 if how == 'inside out' else 1]
            faces = faces[rng.permutation(len(faces))]
            faces = {'hole': faces[1:], 'twice': [*faces, faces[0]]}.get(how, faces)
            points = whole.points[np.array(faces)].reshape(-1, 3) if split else whole.points
            faces = np.arange(len(points)).reshape(-1, 3) if split else faces
            mesh = pv.PolyData.from_regular_faces(points, faces)
            is_open = mesh.clean().n_open_edges > 0
            assert is_open == (how in ('hole', 'twice'))
            want = 0 if is_open else -1 if how == 'inside out' else 1
            assert sides_of(mesh, None) == want, how


def test_a_tree_serves_until_a_triangle_moves():
    """Of embree: it is made anew where points are written in place, which no time stamp tells."""
    pytest.importorskip('embreex')
    mesh, roof = grid(count=9), pv.Plane(center=(0, 0, 1), i_size=1.0, j_size=1.0)
    scenes, areas = [], []
    for step in ('', 'sun', 'shift', 'again'):
        light = lamp((0, 0, 5) if step == '' else (1, 0, 5))
        if step == 'shift':
            np.asarray(roof.points)[:, 0] += 0.3
        lit = pvibr.shadow_mask(mesh, light, [roof], to='cells', method='rays')
        areas.append(mesh.cell_centers().points[lit == 0].mean(0)[0])
        scenes.append(embree_rays._CACHED_SCENE[-1])
    assert scenes[0] is scenes[1] is not scenes[2] is scenes[3]
    assert areas[1] < areas[0] - 0.1
    assert areas[2] == areas[3] > areas[1] + 0.2
