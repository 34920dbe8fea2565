"""Ambient occlusion: closed forms of planes, and rays against spheres."""

import numpy as np
import pytest
import pyvista as pv

import pvibr
from pvibr.capture.adaptive_quality import AdaptiveQuality
from tests.pictures import depths, off, place, plotter, reduce, shot, shown
from tests.refusals import refused

SIZE = (160, 120)
FAR = (5e5, -4e6, 300.0)


def scene(meshes, size=SIZE, offset=(0, 0, 0), parallel=None, eye=(3, -5, 4), angle=30.0):
    """Return a plotter with white meshes, not lit, on black."""
    pl = plotter(size)
    pl.set_background('black')
    for mesh in meshes:
        pl.add_mesh(mesh.translate(offset), color='white', lighting=False)
    place(pl, np.add(eye, offset), offset, parallel=parallel, angle=angle)
    return pl


def visibility(pl, *args, **settings):
    """Return the visibility of pixels, and the effect that is added."""
    effect = pl.ibr.add(pvibr.AmbientOcclusion(*args, **settings))
    pl.show(auto_close=False)
    return shot(pl)[..., 0] / 255, effect


def points(pl):
    """Return what pixels see, (h, w, 3), NaN where nothing is."""
    matrix = pl.camera.GetCompositeProjectionTransformMatrix(SIZE[0] / SIZE[1], -1, 1)
    inverse = np.linalg.inv(pv.array_from_vtkmatrix(matrix))
    away = depths(pl)
    x, y = np.meshgrid(*[(2 * np.arange(n) + 1) / n - 1 for n in SIZE])
    ends = [np.stack([x, -y, 0 * x + z, 0 * x + 1], -1) @ inverse.T for z in (-1.0, 1.0)]
    near, far = (end[..., :3] / end[..., 3:] for end in ends)
    front, back = pl.camera.clipping_range
    return near + (far - near) * ((away - front) / (back - front))[..., None]


def hemisphere(normal, count=4096):
    """Return directions around a normal, as dense as its cosine, (count, 3)."""
    k = np.arange(count) + 0.5
    around, height = 2.399963 * k, np.sqrt(1 - k / count)
    flat = np.sqrt(k / count)
    side = np.cross(normal, np.eye(3)[np.abs(normal).argmin()])
    side /= np.linalg.norm(side)
    above = np.outer(flat * np.cos(around), side)
    above += np.outer(flat * np.sin(around), np.cross(normal, side))
    return above + np.outer(height, normal)


def open_share(distance, radius):
    """Return the visibility that rays find, which hit at a distance."""
    return np.minimum(distance / radius, 1).__pow__(2).mean(axis=-1)


def planes(count):
    floor = pv.Plane(i_size=8, j_size=8)
    wall = pv.Plane(center=(0, 1, 3), direction=(0, -1, 0), i_size=8, j_size=8)
    other = pv.Plane(center=(-1, 0, 3), direction=(1, 0, 0), i_size=8, j_size=8)
    return [floor, wall, other][:count]


@pytest.mark.parametrize('eye', [(0, -0.5, 6), (3, -5, 4), (4, -8, 0.4)])
@pytest.mark.parametrize(('parallel', 'offset'), [(None, (0, 0, 0)), (2.0, FAR)])
def test_a_plane_alone_is_open(eye, parallel, offset):
    found, _ = visibility(scene(planes(1), offset=offset, parallel=parallel, eye=eye), 1.0)
    assert (found > 0).mean() > 0.08
    assert found[found > 0].min() >= 254 / 255


@pytest.mark.parametrize(
    ('parallel', 'offset', 'radius'),
    [(None, (0, 0, 0), 0.7), (1.5, (0, 0, 0), 0.5), (None, FAR, 0.6)],
)
def test_a_crease_is_half_open_and_opens_with_distance(parallel, offset, radius):
    pl = scene(planes(2), offset=offset, parallel=parallel, eye=(1, -4, 4))
    found, _ = visibility(pl, radius)
    x, y, z = np.moveaxis(points(pl) - offset, -1, 0)
    floor = (np.abs(z) < 1e-2) & (y < 1) & (np.abs(x) < 2)
    floor[:, :24] = floor[:, -24:] = False  # what is out of the picture blocks nothing
    reach = np.linspace(1e-6, radius, 60)
    rays = np.maximum(hemisphere((0.0, 0.0, 1.0))[:, 1], 1e-9)
    true = np.interp(1 - y, reach, open_share(reach[:, None] / rays, radius))
    error = np.abs(found - true)
    assert 0.5 <= true[floor].min() < 0.54
    assert error[floor].mean() < 0.006
    assert error[floor & (y < 0.94)].max() < 0.05
    touching = floor & (y > 0.95)  # to two pixels
    assert found[touching].mean() == pytest.approx(true[touching].mean(), abs=0.06)


