"""Bakes by workers: each mesh once, wherever the cache is."""

import os
import signal

import pytest
import pyvista as pv

import pvibr.cluster
from pvibr.cluster import bakes
from pvibr.instances.cache import AtlasCache

#: Puts the file that workers look for where they do not look: as if on another disk.
ELSEWHERE = '../probe-'


def balls(count, resolution=40):
    return [
        pv.Sphere(radius=1 + k, theta_resolution=resolution, phi_resolution=resolution)
        for k in range(count)
    ]


def states(baked):
    return [one.state for one in baked]


@pytest.mark.parametrize('is_shared', [True, False])
def test_large_meshes(client, tmp_path, monkeypatch, is_shared):
    if not is_shared:  # the disk of the workers is another one
        monkeypatch.setattr(bakes, '_PROBE', ELSEWHERE)
    meshes = [
        *balls(2, 120),
        pv.Plane(i_resolution=90, j_resolution=90),
    ]  # with texture coordinates
    options = {'client': client, 'large': True, 'cache': tmp_path}
    baked = pvibr.cluster.bake([*meshes, meshes[1].copy()], **options)
    assert states(baked) == ['baked'] * 4
    assert baked[1] == baked[3]  # the same bake
    assert len(list(tmp_path.glob('*.atlas'))) == 3
    assert states(pvibr.cluster.bake(meshes, **options)) == ['in the cache'] * 3
    monkeypatch.setattr('pvibr.large.stored.build_hierarchy', None)  # it is not built here
    pl = pv.Plotter(off_screen=True)
    assert pl.ibr.add_large_mesh(meshes[2], cache=tmp_path).n_triangles == 2 * meshes[2].n_cells
    assert [file.suffix for file in tmp_path.iterdir()] == ['.atlas'] * 3


@pytest.mark.slow
def test_images(client, tmp_path, monkeypatch):
    monkeypatch.setattr(bakes, '_PROBE', ELSEWHERE)
    meshes = [*balls(1), *balls(1), pv.Line()]
    options = {'client': client, 'cache': tmp_path, 'color': 'tan'}
    baked = pvibr.cluster.bake(meshes, **options)
    assert states(baked) == ['baked', 'baked', 'not baked']
    assert 'lines' in baked[2].why
    assert len(list(tmp_path.glob('*.atlas'))) == 1
    found = pvibr.cluster.bake(meshes, **options)
    assert states(found) == ['in the cache', 'in the cache', 'not baked']


def test_a_bake_that_fails_says_why(client, tmp_path, monkeypatch):
    def fail(_job, _folder):
        raise MemoryError('too large')

    monkeypatch.setattr(bakes, '_build', fail)
    (baked,) = pvibr.cluster.bake(balls(1), client=client, large=True, cache=tmp_path)
    assert (baked.state, baked.why) == ('not baked', 'MemoryError: too large')
    assert not list(tmp_path.iterdir())


def test_a_worker_that_dies_loses_nothing(client, tmp_path, monkeypatch):
    mark = tmp_path / 'died'
    build = bakes._build

    def die(job, folder):
        if not mark.exists():
            mark.touch()
            os.kill(os.getpid(), signal.SIGKILL)
        return build(job, folder)

    monkeypatch.setattr(bakes, '_build', die)
    cache = tmp_path / 'cache'
    baked = pvibr.cluster.bake(balls(4), client=client, large=True, cache=cache)
    assert mark.exists()
    assert states(baked) == ['baked'] * 4
    assert len(list(cache.glob('*.atlas'))) == 4


def test_a_cache_that_is_too_small(client, tmp_path, monkeypatch):
    monkeypatch.setattr(bakes, '_PROBE', ELSEWHERE)
    monkeypatch.setattr(AtlasCache, 'put_packed', lambda *_: False)
    (baked,) = pvibr.cluster.bake(balls(1), client=client, large=True, cache=tmp_path)
    assert (baked.state, 'cannot be written' in baked.why) == ('not baked', True)


@pytest.mark.parametrize(
    ('changed', 'error', 'text'),
    [
        ({'meshes': 'a.ply'}, TypeError, 'meshes must be a sequence'),
        ({'meshes': pv.Sphere()}, TypeError, 'meshes must be a sequence'),
        ({'meshes': [3]}, TypeError, 'mesh must be'),
        ({'meshes': ['a.ply']}, OSError, 'a.ply'),
        ({'cache': False}, ValueError, 'cache must be True or a folder'),
        ({'large': 2}, TypeError, 'large'),
        ({'color': 'tan'}, TypeError, 'large meshes are built without a look, got color'),
        ({'client': 'tcp://here'}, TypeError, 'client must be a distributed.Client'),
    ],
)
def test_bad_input(client, tmp_path, changed, error, text):
    arguments = {'meshes': balls(1), 'client': client, 'large': True, 'cache': tmp_path} | changed
    with pytest.raises(error, match=text):
        pvibr.cluster.bake(**arguments)
    assert not list(tmp_path.iterdir())
