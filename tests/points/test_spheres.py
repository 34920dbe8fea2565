"""Spheres are to the pixel what rays say, in every projection, and act as other props do."""

from __future__ import annotations

import numpy as np
import pytest
import pyvista as pv

import pvibr
from pvibr.points import quadric_rays
from pvibr.things.frame import Frame
from tests.points.stage import PASSES, SIZE, aim, floor_and_lamp, pixels, plotter, points_up_to


def cast(pl, centers, radii):
    radii = np.broadcast_to(radii, len(centers))
    return quadric_rays.cast(Frame.of(pl.renderer), quadric_rays.meet_spheres, centers, radii)


def cloud(count=150, seed=0, largest=0.3):
    rng = np.random.default_rng(seed)
    return rng.uniform(-1, 1, (count, 3)), rng.uniform(0.05, largest, count)


def compare(pl, things, see, atol=1.01 / 255):
    """Check colours, coverage and depth of what a plotter shows."""
    picture = see.grab(pl)
    far = see.depths(pl)
    ids, depth, normals = cast(pl, things.points, things.radius)
    same = quadric_rays.inner(ids)
    colors = things.colors if things.colors is not None else np.full((len(things), 3), 255)
    expected = np.where(
        ids[..., None] >= 0, colors[ids % len(colors)] / 255 * np.maximum(normals[..., 2:], 0), 0
    )
    assert ((ids >= 0) != np.isfinite(far)).mean() < 2e-3
    assert (np.abs(picture - expected).max(-1)[same] <= atol).mean() > 0.9995
    seen = same & (ids >= 0)
    np.testing.assert_allclose(far[seen], depth[seen], rtol=1e-4)
    assert seen.sum() > 100


@pytest.mark.sampled
@pytest.mark.parametrize('offset', [0.0, 1e6])
@pytest.mark.parametrize('parallel', [None, 1.3], ids=['perspective', 'parallel'])
@pytest.mark.parametrize('largest', [60.0, -1.0], ids=['points', 'quads'])
def test_pixels_are_those_of_rays(largest, parallel, offset, see, monkeypatch):
    points_up_to(largest, monkeypatch)
    centers, radii = cloud()
    colors = np.random.default_rng(1).integers(0, 256, (len(centers), 3)).astype(np.uint8)
    pl = plotter()
    things = pl.ibr.add_spheres(centers + offset, radii, colors=colors, diffuse=1.0)
    for eye in [(0, -6, 1), (3, 3, 4), (0.1, 0.2, -9)]:
        aim(pl, np.array(eye) + offset, np.full(3, offset), parallel=parallel)
        compare(pl, things, see, atol=1.01 / 255 if not offset else 2.01 / 255)


@pytest.mark.parametrize('eye', [(0, -1.2, 0), (0.3, 0.1, 0.2), (0, 0, 0.9)])
def test_an_eye_among_them_and_a_cut_by_the_near_plane(eye, see):
    centers, radii = cloud(60, seed=2, largest=0.5)
    pl = plotter()
    things = pl.ibr.add_spheres(centers, radii, color='white', diffuse=1.0)
    aim(pl, eye, np.add(eye, (0.3, 1, 0.1)), clip=(0.2, 10))
    compare(pl, things, see)


def test_the_inside_of_one_is_seen_from_its_middle(see):
    pl = plotter()
    pl.ibr.add_spheres([[0, 0, 0]], 2.0, color='white', diffuse=1.0)
    aim(pl, (0, 0, 0), (1, 0, 0), clip=(0.1, 10))
    assert see.grab(pl).min() > 0.8


def test_those_smaller_than_a_pixel_are_a_pixel(see):
    pl = plotter()
    x, z = np.meshgrid(np.linspace(-2, 2, 12), np.linspace(-1, 1, 8))
    centers = np.column_stack([x.ravel(), np.zeros(96), z.ravel()])
    things = pl.ibr.add_spheres(centers, 1e-4, color='white', ambient=1.0)
    assert (see.grab(pl)[..., 0] > 0.2).sum() == 96
    assert things.report()['dots'] > 0
    things.radius = np.where(np.arange(96) % 2, 1e-4, 0.0)
    assert (see.grab(pl)[..., 0] > 0.2).sum() == 48


