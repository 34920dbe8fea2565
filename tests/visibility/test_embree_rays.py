"""Light and sight by rays: as closed forms and triangles in float64 have it, whatever casts."""

import numpy as np
import pytest
import pyvista as pv

import pvibr
from pvibr.maths.pinhole import Pinhole
from tests.figures.makers import worm
from tests.makers import OVER_A_SQUARE, grid, lamp

pytest.importorskip('embreex')


def crossed(points, ways, mesh):
    """Return which segments from points meet a mesh (Moeller and Trumbore), float64."""
    mesh = mesh.triangulate()
    corners = np.asarray(mesh.points, float)[mesh.regular_faces]
    found = np.zeros(len(points), bool)
    for a, b, c in corners:
        u, v = b - a, c - a
        p = np.cross(ways, v)
        det = p @ u
        with np.errstate(divide='ignore', invalid='ignore'):
            s = np.einsum('ij,ij->i', points - a, p) / det
            q = np.cross(points - a, u)
            t = np.einsum('ij,ij->i', ways, q) / det
            away = q @ v / det
            found |= (s >= 0) & (t >= 0) & (s + t <= 1) & (away > 1e-9) & (away < 1)
    return found


@pytest.mark.parametrize('offset', [0.0, 1e6])
@pytest.mark.parametrize(('light', 'half'), OVER_A_SQUARE)
def test_shadow_of_a_square_in_closed_form(light, half, offset):
    light = light.copy()
    light.position = tuple(np.array(light.position) + offset)
    light.focal_point = (offset,) * 3
    mesh, roof = grid(2.0, 80), pv.Plane(center=(0, 0, 1), i_size=0.501, j_size=0.501)
    out = np.abs(mesh.cell_centers().points[:, :2]).max(1)
    for one in (mesh, roof):
        one.points = np.array(one.points, float) + offset
    lit = pvibr.shadow_mask(mesh, light, [roof], to='cells', method='rays')
    np.testing.assert_array_equal(lit, out > half)


@pytest.mark.parametrize('seed', [0, 7])
@pytest.mark.parametrize('cone', [None, 90])
def test_masts_on_wide_ground_are_as_triangles_have_it(seed, cone):
    rng = np.random.default_rng(seed)
    ground = grid(2000.0, 50).triangulate()
    masts = [
        pv.Cylinder(center=(*c, 50), direction=(0, 0, 1), radius=0.4, height=100, resolution=6)
        for c in rng.uniform(-900, 900, (40, 2))
    ]
    light = lamp((900, 500, 320), cone=cone)
    lit = pvibr.shadow_mask(ground, light, masts, to='cells', method='rays')
    points = np.asarray(ground.points, float)[ground.regular_faces].mean(1)
    ways = np.array(light.position) - points if cone else np.tile(light.position, (len(points), 1))
    dark = crossed(points, np.asarray(ways, float) * (1 if cone else 1e3), pv.merge(masts))
    assert dark.sum() > 3
    np.testing.assert_array_equal(lit == 0, dark)


def test_hills_do_not_shadow_themselves_but_for_what_lies_behind():
    ground = grid(6.0, 60).triangulate()
    x, y, _ = points = np.array(ground.points, float).T
    points[2] = 0.8 * np.sin(2 * x) * np.cos(1.7 * y)
    ground.points = points.T
    light = lamp((0, 0, 5))
    assert pvibr.shadow_mask(ground, light, method='rays').all()
    ball = pv.Sphere(theta_resolution=60, phi_resolution=60)
    lit = pvibr.shadow_mask(ball, light, to='cells', method='rays')
    np.testing.assert_array_equal(lit == 1, ball.face_normals[:, 2] > 0)


def test_soft_edges_are_those_of_the_map():
    mesh, roof = grid(2.0, 40), pv.Plane(center=(0, 0, 1), i_size=1, j_size=1)
    how = {'to': 'cells', 'samples': 24, 'extent': 0.4}
    light = lamp((0, 0, 3), cone=90)
    rays, depth = (
        pvibr.shadow_mask(mesh, light, [roof], method=m, **how) for m in ('rays', 'map')
    )
    assert ((rays > 0.1) & (rays < 0.9)).sum() > 100
    assert np.abs(rays - depth).mean() < 0.01


def test_instances_figures_and_impostors_cast_as_their_meshes():
    pl = pv.Plotter(off_screen=True, window_size=(80, 60))
    cube = pv.Cube(x_length=0.3, y_length=0.3, z_length=0.3)
    places = np.array([[-1.5, 0, 1], [0, 1.2, 1], [1.4, -1, 0.7], [1, 1, 2]])
    cubes = pl.ibr.add_instances(cube, places, bake=False)
    cubes.visible = np.array([True, True, True, False])
    figure = pl.ibr.add_animated(worm())
    actors = [pl.add_mesh(cube.translate((x, -1.5, 0.5))) for x in (-1, 1)]
    impostor = pl.ibr.add_impostor(actors, only_if_faster=False)
    pl.show(auto_close=False)
    ground = grid(8.0, 60).translate((0, 0, -0.5))
    light = lamp((2, 1, 5))
    meshes = [cube.translate(c) for c in places[:3]]
    meshes += [figure.mesh().extract_surface(algorithm=None)]
    meshes += [cube.translate((x, -1.5, 0.5)) for x in (-1, 1)]
    for method in ('rays', 'map'):
        how = {'to': 'cells', 'method': method, 'resolution': 1024}
        found = pvibr.shadow_mask(ground, light, [cubes, figure, impostor], **how)
        np.testing.assert_array_equal(found, pvibr.shadow_mask(ground, light, meshes, **how))
        for caster, few in ((cubes, 5), (figure, 1), (impostor, 5)):
            assert (pvibr.shadow_mask(ground, light, [caster], **how) == 0).sum() >= few


