import imageio.v3 as iio
import numpy as np
import pytest
import pyvista as pv

from pvibr.cli.view import main
from tests.refusals import refused

SIZE = (96, 64)


@pytest.fixture
def mesh(tmp_path):
    file = tmp_path / 'ball.ply'
    pv.Sphere(theta_resolution=12, phi_resolution=12).save(file)
    return file


@pytest.fixture
def poses(tmp_path):
    file = tmp_path / 'poses.csv'
    file.write_text('east,north,growth,name\n0,0,1,a\n3,0,2,b\n0,3,3,c\n')
    return file


def drawn(mesh, poses, **kwargs):
    out = mesh.with_name('view.png')
    main(mesh, poses, columns=('east', 'north', None), size=SIZE, out=out, **kwargs)
    return iio.imread(out).astype(float)


def covered(picture):
    return np.abs(picture - picture[0, 0]).max(-1) > 20


def test_a_picture_and_a_report(mesh, poses, capsys):
    picture = drawn(mesh, poses)
    assert picture.shape == (SIZE[1], SIZE[0], 3)
    assert 0.01 < covered(picture).mean() < 0.6
    said = capsys.readouterr().out
    assert '3 instances' in said
    assert 'ms per frame' in said


def test_a_mesh_alone_stands_on_a_ground_with_its_shadow(mesh, capsys):
    main(mesh, size=SIZE)
    path = capsys.readouterr().out.split('wrote ')[1].strip()
    picture = iio.imread(path).astype(float)
    assert 0.1 < covered(picture).mean() < 0.6
    middle, shadow = picture[27, 51], picture[40, 44]
    assert middle[2] > middle[0]  # a ball in PyVista's blue
    assert shadow.mean() < 0.75 * picture[54, 52].mean()  # beside the ground in the sun
    jpg = mesh.with_suffix('.jpg')
    main(mesh, size=SIZE, out=jpg)
    assert jpg.read_bytes()[:2] == b'\xff\xd8'
    with pytest.raises(ValueError, match='--scalars requires a table of poses: add --poses'):
        main(mesh, size=SIZE, scalars='growth')


def test_scale_makes_larger(mesh, poses):
    # The camera steps back, since larger balls make a larger scene, but not as far.
    assert covered(drawn(mesh, poses, scale=2)).mean() > 1.5 * covered(drawn(mesh, poses)).mean()


def test_scalars_colour(mesh, poses):
    gray, colored = drawn(mesh, poses), drawn(mesh, poses, scalars='growth', cmap='hot')
    saturation = [np.ptp(picture, axis=-1).max() for picture in (gray, colored)]
    assert saturation[1] > saturation[0] + 60


@pytest.mark.parametrize(('name', 'said'), [('hight', 'growth, name'), ('name', 'text')])
def test_a_wrong_column_is_named(mesh, poses, name, said):
    refused(said, drawn, mesh, poses, scalars=name)


def test_matrices_are_scaled_where_they_are(tmp_path):
    from pvibr.cli.view import _scaled

    matrices = np.tile(np.eye(4), (2, 1, 1))
    matrices[:, :3, 3] = 5
    scaled = _scaled(matrices, 3.0)
    assert np.array_equal(scaled[:, :3, 3], matrices[:, :3, 3])
    assert np.array_equal(scaled[0, :3, :3], 3 * np.eye(3))
    assert matrices[0, 0, 0] == 1
    assert _scaled(matrices[:, :3, 3], 3.0).shape == (2, 4, 4)


@pytest.mark.slow
def test_a_statue_at_every_stem(data_dir, tmp_path):
    main(
        data_dir / 'meshes' / 'koala.obj',
        data_dir / 'instances' / 'scbi_forestgeo' / 'scbi_alive_stems_2018.csv.gz',
        columns=('gx', 'gy', None),
        scalars='dbh_mm',
        scale=0.4,
        out=tmp_path / 'a.png',
        size=SIZE,
    )
    assert covered(iio.imread(tmp_path / 'a.png').astype(float)).mean() > 0.03


def test_a_table_without_rows_is_an_error(mesh, tmp_path):
    file = tmp_path / 'none.csv'
    file.write_text('east,north\n')
    refused(r'none\.csv.*no rows', drawn, mesh, file)
