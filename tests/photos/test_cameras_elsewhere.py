"""Against the programs' own code, where it is installed, and against real observations."""

import json

import numpy as np
import pytest

import pvibr
from pvibr.photos.colmap import MODELS
from tests.camera_files import COLMAP_K, opf, pixels, points, quaternion

EXTRAS = {
    'THIN_PRISM_FISHEYE': [400, 410, 310, 250, 0.02, -0.01, 1e-3, -2e-3, 2e-3, 1e-3, 3e-3, -1e-3],
    'RAD_TAN_THIN_PRISM_FISHEYE': [
        *(400, 410, 310, 250, 0.02, -0.01, 2e-3, 1e-3, -1e-3, 1e-4),
        *(1e-3, -2e-3, 3e-3, -1e-3, 2e-3, -1e-4),
    ],
    'DIVISION': [600, 610, 310, 250, 0.1],
    'SIMPLE_FISHEYE': [400, 310, 250],
    'EQUIRECTANGULAR': [640, 480],
}


def reconstruction(pycolmap, model, params):
    """Two frames of a rig of two cameras, the second turned and moved against the first."""
    made = pycolmap.Reconstruction()
    rig = pycolmap.Rig(rig_id=1)
    rng = np.random.default_rng(4)
    relative = pycolmap.Rigid3d(
        pycolmap.Rotation3d(rng.normal(size=3) * 0.2), rng.normal(size=3) * 0.2
    )
    for k in (1, 2):
        camera = pycolmap.Camera(camera_id=k, model=model, width=640, height=480, params=params)
        made.add_camera(camera)
        sensor = pycolmap.sensor_t(type=pycolmap.SensorType.CAMERA, id=k)
        if k == 1:
            rig.add_ref_sensor(sensor)
        else:
            rig.add_sensor(sensor, relative)
    made.add_rig(rig)
    for k in (1, 2):
        frame = pycolmap.Frame(frame_id=k, rig_id=1)
        turn = pycolmap.Rotation3d(rng.normal(size=3) * 0.2)
        images = [
            pycolmap.Image(image_id=2 * k + c, camera_id=c, name=f'{k}/{c}.png') for c in (1, 2)
        ]
        for image in images:
            frame.add_data_id(image.data_id)
        frame.rig_from_world = pycolmap.Rigid3d(turn, [0.1, -0.2, 4.0])
        made.add_frame(frame)
        for image in images:
            image.frame_id = k
            made.add_image(image)
            made.register_frame(k) if hasattr(made, 'register_frame') else None
    return made


@pytest.mark.parametrize('model', [*MODELS, 'EQUIRECTANGULAR'])
def test_colmap_itself(model, tmp_path):
    pycolmap = pytest.importorskip('pycolmap')
    params = EXTRAS.get(model) or COLMAP_K[model][0]
    try:
        made = reconstruction(pycolmap, model, params)
    except (ValueError, AttributeError) as error:
        pytest.skip(f'this COLMAP has no {model}: {error}')
    (tmp_path / 'text').mkdir()
    (tmp_path / 'bin').mkdir()
    made.write_text(str(tmp_path / 'text'))
    made.write_binary(str(tmp_path / 'bin'))
    where = points(8) * [1.5, 1.2, 1.0]
    for folder in ('text', 'bin'):
        with pytest.warns(pvibr.PvibrWarning, match='have no picture'):
            photos = pvibr.read_cameras(tmp_path / folder)
        assert len(photos) == 4
        for photo in photos:
            image = made.find_image_with_name(photo.name)
            expected = [image.project_point(point) for point in where]
            expected = np.array([[np.nan] * 2 if e is None else e for e in expected]) - 0.5
            off = np.abs(pixels(photo.camera, where) - expected)
            assert np.isfinite(off).mean() > 0.9
            assert np.nanmax(off) < 1e-6


def test_poses_of_rigs_are_those_of_their_frames(tmp_path):
    """Of images alone they may be stale: the rig's is what COLMAP itself reads."""
    pycolmap = pytest.importorskip('pycolmap')
    made = reconstruction(pycolmap, 'PINHOLE', [600, 600, 320, 240])
    made.write_text(str(tmp_path))
    lines = (tmp_path / 'images.txt').read_text().splitlines()
    stale = [
        ' '.join([line.split()[0], '1 0 0 0 0 0 0', *line.split()[8:]]) if '.png' in line else line
        for line in lines
    ]
    (tmp_path / 'images.txt').write_text('\n'.join(stale) + '\n')
    with pytest.warns(pvibr.PvibrWarning, match='have no picture'):
        photos = pvibr.read_cameras(tmp_path)
    for photo in photos:
        matrix = made.find_image_with_name(photo.name).cam_from_world().matrix()
        assert np.abs(photo.camera_from_world[:3] - matrix).max() < 1e-12