def test_a_corner_of_three_planes_is_a_quarter_open():
    pl = scene(planes(3), eye=(3, -4, 4))
    found, _ = visibility(pl, 2.0)
    away = np.linalg.norm(points(pl) - (-1, 1, 0), axis=-1)
    assert found[away < 0.08].mean() == pytest.approx(0.28, abs=0.04)


def balls(rng):
    radii = rng.uniform(0.15, 0.5, 7)
    centers = np.c_[rng.uniform(-1.2, 1.2, (7, 2)), radii * rng.uniform(0.7, 1.3, 7)]
    return radii, centers


def rays(at, normals, radii, centers, radius):
    """Return the visibility of points on balls and floor."""
    found = []
    for point, normal in zip(at, normals, strict=True):
        ways = hemisphere(normal, 512)
        floor = np.where(ways[:, 2] < 0, point[2] / np.maximum(-ways[:, 2], 1e-9), np.inf)
        to = centers - point
        along = ways @ to.T
        inside = along**2 - (to**2).sum(1) + radii**2
        hit = along - np.sqrt(np.maximum(inside, 0))
        hit = np.where((inside > 0) & (hit > 1e-3), hit, np.inf).min(axis=1)
        found.append(open_share(np.maximum(np.minimum(hit, floor), 0), radius))
    return np.array(found)


@pytest.mark.parametrize(('seed', 'parallel', 'quadrics'), [(4, None, False), (5, 2.0, True)])
def test_balls_on_a_floor_are_as_rays_find(seed, parallel, quadrics):
    rng = np.random.default_rng(seed)
    radii, centers = balls(rng)
    meshes = [pv.Plane(i_size=6, j_size=6)]
    if not quadrics:
        both = zip(radii, centers, strict=True)
        meshes += [pv.Icosphere(radius=r, center=c, nsub=5) for r, c in both]
    pl = scene(meshes, parallel=parallel)
    if quadrics:
        pl.ibr.add_spheres(centers, radii, color='white', lighting=False)
    found, _ = visibility(pl, 0.5)
    at = points(pl)
    gaps = np.linalg.norm(at[..., None, :] - centers, axis=-1) - radii
    chosen = np.argwhere(np.isfinite(gaps).all(axis=-1))
    i, j = rng.permutation(chosen)[:500].T
    point, ball = at[i, j], gaps[i, j].argmin(axis=1)
    normals = point - centers[ball]
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    normals[point[:, 2] < 1e-3] = 0, 0, 1
    true = rays(point, normals, radii, centers, 0.5)
    assert (true < 0.9).mean() > 0.05
    assert np.abs(found[i, j] - true).mean() < 0.03


def some_balls(**how):
    radii, centers = balls(np.random.default_rng(6))
    both = zip(radii, centers, strict=True)
    return scene(
        [pv.Plane(i_size=6, j_size=6), *(pv.Sphere(radius=r, center=c) for r, c in both)], **how
    )


def test_windows_of_any_size_and_shape_show_the_same():
    small, _ = visibility(some_balls(), 0.6)
    large, _ = visibility(some_balls(size=(480, 360)), 0.6)
    assert small.std() > 0.1
    differ = np.abs(small - reduce(large[..., None], 3)[..., 0])
    assert differ.mean() < 0.01
    wide, _ = visibility(some_balls(size=(240, 120)), 0.6)
    middle = slice(60, 180)
    assert np.abs(wide[:, middle] - small[:, 20:140]).mean() < 0.004


def test_parallel_is_as_a_camera_far_away():
    one, _ = visibility(some_balls(parallel=2.0, eye=(3, -5, 4)), 0.5)
    eye = np.array((3, -5, 4)) * 60
    angle = 2 * np.degrees(np.arctan(2 / np.linalg.norm(eye)))
    two, _ = visibility(some_balls(eye=eye, angle=angle), 0.5)
    assert np.abs(one - two).mean() < 0.006


def test_strength_is_an_exponent_and_the_background_stays():
    pl = some_balls()
    pl.set_background((0.2, 0.4, 0.6), top='white')
    before = shown(pl)
    nothing = np.isnan(depths(pl))
    one, effect = visibility(pl, 0.6)
    assert nothing.mean() > 0.05
    np.testing.assert_array_equal(shot(pl)[nothing], before[nothing])
    effect.strength = 2.0
    two = shot(pl)[..., 0] / 255
    assert np.abs(two - one**2)[~nothing].max() < 0.01
    effect.thickness = 0.0
    assert shot(pl).mean() > 255 * two.mean()