def test_small_ones_are_as_large_as_they_are(see):
    centers, _ = cloud(100, seed=4)
    pl = plotter(eye=(0, -9, 1))
    things = pl.ibr.add_spheres(centers, 0.08, color='white', diffuse=1.0)
    aim(pl, (0, -9, 1))
    picture, far = see.grab(pl), see.depths(pl)
    assert things.report()['small'] > 0
    ids, depth, normals = cast(pl, centers, 0.08)
    assert ((ids >= 0) == np.isfinite(far)).mean() > 0.999
    seen = quadric_rays.inner(ids) & (ids >= 0)
    assert np.abs(picture[..., 0] - normals[..., 2])[seen].max() < 1.01 / 255
    assert np.nanmax(np.abs(far - depth)[ids >= 0]) < 0.1


def test_they_meet_meshes_where_spheres_do(see):
    ball = pv.Sphere(radius=1.0, theta_resolution=240, phi_resolution=240)
    pictures = []
    for exact in (True, False):
        pl = plotter(eye=(3, -5, 2))
        pl.add_mesh(pv.Plane(direction=(0, 0.3, 1), i_size=3, j_size=3), color='red')
        if exact:
            pl.ibr.add_spheres([[0.0, 0, 0]], 1.0, color='white', diffuse=1.0)
        else:
            pl.add_mesh(ball, color='white', smooth_shading=True, diffuse=1.0)
        aim(pl, (3, -5, 2))
        pictures.append(see.grab(pl))
        pl.close()
    assert (np.abs(pictures[0] - pictures[1]).max(-1) > 0.03).mean() < 0.01


@pytest.mark.parametrize('extra', ['ssaa', 'peeling', 'edl', 'ssao', 'glass'])
def test_other_passes_see_large_ones_as_meshes(extra, see, monkeypatch):
    """As quads, which those are that are too large for points."""
    points_up_to(-1.0, monkeypatch)
    centers, radii = cloud(12, seed=5, largest=0.4)
    pictures = []
    for exact in (True, False):
        pl = plotter()
        if exact:
            pl.ibr.add_spheres(centers, radii, color='white', diffuse=1.0)
        else:
            for c, r in zip(centers, radii, strict=True):
                ball = pv.Sphere(radius=r, center=c, theta_resolution=60, phi_resolution=60)
                pl.add_mesh(ball, color='white', smooth_shading=True, diffuse=1.0)
        if extra in ('peeling', 'glass'):
            pl.add_mesh(pv.Plane(direction=(0, 1, 0)), color='red', opacity=0.5)
        PASSES[extra](pl)
        aim(pl, (0, -6, 1))
        pictures.append(see.grab(pl))
        pl.close()
    assert pictures[0].max() > 0.5
    assert (np.abs(pictures[0] - pictures[1]).max(-1) > 0.06).mean() < 0.02


def test_large_screenshots_are_the_same_picture():
    centers, radii = cloud(40)
    pl = plotter()
    pl.ibr.add_spheres(centers, radii, color='white', diffuse=1.0)
    aim(pl, (0, -9, 1))
    small = pl.screenshot(None, return_img=True).astype(float)
    large = pl.screenshot(None, return_img=True, scale=3).astype(float)
    halved = large.reshape(SIZE[1], 3, SIZE[0], 3, 3).mean((1, 3))
    assert np.abs(halved - small).mean() < 3


def test_highlights_follow_the_material(see):
    pl = plotter()
    things = pl.ibr.add_spheres([[0, 0, 0]], 1.0, color='red', diffuse=0.5)
    assert see.grab(pl).max() < 0.51
    things.prop.specular, things.prop.specular_power = 0.5, 20
    assert see.grab(pl).max() > 0.95
    things.prop.specular = 0.0
    assert see.grab(pl).max() < 0.51


