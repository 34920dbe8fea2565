"""Scenes that workers draw: the same picture as one process draws, whoever dies."""

import os
import signal

import numpy as np
import pytest
import pyvista as pv

import pvibr
from pvibr.cluster.shard_pictures import ShardPicture, composited
from pvibr.core import _vtk
from pvibr.core.errors import PvibrError
from pvibr.maths.flip import flip

distributed = pytest.importorskip('distributed', reason='needs distributed')
dask = pytest.importorskip('dask', reason='needs distributed')

CAMERAS = [((9, 7, 5), (0, 0, 0), (0, 0, 1)), ((-4, 2, -6), (0.5, 0, 0), (0, 1, 0))]


def things(pl, count=2000):
    rng = np.random.default_rng(0)
    places = rng.uniform(-3, 3, (count, 3))
    colors = rng.integers(0, 255, (count, 3)).astype(np.uint8)
    pl.ibr.add_spheres(places, rng.uniform(0.03, 0.15, count), colors=colors, specular=0.5)
    trees = pl.ibr.add_instances(
        [pv.Cone(resolution=20), pv.Cube()], places[:200], scale=0.3, color='tan', bake=False
    )
    trees.visible = np.arange(200) % 5 > 0


def plotter(samples=0, **options):
    pl = pv.Plotter(off_screen=True, window_size=(240, 180), **options)
    pl.render_window.SetMultiSamples(samples)
    return pl


def shot(pl, camera=CAMERAS[0]):
    pl.camera_position = camera
    pl.show(auto_close=False)
    pl.render()
    return pl.screenshot().astype(int)


def test_the_picture_of_one_process(client):
    pl = plotter()
    things(pl)
    pl.add_mesh(pv.Cube(x_length=2, y_length=2, z_length=2), color='red')
    pl.add_axes()
    expected = [shot(pl, camera) for camera in CAMERAS]
    shards = pl.ibr.distribute(client)
    assert list(pl.ibr) == [shards]
    for camera, picture in zip(CAMERAS, expected, strict=True):
        assert np.abs(shot(pl, camera) - picture).max() <= 1
    redraws = shards.report()['redraws']
    pl.render()
    assert shards.report()['redraws'] == redraws > 1  # again for another view only
    pl.ibr.add(pvibr.Bloom(threshold=0.1))
    assert np.abs(shot(pl, CAMERAS[1]) - expected[1]).max() > 5
    pl.close()


def _with_ssaa(pl):
    pl.enable_anti_aliasing('ssaa')


def _with_translucent(pl):
    pl.add_mesh(pv.Cube(x_length=5), color='blue', opacity=0.4)
    pl.enable_depth_peeling()


def _with_volume(pl):
    image = pv.ImageData(dimensions=(20,) * 3, origin=(-2,) * 3, spacing=(0.2,) * 3)
    image['value'] = np.linspace(0, 1, 8000)
    pl.add_volume(image, opacity='linear', show_scalar_bar=False)


def _with_lamp(pl):
    pl.remove_all_lights()
    pl.add_light(pv.Light(position=(5, 5, 5), positional=True, cone_angle=40))


@pytest.mark.parametrize(
    'change', [_with_ssaa, _with_translucent, _with_volume, _with_lamp], ids=lambda f: f.__name__
)
def test_beside_what_else_is_in_the_scene(client, change):
    pl = plotter()
    things(pl, 300)
    change(pl)
    expected = shot(pl)
    pl.ibr.distribute(client)
    assert np.abs(shot(pl) - expected).max() <= 1
    pl.close()


@pytest.mark.parametrize(
    ('change', 'share'), [('enable_eye_dome_lighting', 0.2), ('enable_ssao', 0.7)]
)
def test_what_reads_depth_sees_the_shards(client, change, share):
    pl = plotter()
    things(pl, 300)
    plain = shot(pl)
    getattr(pl, change)()
    expected = shot(pl)
    pl.ibr.distribute(client)
    error, effect = (flip(a / 255, expected / 255).mean() for a in (shot(pl), plain))
    assert error < share * effect  # normals are those of the depth, wrong at silhouettes
    pl.close()


def test_cards(client):
    pl = plotter(8)
    places = np.random.default_rng(1).uniform(-3, 3, (150, 3))
    ring = pv.ParametricTorus(u_res=100, v_res=50, w_res=10)
    rings = pl.ibr.add_instances(ring, places, scale=0.1, color='tan')
    expected = shot(pl)
    cards = 'splat', 'flat', 'parallax', 'blended', 'fine'
    assert sum(rings.report()[level] for level in cards) > 100
    pl.ibr.distribute(client)
    assert flip(shot(pl) / 255, expected / 255).mean() <= 0.01
    pl.close()