@pytest.mark.parametrize('samples', [4, 8])
def test_multisampling_changes_edges_only(samples):
    found = []
    for count in (0, samples):
        pl = some_balls()
        pl.render_window.SetMultiSamples(count)
        found.append(visibility(pl, 0.6)[0])
    assert np.abs(found[0] - found[1]).mean() < 0.02
    assert (np.abs(found[0] - found[1]) > 0.03).mean() < 0.08


def test_screenshots_in_tiles_are_those_of_a_larger_window():
    pl = some_balls()
    visibility(pl, 0.2)
    large, _ = visibility(some_balls(size=(320, 240)), 0.2)
    differ = off(pl.ibr.screenshot(scale=2).astype(int), np.rint(255 * large)[..., None])
    assert differ.max() <= 4
    assert (differ > 2).mean() < 1e-3


def test_by_default_it_is_the_same_at_any_scale():
    found = []
    for scale in (1e-4, 1.0):
        pl = plotter(SIZE)
        pl.add_mesh(pv.Cube().scale(scale), color='white')
        pl.add_mesh(pv.Cube(center=(1, 0, 0.3)).scale(scale), color='white')
        place(pl, (3 * scale, -6 * scale, 3 * scale))
        found.append(visibility(pl)[0])
    assert np.abs(found[0] - found[1]).max() < 0.02


@pytest.mark.parametrize('settings', [{'radius': 0}, {'strength': -1}, {'samples': 1}])
def test_bad_settings(settings):
    refused(f'{next(iter(settings))} must be ', pvibr.AmbientOcclusion, **settings)


@pytest.mark.parametrize('samples', [0, 4])
def test_what_has_no_lighting_may_keep_its_colour(samples):
    """Meshes and things; what is lit beside them is darkened as ever."""
    pl = scene([pv.Plane(i_size=8, j_size=8)])
    pl.renderer.actors[next(iter(pl.renderer.actors))].prop.lighting = True
    pl.remove_all_lights()
    pl.add_light(pv.Light(light_type='headlight'))
    pl.render_window.SetMultiSamples(samples)
    pl.add_mesh(pv.Sphere(center=(-0.5, 0, 0.3)), color='red', lighting=False)
    pl.ibr.add_spheres([(0.5, 0, 0.3)], 0.4, color='lime', lighting=False)
    plain = shown(pl)
    effect = pl.ibr.add(pvibr.AmbientOcclusion(1.0, strength=2.0))
    pl.render()
    dark = shot(pl)
    effect.unlit = False
    pl.render()
    kept = shot(pl)
    white = (plain.min(2) > 60) & (plain.max(2) - plain.min(2) < 30)
    for color in (0, 1):
        pure = plain[..., color] - np.delete(plain, color, 2).max(2) > 250
        assert pure.sum() > 200
        assert (np.abs(dark - plain).max(2)[pure] > 20).sum() > 50
        same = (kept == plain).all(2)[pure]
        assert same.mean() > (0.8 if samples else 0.99)  # with samples, not at edges
    spared = (kept != dark).any(2)[white]
    assert spared.mean() < 1e-3
    assert (np.abs(dark - plain).max(2)[white] > 20).sum() > 200


@pytest.mark.parametrize(('quality', 'bound'), [(0.7, 0.01), (0.25, 0.02), (1 / 16, 0.02)])
def test_while_the_view_moves_fewer_pixels_are_searched(monkeypatch, quality, bound):
    floor = pv.Plane(i_size=8, j_size=8)
    balls = [pv.Sphere(radius=0.5, center=(x, 0.3 * x, 0.5)) for x in (-1.2, 0.0, 1.1)]
    pl = scene([floor, *balls])
    exact, _ = visibility(pl, 0.8)
    monkeypatch.setattr(AdaptiveQuality, 'quality', lambda *_: quality)
    pl.render()
    coarse = shot(pl)[..., 0] / 255
    assert 0 < np.abs(coarse - exact).mean() < bound
    shown_pixels = exact > 0
    np.testing.assert_array_equal(coarse > 0, shown_pixels)
    # No halo: where surfaces jump, the nearer one keeps its own visibility.
    assert np.quantile(np.abs(coarse - exact)[shown_pixels], 0.99) < 0.15
    pl.close()
