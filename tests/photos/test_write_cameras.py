"""Cameras written, read again, and shown."""

from dataclasses import replace

import numpy as np
import pytest
import pyvista as pv
from PIL import Image
from scipy.spatial.transform import Rotation

import pvibr
from pvibr.photos.read_cameras import read_frustums
from tests.camera_files import FORMATS, pixels, points, write_pictures
from tests.refusals import refused


def read(path):
    with pytest.warns(pvibr.PvibrWarning, match='have no picture'):
        return pvibr.read_cameras(path)


@pytest.mark.parametrize('format', ['colmap', 'colmap_binary', 'transforms'])
@pytest.mark.parametrize('name', ['colmap-OPENCV', 'colmap-OPENCV_FISHEYE', 'openmvs-7'])
def test_what_is_written_is_read(name, format, tmp_path):
    path, _ = FORMATS[name](tmp_path, 6)
    photos = read(path)
    (tmp_path / 'new').mkdir()
    new = tmp_path / 'new' / ('transforms.json' if format == 'transforms' else 'model')
    pvibr.write_cameras(new, photos, format=format)
    again = read(new)
    assert [p.name for p in again] == [p.name for p in photos]
    for old, found in zip(photos, again, strict=True):
        off = pixels(old.camera, points(6)) - pixels(found.camera, points(6))
        assert np.abs(off).max() < 1e-8


def test_what_a_format_lacks_is_refused(tmp_path):
    path, _ = FORMATS['colmap-EUCM'](tmp_path, 6)
    photos = read(path)
    refused(r'transforms\.json has no EUCM', pvibr.write_cameras, tmp_path / 'a.json', photos)
    with pytest.raises(ValueError, match='orthographic'):
        pvibr.write_cameras(
            tmp_path / 'b', pvibr.Orthographic.from_extent(0, 1, 0, 1, size=(9, 9))
        )
    refused('cameras must have', pvibr.write_cameras, tmp_path / 'b', [])
    refused('size must be given', pvibr.write_cameras, tmp_path / 'b', pv.Camera())
    assert not (tmp_path / 'b').exists()


def test_a_plotter_is_written_as_it_shows(tmp_path):
    """A corner of a cube is where the file's camera says."""
    pl = pv.Plotter(off_screen=True, window_size=(300, 200))
    pl.add_mesh(pv.Sphere(radius=0.02, center=(0.5, 0.3, 0.2)), color='red', lighting=False)
    pl.camera_position = [(2, -3, 1.5), (0, 0, 0), (0, 0, 1)]
    picture = pl.screenshot(tmp_path / '0000.png', return_img=True).astype(int)
    pvibr.write_cameras(tmp_path / 'sparse' / '0', pl)
    (photo,) = pvibr.read_cameras(tmp_path)
    assert photo.path == tmp_path / '0000.png'
    y, x = np.nonzero(picture[..., 0] - picture[..., 1] > 100)
    found = pixels(photo.camera, [[0.5, 0.3, 0.2]])[0]
    assert np.abs(found - [x.mean(), y.mean()]).max() < 0.3


def test_fly_to_and_frustums(tmp_path):
    path, made = FORMATS['transforms'](tmp_path, 6)
    write_pictures(tmp_path, made)
    photos = pvibr.read_cameras(path)
    pl = pv.Plotter(off_screen=True, window_size=(160, 120))
    pl.add_mesh(pv.Cube())
    for frames in (1, 4):
        for photo in photos[:2]:
            pl.ibr.fly_to(photo, frames=frames)
            view = photo.to_pyvista()
            assert np.allclose(pl.camera.position, view.position)
            assert np.allclose(pl.camera.up, view.up)
            assert np.allclose(pl.camera.direction, view.direction)
            assert np.isclose(pl.camera.view_angle, view.view_angle)
    for wrong in (0, np.nan, 1j, 1e300, '3'):
        with pytest.raises((TypeError, ValueError), match='frames must be '):
            pl.ibr.fly_to(photos[0], frames=wrong)
    lines = read_frustums(path)
    assert lines.n_cells == len(photos)
    apexes = lines.points.reshape(-1, 5, 3)[:, 4]
    assert np.allclose(apexes, photos.positions(), atol=1e-5)


def test_a_moved_world_is_seen_the_same(tmp_path):
    path, _ = FORMATS['metashape'](tmp_path, 6)
    photos, where = read(path), points(6)
    matrix = np.eye(4)
    matrix[:3, :3] = 2.5 * pv.transformations.axis_angle_rotation((1, 2, 3), 40)[:3, :3]
    matrix[:3, 3] = 1, 2, 3
    moved = photos.transformed(matrix)
    for old, new in zip(photos, moved, strict=True):
        there = where @ matrix[:3, :3].T + matrix[:3, 3]
        assert np.abs(pixels(old.camera, where) - pixels(new.camera, there)).max() < 1e-8
    refused('must be a rotation', photos.transformed, np.diag([1.0, 2, 1, 1]))
    assert photos['IMG_2'] is photos[2]
    with pytest.raises(KeyError, match='no such photograph'):
        photos['x']


def test_thumbnails_fill_the_views_of_their_cameras(tmp_path):
    """Upright and not mirrored, whatever their proportions; what has no picture is left out."""
    rng, photos = np.random.default_rng(3), []
    for k, (wide, high) in enumerate([(160, 120), (90, 150), (160, 120)]):
        small = rng.integers(0, 256, (3, 4, 3), np.uint8)
        picture = Image.fromarray(small).resize((wide, high), Image.Resampling.NEAREST)
        picture.save(tmp_path / f'{k}.png')
        K = [[140.0, 0, wide / 2 - 0.5], [0, 140.0, high / 2 - 0.5], [0, 0, 1]]
        turn = Rotation.random(random_state=k).as_matrix()
        camera = pvibr.Pinhole(K, turn, -turn @ [9.0 * k, 0, 0], (wide, high))
        photos.append(pvibr.Photo(f'{k}', camera, tmp_path / f'{k}.png' if k != 1 else None))
    photos.append(replace(photos[1], path=tmp_path / '1.png'))
    photos = pvibr.Photos(photos)
    cards, image = photos.thumbnails(2.0, texels=150)
    assert cards['photo'].tolist() == [0, 2, 3]
    for k in (0, 3):
        photo = photos[k]
        pl = pv.Plotter(off_screen=True, window_size=photo.size)
        pl.add_mesh(cards, texture=pv.Texture(image), lighting=False)
        pl.ibr.fly_to(photo, frames=1)
        shown = pl.screenshot(return_img=True).astype(int)
        pl.close()
        assert (np.abs(shown - photo.read()[..., :3]).max(2) > 30).mean() < 0.1
    refused(r'texels must be .* got 0', photos.thumbnails, texels=0)
    refused('no photograph has a picture', photos[1:2].thumbnails)