def test_parts_of_a_large_mesh(client, tmp_path):
    x, y = np.meshgrid(*[np.linspace(-5, 5, 200)] * 2)
    hills = pv.StructuredGrid(x, y, np.sin(x) * np.cos(2 * y))
    path = tmp_path / 'hills.pvl'
    hills.extract_surface(algorithm='dataset_surface').triangulate().ibr.large(path)

    def make(index, count, path):
        pl = pv.Plotter(off_screen=True)
        pl.ibr.add_large_mesh(path, color='tan', part=(index, count))
        return pl

    pl, local = plotter(), plotter()
    whole = local.ibr.add_large_mesh(path, color='tan')
    expected = [shot(local, camera) for camera in CAMERAS]
    assert whole.report()['patches'] > 10
    pl.ibr.distribute(client, make, count=3, args=(path,))
    for camera, picture in zip(CAMERAS, expected, strict=True):
        assert np.abs(shot(pl, camera) - picture).max() <= 1
    pl.close()
    local.close()


def test_far_from_the_origin(client):
    pl = plotter()
    places = np.random.default_rng(1).uniform(-3, 3, (150, 3)) + 5e6
    pl.ibr.add_spheres(places, 0.2, color='tan')
    pl.camera_position = 'iso'
    expected = shot(pl, 'iso')
    pl.ibr.distribute(client)
    assert np.abs(shot(pl, 'iso') - expected).max() <= 1
    pl.close()


def test_scalar_bars_stay(client):
    pl = plotter()
    cloud = pv.PolyData(np.random.default_rng(1).uniform(-3, 3, (150, 3)))
    cloud['height'] = cloud.points[:, 2]
    pl.ibr.add_spheres(cloud, 0.2, scalars='height', scalar_bar_args={'vertical': True})
    expected = shot(pl)
    shards = pl.ibr.distribute(client)
    assert np.abs(shot(pl) - expected).max() <= 1
    pl.ibr.remove(shards)
    assert not len(pl.scalar_bars)
    pl.ibr.add(shards)
    assert np.abs(shot(pl) - expected).max() <= 1
    pl.ibr.remove(shards)
    other = plotter()
    other.ibr.add(shards)
    assert np.abs(shot(other) - expected).max() <= 1
    assert not len(pl.scalar_bars)
    other.close()
    pl.close()


def test_samples(client):
    pl = plotter(8)
    things(pl, 500)
    expected = shot(pl)
    pl.ibr.distribute(client, count=4)
    assert flip(shot(pl) / 255, expected / 255).mean() <= 0.01
    pl.close()


def test_shards_made_by_the_workers(client):
    def make(index, count, color):
        import pyvista as pv

        pl = pv.Plotter(off_screen=True)
        pl.add_mesh(pv.Sphere(center=(index, 0, 0), theta_resolution=50), color=color)
        return pl

    pl, local = plotter(shape=(1, 2)), plotter(shape=(1, 2))
    shards = pl.ibr.distribute(client, make, count=3, args=('tan',))
    assert shards.n_shards == 3
    for k in range(3):
        local.add_mesh(pv.Sphere(center=(k, 0, 0), theta_resolution=50), color='tan')
    np.testing.assert_allclose(pl.bounds, local.bounds)
    assert np.abs(shot(pl) - shot(local)).max() <= 1
    pl.ibr.remove(shards)
    pl.ibr.add(shards)
    assert np.abs(shot(pl) - shot(local)).max() <= 1
    pl.close()
    local.close()


def test_a_worker_dies_in_the_middle_of_a_frame(client, tmp_path):
    def make(index, count, folder):
        pl = pv.Plotter(off_screen=True)
        pl.add_mesh(pv.Sphere(center=(index, 0, 0)))
        mark = folder / 'died'

        def die(*_):
            if index == 1 and not mark.exists():
                mark.touch()
                os.kill(os.getpid(), signal.SIGKILL)

        pl.renderer.AddObserver('StartEvent', die)
        return pl

    pl = plotter()
    shards = pl.ibr.distribute(client, make, args=(tmp_path,))
    picture = shot(pl)
    assert (tmp_path / 'died').exists()
    assert shards.report()['deaths'] == 1
    for k in range(2):
        pl.add_mesh(pv.Sphere(center=(k, 0, 0)))
    pl.ibr.remove(shards)
    assert np.abs(shot(pl) - picture).max() <= 1
    pl.close()


def test_a_moving_camera_gets_a_coarser_picture(client, monkeypatch):
    pl = plotter()
    things(pl, 200)
    shards = pl.ibr.distribute(client)
    fine = shot(pl)
    monkeypatch.setattr(type(pl.ibr._adaptive_quality), 'quality', lambda *_: 0.5)
    coarse = shot(pl)
    assert 0 < flip(coarse / 255, fine / 255).mean() < 0.2
    shards.coarse = 1.0
    assert np.abs(shot(pl) - fine).max() <= 1
    pl.close()