def test_changes_are_seen(see):
    pl = plotter()
    things = pl.ibr.add_spheres([[-1, 0, 0], [1, 0, 0]], 0.5, scalars=[0.0, 1.0], cmap='gray')
    pl.remove_scalar_bar()
    middle = SIZE[0] // 2
    picture = see.grab(pl)
    assert picture[:, :middle].max() == 0
    assert picture[:, middle:].max() > 0.5
    things.scalars = [1.0, 0.0]
    picture = see.grab(pl)
    assert picture[:, middle:].max() == 0
    assert picture[:, :middle].max() > 0.5
    things.colors = np.array([[255, 0, 0], [0, 255, 0]], np.uint8)
    things.visible = np.array([True, False])
    assert see.grab(pl)[:, middle:].max() == 0
    things.points = [[1, 0, 0], [-1, 0, 0]]
    assert see.grab(pl)[:, :middle].max() == 0
    things.radius = 0.1
    small = (see.grab(pl)[..., 0] > 0).sum()
    things.radius = 0.5
    assert (see.grab(pl)[..., 0] > 0).sum() > 10 * small
    things.remove()
    assert see.grab(pl).max() == 0
    pl.ibr.add(things)
    assert see.grab(pl).max() > 0.5
    things.visibility = False
    assert see.grab(pl).max() == 0


def test_rays_pick_the_nearest():
    pl = plotter()
    things = pl.ibr.add_spheres([[0, 2, 0], [0, 0, 0], [1.5, 0, 0]], [1.0, 0.5, 0.2])
    aim(pl, (0, -6, 0))
    hit = things.pick(SIZE[0] / 2, SIZE[1] / 2)
    assert hit.index == 1
    np.testing.assert_allclose(hit.point, [0, -0.5, 0], atol=1e-3)
    things.visible = np.array([True, False, True])
    assert things.pick(SIZE[0] / 2, SIZE[1] / 2).index == 0
    assert things.pick(1, 1) is None


def test_shadows_fall_from_them_and_on_them(see):
    def brightness(above):
        pl, _ = floor_and_lamp()
        centers = [[0, 0, 1.0], [0, 0, 3.0]] if above else [[0, 0, 1.0]]
        pl.ibr.add_spheres(centers, [0.5, 0.7][: len(centers)], color='white')
        pl.ibr.add(pvibr.Shadows())
        aim(pl, (0, -8, 4.5), (0, 0, 1))
        picture = see.grab(pl)
        x, y = pixels(pl, [(0.1, -0.2, 0), (1.5, -1.5, 0), (0, -0.3, 1.4)])
        return picture[y, x, 0]

    under, free, top = brightness(above=False)
    assert under < 0.1
    assert free > 0.8
    assert top > 0.5
    assert brightness(above=True)[2] < 0.1


def test_buffers_know_them(see):
    pl = plotter()
    mesh = pl.add_mesh(pv.Sphere(radius=0.5, center=(1.5, 0, 0)))
    thing = pl.ibr.add_spheres([[0, 0, 0]], 1.0)
    aim(pl, (0, -6, 0))
    y, x = SIZE[1] // 2, SIZE[0] // 2
    ids = pl.ibr.buffer('id')
    assert mesh in pl.ibr.buffer_objects
    assert pl.ibr.buffer_objects[int(ids[y, x])] is thing
    _, _, normals = cast(pl, thing.points, thing.radius)
    np.testing.assert_allclose(pl.ibr.buffer('normal')[y, x - 10], normals[y, x - 10], atol=5e-3)


def test_none_are_no_trouble(see):
    pl = plotter()
    things = pl.ibr.add_spheres(np.zeros((0, 3)), 1.0)
    assert see.grab(pl).max() == 0
    assert len(things) == 0
    assert things.pick(1, 1) is None