@pytest.mark.parametrize('format', ['colmap', 'colmap_binary'])
@pytest.mark.parametrize('model', [*MODELS, 'EQUIRECTANGULAR'])
def test_colmap_reads_what_is_written(model, format, tmp_path):
    pycolmap = pytest.importorskip('pycolmap')
    from pvibr.photos.camera_parsing import Place
    from pvibr.photos.colmap import model_camera

    params = EXTRAS.get(model) or COLMAP_K[model][0]
    pose = np.eye(3), np.array([0.1, -0.2, 4.0])
    camera = model_camera(Place('x', 'here'), model, params, pose, (640, 480))
    pvibr.write_cameras(tmp_path, [pvibr.Photo('a b.png', camera)], format=format)
    (image,) = pycolmap.Reconstruction(str(tmp_path)).images.values()
    where = points(8)
    expected = [image.project_point(point) for point in where]
    expected = np.array([[np.nan] * 2 if e is None else e for e in expected]) - 0.5
    off = np.abs(pixels(camera, where) - expected)
    assert np.isfinite(off).mean() > 0.9
    assert np.nanmax(off) < 0.01
    # COLMAP ends names in its text files at a space.
    assert image.name == ('a' if format == 'colmap' else 'a b.png')


def test_pix4d_itself(tmp_path):
    """Its converter to COLMAP gives the same poses."""
    converter = pytest.importorskip('opf_tools.opf2colmap.converter')
    path, _ = opf(tmp_path, 3)
    cameras = json.loads((tmp_path / 'calibrated-cameras.json').read_text())['cameras']
    with pytest.warns(pvibr.PvibrWarning, match='have no picture'):
        photos = pvibr.read_cameras(path)
    # Every second one is a sheared fisheye, of which a turn about the axis is the camera's here.
    for photo, camera in zip(photos[::2], cameras[::2], strict=True):
        q, t = converter.orient_pos_computation(camera['orientation_deg'], camera['position'])
        own = np.array(quaternion(photo.camera_from_world[:3, :3]))
        assert np.abs(own - np.sign(own @ q) * q).max() < 1e-9
        assert np.abs(photo.camera_from_world[:3, 3] - np.ravel(t)).max() < 1e-9


def test_observations_of_real_photographs(data_dir):
    """OpenSfM's Berlin set: its own points on its own features."""
    folder = data_dir / 'projection' / 'opensfm_berlin'
    if not folder.is_dir():
        pytest.skip('the real photographs are not here')
    photos = pvibr.read_cameras(folder / 'reconstruction_example.json')
    assert [photo.size for photo in photos] == [(3264, 2448)] * 3
    found = json.loads((folder / 'reconstruction_example.json').read_text())[0]['points']
    rows = [r.split('\t') for r in (folder / 'tracks_example.csv').read_text().splitlines()[1:]]
    off = []
    for name, track, _, x, y, *_ in rows:
        if track in found:
            where = pixels(photos[name].camera, [found[track]['coordinates']])[0]
            # of denormalized_image_coordinates
            off.append(where - [float(x) * 3264 - 0.5 + 1632, float(y) * 3264 - 0.5 + 1224])
    off = np.array(off)
    assert np.median(np.hypot(*off.T)) < 0.9
    assert np.abs(np.median(off, axis=0)).max() < 0.1  # half a pixel would show


def test_orthophotos_as_rasterio_reads_them(tmp_path):
    rasterio = pytest.importorskip('rasterio')
    from rasterio.transform import Affine

    for k, turn in enumerate((0.0, 0.5)):
        path = tmp_path / f'{k}.tif'
        c, s = np.cos(turn), np.sin(turn)
        place = Affine(0.5 * c, 0.25 * s, 5e5, 0.5 * s, -0.25 * c, 5.2e6)
        shape = {'width': 40, 'height': 30, 'count': 3, 'dtype': 'uint8', 'crs': 'EPSG:32632'}
        with rasterio.open(path, 'w', driver='GTiff', transform=place, **shape) as file:
            file.write(np.zeros((3, 30, 40), np.uint8))
        (photo,) = pvibr.read_cameras(path)
        assert (photo.crs, photo.size) == ('EPSG:32632', (40, 30))
        where = np.array([[*rasterio.transform.xy(place, 6.75, 12.0), 3.0]])
        assert np.abs(pixels(photo.camera, where) - [12.0, 6.75]).max() < 1e-6
