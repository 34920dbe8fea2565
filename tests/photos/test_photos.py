"""Photographs that bring their cameras, with lenses of any kind, on a plane of known colours."""

import numpy as np
import pytest
import pyvista as pv
from PIL import Image

import pvibr
from tests.pictures import places
from tests.refusals import refused

SIZE = (240, 180)
LENSES = {
    'perspective': (170.0, pvibr.Lens('perspective', radial=(-0.1, 0.02, 0.01, 0.005))),
    'division': (150.0, pvibr.Lens('division', (-0.1,))),
    'equidistant': (70.0, pvibr.Lens('equidistant', radial=(0.02,), tangential=(1e-3, 2e-3))),
    'spherical': (240 / (2 * np.pi), pvibr.Lens('spherical')),
}


def colour_of(x, y):
    """Smooth colours of places on the plane z = 0."""
    return 127.5 + 110 * np.stack([np.sin(2 * x), np.sin(2 * y), np.cos(x + y)], axis=-1)


def photograph(kind, seed, folder):
    """A photograph of the plane, and of grey above it, by rays."""
    rng = np.random.default_rng(seed)
    focal, lens = LENSES[kind]
    turn = np.linalg.qr(np.eye(3) + rng.normal(scale=0.1, size=(3, 3)))[0]
    R = turn * np.sign(np.diag(turn)) @ np.diag([1.0, -1.0, -1.0])  # it looks down
    R = R if np.linalg.det(R) > 0 else -R
    eye = np.array([*rng.normal(scale=0.1, size=2), 1.2])
    K = [[focal, 0, (SIZE[0] - 1) / 2], [0, focal, (SIZE[1] - 1) / 2], [0, 0, 1]]
    camera = pvibr.LensCamera(K, R, -R @ eye, SIZE, lens)
    origins, ahead = camera.rays(places(SIZE).reshape(-1, 2))
    with np.errstate(all='ignore'):
        at = origins - origins[:, 2:] / ahead[:, 2:] * ahead
        colours = np.where((ahead[:, 2:] < -0.05), colour_of(at[:, 0], at[:, 1]), 90)
    picture = np.nan_to_num(colours).reshape(SIZE[1], SIZE[0], 3).astype(np.uint8)
    Image.fromarray(picture).save(folder / f'{kind}.png')
    return pvibr.Photo(f'{kind}.png', camera, folder / f'{kind}.png')


@pytest.mark.parametrize('seed', [2, 5])
@pytest.mark.parametrize('kind', LENSES)
def test_a_photograph_brings_its_camera(kind, seed, tmp_path):
    photo = photograph(kind, seed, tmp_path)
    pl = pv.Plotter(off_screen=True, window_size=(200, 150))
    pl.add_mesh(pv.Plane(i_size=1.2, j_size=0.9, i_resolution=1, j_resolution=1), color='white')
    pl.ibr.add(pvibr.Projector(photo))
    pl.camera_position = [(0, 0, 5), (0, 0, 0), (0, 1, 0)]
    pl.enable_parallel_projection()
    pl.camera.parallel_scale = 0.45
    shown = pl.screenshot(return_img=True).astype(float)
    x, y = np.meshgrid(
        (np.arange(200) + 0.5) / 200 * 1.2 - 0.6, 0.45 - (np.arange(150) + 0.5) / 150 * 0.9
    )
    off = np.abs(shown - colour_of(x, y))
    assert np.percentile(off, 99) < 4.5  # of a pixel's width of the photograph: about 5 per texel
    assert np.median(off) < 1.5


def test_several_and_their_own_masks(tmp_path):
    photos = [photograph(kind, 3, tmp_path) for kind in ('perspective', 'division')]
    plane = pv.Plane(i_size=1, j_size=1, i_resolution=8, j_resolution=8)
    found = pvibr.Projector(photos).bake(plane, to='cells')
    assert (found['views'] == 2).all()
    none = np.zeros((SIZE[1], SIZE[0]), np.uint8)
    found = pvibr.Projector(photos, mask=[None, none]).bake(plane, to='cells')
    assert (found['views'] == 1).all()
    assert pvibr.visible(plane, photos[0], to='cells').all()
    with pytest.raises(ValueError, match='image must be 1 to 6 pictures'):
        pvibr.Projector([photograph('spherical', 3, tmp_path), *photos])
    refused('camera must be given', pvibr.Projector, none, kind=TypeError)
    refused('needs resampling', pvibr.Projector, photograph('equidistant', 3, tmp_path), mask=none)


def test_the_view_of_a_photograph(tmp_path):
    """In a window of its proportions every point is where the photograph has it."""
    K = [[170.0, 0, 130.0], [0, 170.0, 80.0], [0, 0, 1]]
    R = pv.transformations.axis_angle_rotation((1, 2, 3), 40)[:3, :3]
    photo = pvibr.Photo('a.png', pvibr.Pinhole(K, R, [0.1, 0.2, 3.0], SIZE))
    view = photo.to_pyvista()
    from pvibr.maths.cameras import as_camera

    points = np.random.default_rng(1).uniform(-1, 1, (50, 3))
    off = as_camera(view, SIZE).project(points)[0] - photo.camera.project(points)[0]
    assert np.abs(off).max() < 1e-9