def test_a_camera_sees_what_no_ray_meets():
    K = [[180.0, 0, 99.5], [0, 180.0, 74.5], [0, 0, 1]]
    down = np.diag([1.0, -1.0, -1.0])
    camera = Pinhole(K, down, -down @ [0, 0, 3.0], (200, 150))
    mesh, roof = grid(2.0, 40), pv.Plane(center=(0, 0, 1), i_size=0.499, j_size=0.499)
    behind = roof.translate((0, 0, 5))
    seen = pvibr.visible(mesh, camera, casters=[roof, behind], to='cells', method='rays')
    out = np.abs(mesh.cell_centers().points[:, :2]).max(1)
    np.testing.assert_array_equal(seen, out > 0.374)
    above = pvibr.Orthographic.from_extent(-1, 1, -1, 1, zmax=5)
    seen = pvibr.visible(mesh, above, casters=[roof, behind], to='cells', method='rays')
    np.testing.assert_array_equal(seen, out > 0.2495)


def test_without_embree_rays_name_their_extra(monkeypatch):
    monkeypatch.setattr('pvibr.visibility.embree_rays.find_spec', lambda _name: None)
    sun = lamp((1, 0, 3))
    with pytest.raises(ModuleNotFoundError, match=r'pvibr\[rays\]'):
        pvibr.shadow_mask(grid(), sun, method='rays')
    roof = pv.Plane(center=(0, 0, 1))
    how = {'to': 'cells', 'resolution': 512}
    found, depth = (
        pvibr.shadow_mask(grid(), sun, [roof], method=m, **how) for m in ('auto', 'map')
    )
    np.testing.assert_array_equal(found, depth)


def test_what_is_wrong_is_told():
    with pytest.raises(ValueError, match=r"method must be .* got 'ray'"):
        pvibr.shadow_mask(grid(), lamp((0, 0, 3)), method='ray')
    with pytest.raises(ValueError, match=r'resolution must be .* got 0'):
        pvibr.shadow_mask(grid(), lamp((0, 0, 3)), resolution=0)
    clouds = pvibr.Shadows()
    with pytest.raises(TypeError, match='must be meshes, actors or things'):
        pvibr.shadow_mask(grid(), lamp((0, 0, 3)), [clouds])


def thin_scene(seed, count=6):
    """Return a hilly ground and masts and blades far thinner than texels of a small map."""
    rng = np.random.default_rng(seed)
    ground = pv.Plane(i_size=100, j_size=100, i_resolution=60, j_resolution=60).triangulate()
    x, y, _ = points = np.array(ground.points, float).T
    points[2] = 3 * np.sin(x / 9) * np.cos(y / 13)
    ground.points = points.T
    thin = []
    for x, y in rng.uniform(-40, 40, (count, 2)):
        up = {'center': (x, y, 8), 'direction': (0, 0, 1), 'radius': 0.15, 'height': 16}
        thin.append(pv.Cylinder(**up, resolution=8).triangulate())
        blade = pv.Box((x - 0.1, x + 0.1, y - 5, y + 5, 16, 16.2))
        thin.append(blade.rotate_y(rng.uniform(0, 90), point=(x, y, 16)))
    return ground, thin


@pytest.mark.parametrize(
    ('kind', 'seed', 'to'),
    [('sun', 0, 'cells'), ('sun', 11, 'points'), ('spot', 3, 'points'), ('point', 15, 'cells')],
)
def test_maps_say_where_they_may_be_wrong(kind, seed, to):
    ground, thin = thin_scene(seed)
    sun = pv.Light(position=(30, 18, 25), light_type='scene light')
    if kind != 'sun':
        sun.positional, sun.cone_angle = True, 50 if kind == 'spot' else 90
    true = pvibr.shadow_mask(ground, sun, thin, to=to, method='rays')
    shares = []
    for resolution in (256, None):
        how = {'method': 'map', 'resolution': resolution, 'doubt': True}
        lit, doubt = pvibr.shadow_mask(ground, sun, thin, to=to, **how)
        wrong = np.abs(lit - true)
        assert (wrong > doubt + 0.5).mean() < 1e-3
        assert doubt.mean() < (0.1 if to == 'points' else 0.7) if resolution else 0.005
        shares.append((wrong > 0.5).sum())
        assert wrong.sum() <= doubt.sum()
    assert shares[0] > 5 * shares[1]
    lit, doubt = pvibr.shadow_mask(ground, sun, thin, to=to, method='rays', doubt=True)
    np.testing.assert_array_equal(lit, true)
    assert not doubt.any()
