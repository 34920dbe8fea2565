"""Every format against its own documented projection, written out for single points in float64."""

from pathlib import Path

import numpy as np
import pytest

import pvibr
from tests.camera_files import FORMATS, pixels, points, write_pictures

pytestmark = pytest.mark.sampled

BAR = 0.02  # pixels, as the issue asks; what is found is below 1e-6


@pytest.mark.parametrize('seed', [1, 20])
@pytest.mark.parametrize('name', FORMATS)
def test_projections_are_those_of_the_format(name, seed, tmp_path):
    path, made = FORMATS[name](tmp_path, seed)
    write_pictures(tmp_path, made, {'3.jpg': (640, 320)} if name == 'opensfm' else {})
    photos = pvibr.read_cameras(path)
    assert [photo.name for photo in photos] == list(made)
    where = points(seed)
    for photo, project in zip(photos, made.values(), strict=True):
        assert photo.path is not None
        found = pixels(photo.camera, where)
        expected = np.array([project(point) for point in where])
        assert np.abs(found - expected).max() < 1e-6 < BAR, photo
    assert photos[0].crs == ('EPSG:32632' if name == 'opf' else None)


@pytest.mark.parametrize('name', FORMATS)
def test_the_folder_of_a_project_is_enough(name, tmp_path):
    _, made = FORMATS[name](tmp_path, 3)
    write_pictures(tmp_path, made, {'3.jpg': (640, 320)} if name == 'opensfm' else {})
    assert len(pvibr.read_cameras(tmp_path)) == len(made)


@pytest.mark.parametrize(
    ('name', 'old', 'new'),
    [
        ('colmap-PINHOLE', ' 310.0 ', ' 700.0 '),
        ('opensfm', '"c_x": 0.01', '"c_x": 0.6'),
        ('openmvg', '310.0', '700.0'),
        ('nvm-fixed', '310', '700'),
        ('metashape', '<cx>-10<', '<cx>330<'),
        ('photoscan-0.9.0', '<cx>310<', '<cx>-9<'),
        ('photoscan-1.2.0', '<cx>310<', '<cx>660<'),
        ('opf', '[310,', '[700,'),
        ('transforms', '"cx": 310', '"cx": 700'),
    ],
)
def test_a_principal_point_outside_the_picture_warns(name, old, new, tmp_path):
    """It is that of a part of a picture, or of a file whose numbers mean something else."""
    _, made = FORMATS[name](tmp_path, 3)
    write_pictures(tmp_path, made, {'3.jpg': (640, 320)} if name == 'opensfm' else {})
    pvibr.read_cameras(tmp_path)  # does not warn
    for file in tmp_path.rglob('*.*'):
        if file.suffix in ('.txt', '.json', '.nvm', '.xml'):
            file.write_text(file.read_text().replace(old, new))
    with pytest.warns(pvibr.PvibrWarning, match='their principal point outside the picture'):
        pvibr.read_cameras(tmp_path)


@pytest.mark.parametrize('name', FORMATS)
def test_pinholes_stand_in_for_lenses(name, tmp_path):
    """What a projector takes is the same within the bar: one pinhole, or faces of a cube."""
    path, made = FORMATS[name](tmp_path, 5)
    write_pictures(tmp_path, made, {'3.jpg': (640, 320)} if name == 'opensfm' else {})
    where = points(5)
    for photo in pvibr.read_cameras(path):
        slides = photo.slides()
        if isinstance(slides[0][0], Path):
            off = pixels(slides[0][1], where) - pixels(photo.camera, where)
            inside = np.abs(pixels(photo.camera, where) - 320).max(axis=1) < 200
            assert np.abs(off[inside]).max() < BAR
        else:
            uv = np.array([camera.project(where)[0] for _, camera, _ in slides])
            own = photo.camera.project(where)[0]
            seen = ((own >= 0) & (own <= 1)).all(axis=1)
            assert ((uv >= 0) & (uv <= 1)).all(axis=2).any(axis=0)[seen].all()
            for picture, camera, mask in slides:
                assert picture.shape[1::-1] == camera.size
                assert mask is None or not mask.all()
