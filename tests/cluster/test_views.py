"""Image databases: by their published layout, and drawn again from any side."""

import csv

import numpy as np
import pytest
import pyvista as pv

import pvibr
import pvibr.cluster
from pvibr.cluster import view_database
from pvibr.cluster.view_database import directions_of, grid_of
from pvibr.maths.flip import flip

h5py = pytest.importorskip('h5py', reason='needs h5py')


def make(folder=None):
    import os
    import signal

    import pyvista as pv

    pl = pv.Plotter(off_screen=True)
    ring = pv.ParametricTorus()
    ring['height'] = ring.points[:, 2]
    pl.add_mesh(ring, scalars='height', smooth_shading=True, show_scalar_bar=False)
    pl.add_mesh(pv.Sphere(radius=0.45), color='tan', smooth_shading=True)

    def die(*_):
        if folder is not None and len(list(folder.glob('*.h5'))) > 2:
            mark = folder / 'died'
            if not mark.exists():
                mark.touch()
                os.kill(os.getpid(), signal.SIGKILL)

    pl.renderer.AddObserver('StartEvent', die)
    return pl


def scene():
    """The same as a value: workers cannot import tests."""
    import sys

    import cloudpickle

    cloudpickle.register_pickle_by_value(sys.modules[__name__])
    return make


@pytest.fixture(scope='module')
def database(client, tmp_path_factory):
    path = tmp_path_factory.mktemp('views') / 'ring.cdb'
    assert pvibr.cluster.views(scene(), 100, [0.0, 1.0], path, client=client, size=128) == path
    return path


def rows_of(path):
    with (path / 'data.csv').open(newline='') as file:
        return list(csv.DictReader(file))


def test_the_published_layout(database):
    rows = rows_of(database)
    assert len(rows) == 2 * len(directions_of(100)) == len(list(database.glob('*.h5')))
    assert list(rows[0])[-1] == 'FILE'
    for row in rows[::7]:
        with h5py.File(database / row['FILE']) as file:
            channels = {name: np.asarray(data) for name, data in file['channels'].items()}
            assert 'meta' in file
        assert channels['rgba'].shape == channels['albedo'].shape == (128, 128, 4)
        assert channels['rgba'].dtype == np.uint8
        inside = channels['rgba'][..., 3] == 255
        assert 0.1 < inside.mean() < 0.8
        assert np.isfinite(channels['depth'][inside]).all()
        lengths = np.linalg.norm(channels['normal'][inside], axis=-1)
        assert np.median(lengths) == pytest.approx(1, abs=0.02)
        values = channels['height'][np.isfinite(channels['height'])]
        assert -0.51 <= values.min() < values.max() <= 0.51
        # From the side the upper rows are higher: the top row comes first.
        if row['theta'] == '0.0':
            middle = channels['height'][:, 64]
            assert np.nanmean(middle[:64]) > np.nanmean(middle[64:])


def test_drawn_from_other_sides(database):
    stored = pvibr.read_views(database)
    assert (stored.times, stored.arrays) == ((0.0, 1.0), ('height',))
    local, pl = make(), pv.Plotter(off_screen=True, window_size=(200, 200))
    local.window_size = (200, 200)
    pl.ibr.add(stored)
    assert np.allclose(pl.bounds, local.bounds, atol=1e-4)
    errors = []
    for eye in ((6, 3, 4), (-2, 7, 2), (1, -4, 6)):
        pictures = []
        for each in (local, pl):
            each.camera_position = [eye, (0, 0, 0), (0, 0, 1)]
            each.show(auto_close=False)
            each.renderer.ResetCameraClippingRange()
            each.render()
            pictures.append(each.screenshot())
        errors.append(flip(pictures[1] / 255, pictures[0] / 255).mean())
    assert np.mean(errors) <= 0.08  # 76 views of 128 px; 146 of 256 px have 0.052
    before = pl.screenshot().astype(int)
    stored.color_by('height', cmap='plasma')
    pl.render()
    recolored = pl.screenshot().astype(int)
    assert np.abs(recolored - before).max() > 60
    pl.remove_all_lights()
    pl.add_light(pv.Light(position=(0, 0, -9)))
    pl.render()
    assert np.abs(pl.screenshot().astype(int) - recolored).max() > 60
    pl.ibr.time = 0.9
    pl.render()
    with pytest.raises(KeyError, match='scalars must be one of height'):
        stored.color_by('width')
    pl.close()
    local.close()