def test_pictures_survive_compression():
    rng = np.random.default_rng(0)
    color, depth = np.zeros((7, 9, 4), np.uint8), np.full((7, 9), np.inf, np.float32)
    color[2:5, 3:8], depth[2:5, 3:8] = rng.integers(1, 255, (3, 5, 4)), rng.random((3, 5))
    picture = ShardPicture.of(color, depth)
    assert picture.rect == (3, 2, 8, 5)
    again = ShardPicture.unpacked(picture.packed())
    np.testing.assert_array_equal(again.color, picture.color)
    np.testing.assert_array_equal(again.depth, picture.depth)
    whole = again.within((0, 0, 9, 7))
    np.testing.assert_array_equal(whole.color, color)


def test_translucent_ones_by_order_of_shards():
    inf = np.full((1, 1), np.inf, np.float32)
    red = ShardPicture.of(np.array([[[128, 0, 0, 128]]], np.uint8), inf)
    blue = ShardPicture.of(np.array([[[0, 0, 255, 255]]], np.uint8), np.ones((1, 1), np.float32))
    nothing = ShardPicture.of(np.zeros((1, 1, 4), np.uint8), inf)
    front = composited([red, nothing, blue])
    np.testing.assert_array_equal(front.color, [[[128, 0, 127, 255]]])
    np.testing.assert_array_equal(composited([blue, red]).color, blue.color)


@pytest.mark.parametrize(
    ('options', 'error', 'text'),
    [
        ({}, ValueError, 'things must have instances'),
        ({'count': 0}, ValueError, 'count'),
        ({'args': (1,)}, ValueError, 'args and kwargs require make_shard'),
        ({'things': [3]}, TypeError, 'things must be instances or quadrics'),
        ({'make_shard': 3}, TypeError, 'make_shard must be a function that returns a plotter'),
        ({'make_shard': lambda *_: 3}, PvibrError, r'make_shard must return a pyvista.Plotter'),
        ({'make_shard': lambda *_: 1 / 0}, PvibrError, r'shard 0.*ZeroDivisionError'),
    ],
    ids=range(7),
)
def test_bad_input(client, options, error, text):
    pl = plotter()
    with pytest.raises(error, match=text):
        pl.ibr.distribute(client, **options)
    assert not len(pl.ibr)
    pl.close()


def test_what_cannot_be_sent(client, tmp_path):
    pl = plotter()
    with pytest.raises(TypeError, match=r'make_shard cannot be sent to workers.*in make_shard'):
        pl.ibr.distribute(client, lambda *_: pl)
    with pytest.raises(FileNotFoundError, match=r'must be there for all workers'):
        pl.ibr.distribute(client, lambda *_: None, args=(tmp_path / 'none',))
    pl.close()


def test_clipped_things_are_not_sent(client):
    pl = plotter()
    balls = pl.ibr.add_spheres(np.eye(3))
    balls.mapper.AddClippingPlane(_vtk.vtkPlane())
    with pytest.raises(ValueError, match=r'things must have no clipping planes.*make_shard'):
        pl.ibr.distribute(client)
    assert list(pl.ibr) == [balls]
    pl.close()


@pytest.mark.slow
def test_a_scene_of_three_times_the_memory_of_a_worker():
    count, points = 4, 8_000_000

    def make(index, count, points):
        import numpy as np
        import pyvista as pv

        places = np.random.default_rng(index).uniform(-3, 3, (points, 3)).astype(np.float32)
        places[:, 0] = (places[:, 0] + 3) / count - 3 + 6 * index / count
        pl = pv.Plotter(off_screen=True)
        pl.add_mesh(pv.PolyData(places), style='points', point_size=1, color='tan')
        return pl

    def memory():
        import psutil

        return psutil.Process().memory_info().rss

    # By driver, a worker takes 1.4 to 1.7 GB as it draws.
    options = {'threads_per_worker': 1, 'dashboard_address': ':0', 'memory_limit': '2GiB'}
    # Dask would pause workers that use more than four fifths, which these do.
    keeps_on = {'distributed.worker.memory.pause': False, 'distributed.worker.memory.spill': False}
    with (
        dask.config.set(keeps_on),
        distributed.LocalCluster(n_workers=count, **options) as cluster,
        distributed.Client(cluster) as own,
    ):
        bare, here = min(own.run(memory).values()), memory()
        pl = plotter()
        shards = pl.ibr.distribute(own, make, args=(points,))
        assert (shot(pl) < 250).any(-1).mean() > 0.1
        used = list(own.run(memory).values())
        assert shards.report()['deaths'] == 0
        assert sum(used) - (count - 1) * bare > 3 * max(used)  # all of it in one process
        assert memory() - here < max(used) / 4
        pl.close()