def test_a_worker_dies_and_the_same_call_resumes(client, tmp_path):
    path = tmp_path / 'cdb'
    path.mkdir()
    options = {'client': client, 'args': (path,), 'size': 16}
    pvibr.cluster.views(scene(), 12, [0.0], path, **options)
    assert (path / 'died').exists()
    rows = rows_of(path)
    assert len(rows) == len({row['FILE'] for row in rows}) == len(directions_of(12))
    times = {f: f.stat().st_mtime_ns for f in path.glob('*.h5')}
    (gone, *_) = times
    gone.unlink()
    pvibr.cluster.views(scene(), 12, [0.0], path, **options)
    after = {f: f.stat().st_mtime_ns for f in path.glob('*.h5')}
    assert after.keys() == times.keys()
    assert sum(after[f] != times[f] for f in times) == 1
    assert not [f for f in path.iterdir() if f.suffix not in ('.h5', '.csv', '')]


def test_in_situ(tmp_path):
    writer = pvibr.cluster.ViewWriter(tmp_path, 6, size=16, color='tan')
    for radius in (1.0, 2.0, 2.5):
        writer.step(pv.Sphere(radius=radius), min(radius, 2.0))
    assert len(rows_of(tmp_path)) == 12  # the last step took the place of one
    stored = pvibr.read_views(tmp_path)
    assert stored.times == (1.0, 2.0)


def test_a_step_that_fails_replaces_nothing(tmp_path, monkeypatch):
    writer = pvibr.cluster.ViewWriter(tmp_path, 6, size=16, color='tan')
    writer.step(pv.Sphere(), 1.0)
    before = {file.name: file.read_bytes() for file in tmp_path.iterdir()}

    def fail(file, *_):
        if len(list(tmp_path.iterdir())) > len(before) + 3:
            raise OSError('disk full')
        stored(file, *_)

    stored = view_database.store_view
    monkeypatch.setattr(view_database, 'store_view', fail)
    with pytest.raises(OSError, match='disk full'):
        writer.step(pv.Cone(), 1.0)
    assert before.items() <= {f.name: f.read_bytes() for f in tmp_path.iterdir()}.items()
    monkeypatch.undo()
    writer.step(pv.Cone(), 1.0)
    assert {row['FILE'] for row in rows_of(tmp_path)} <= {f.name for f in tmp_path.iterdir()}


def test_grids():
    assert [len(grid_of(n)) for n in (3, 13)] == [6, 146]
    assert len(directions_of(162)) == 146


@pytest.mark.parametrize('name', ['../other.h5', '/tmp/other.h5'])
def test_files_outside_the_folder_are_refused(name, database, tmp_path):
    head, first, *others = (database / 'data.csv').read_text().splitlines()
    first = f'{first.rsplit(",", 1)[0]},{name}'
    (tmp_path / 'data.csv').write_text('\n'.join([head, first, *others]))
    with pytest.raises(ValueError, match='FILE must be of files in the folder'):
        pvibr.read_views(tmp_path)


def test_bad_input(client, database, tmp_path):
    with pytest.raises(FileNotFoundError, match=r'data.csv'):
        pvibr.read_views(tmp_path)
    values = {'angles': 6, 'times': [0.0], 'path': tmp_path / 'no', 'client': client}
    for name, value in (('angles', 1), ('size', 3), ('times', ['x'])):
        with pytest.raises((TypeError, ValueError), match=name):
            pvibr.cluster.views(scene(), **values | {name: value})
    with pytest.raises(TypeError, match='make_scene must be a function'):
        pvibr.cluster.views(pv.Plotter(off_screen=True), **values)
    assert not (tmp_path / 'no').exists()
    (tmp_path / 'data.csv').write_text((database / 'data.csv').read_text().rsplit('\n', 3)[0])
    with pytest.raises((ValueError, FileNotFoundError)):
        pvibr.read_views(tmp_path)


@pytest.mark.slow
def test_pycinema_reads_it(database):
    pycinema = pytest.importorskip('pycinema', reason='needs pycinema')
    from pycinema.filters import CinemaDatabaseReader, ImageReader

    del pycinema
    reader = CinemaDatabaseReader()
    reader.inputs.path.set(str(database))
    images = ImageReader()
    images.inputs.table.set(reader.outputs.table)
    found = images.outputs.images.get()
    assert len(found) == 2 * len(directions_of(100))
    assert found[0].channels['rgba'].shape == (128, 128, 4)
