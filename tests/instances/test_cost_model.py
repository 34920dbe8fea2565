"""Images are baked where they pay."""

from __future__ import annotations

import gc

import numpy as np
import pytest
import pyvista as pv

import pvibr
from pvibr.gl.driver import SOFTWARE
from pvibr.instances import memory
from pvibr.instances.card_layers import PATCHES
from pvibr.instances.cost_model import saved_by_meshes, why_not_baked
from pvibr.instances.instances import Instances
from pvibr.instances.limits import Limits, by_cost
from tests.instances.scenes import forget


def test_more_triangles_and_more_instances_pay_more():
    pays = [
        [not why_not_baked(t, n) for n in (1, 30, 1000, 100_000)] for t in (6, 200, 10**4, 10**6)
    ]
    assert pays == np.maximum.accumulate(np.maximum.accumulate(pays, 0), 1).tolist()
    assert not any(row[0] for row in pays)
    assert pays[2][2]
    assert pays[3][1]
    assert not pays[1][1]


@pytest.mark.parametrize('seed', range(5))
def test_meshes_take_over_where_they_cost_less(seed):
    """Then alone, up to the size from which they are drawn anyway."""
    rng = np.random.default_rng(seed)
    names, ends = ('splat', 'flat', 'parallax', 'blended'), np.zeros(PATCHES)
    cards = {}
    for name in names:
        cards[name] = np.stack([ends, ends := ends + rng.uniform(0, 40, PATCHES)])
    meshes = np.full((4, PATCHES), np.inf)
    meshes[1:] = np.sort(rng.uniform(0, 200, (3, PATCHES)), axis=0)[::-1]
    triangles = 40_000 // 4 ** np.arange(4)
    found = by_cost(before := Limits(cards, ends, meshes), triangles, SOFTWARE)
    for k in (1, 2, 3):  # a lighter one is none from where the triangles of the next are nothing
        size = found.mesh_to[k]
        hardly_cost = np.isclose(triangles[k - 1] * 80.0, size**2 * 20.0)
        assert ((size == meshes[k]) | hardly_cost).all()
        assert (size <= meshes[k]).all()
    assert (found.mesh_from < before.mesh_from).any()
    sizes = np.arange(1.0, 161.0, 0.25)
    for patch in range(PATCHES):
        limits = found.mesh_to[:, patch]
        level = [max(k for k, limit in enumerate(limits) if size <= limit) for size in sizes]
        saved = np.zeros(len(sizes))
        for name, (low, high) in cards.items():
            shown = (low[patch] <= sizes) & (sizes < high[patch])
            saved += shown * saved_by_meshes(SOFTWARE, triangles[level], name, sizes) / sizes**3
            now = found.cards[name][:, patch]
            end = found.mesh_from[patch]
            assert np.allclose(now, np.minimum((low[patch], high[patch]), end))
        total = saved[::-1].cumsum()[::-1]  # from a size on
        taken = np.interp(found.mesh_from[patch], sizes, total)
        assert taken >= max(total.max(), 0) - 0.1 * np.abs(saved).sum()
        steps = 0.01 * np.abs(saved).sum()  # of sizes that are compared, which are few
        assert taken >= -steps or found.mesh_from[patch] == before.mesh_from[patch]


def two(size):
    """Return the limits of a mesh and of a lighter one."""
    return np.repeat([[np.inf], [size]], PATCHES, 1)


def test_heavy_meshes_take_nothing_over():
    cards = {'blended': np.stack([np.zeros(PATCHES), np.full(PATCHES, 100.0)])}
    limits = Limits(cards, np.full(PATCHES, 100.0), two(90.0))
    found = by_cost(limits, [10**6, 10**5], SOFTWARE)
    np.testing.assert_allclose(found.mesh_from, 100, rtol=1e-9)
    np.testing.assert_allclose(found.cards['blended'], cards['blended'], rtol=1e-9)
    assert by_cost(limits, [10**6, 400], SOFTWARE).mesh_from.max() == pytest.approx(
        100  # 91 px show the mesh
    )
    light = by_cost(Limits(cards, limits.mesh_from, two(200.0)), [10**6, 400], SOFTWARE)
    assert light.mesh_from.max() < 40


@pytest.fixture
def unbaked(monkeypatch):
    """Let nothing be baked."""

    def bake(*_args, **_kwargs):
        raise AssertionError('baked')

    monkeypatch.setattr('pvibr.instances.levels.bake_parts', bake)


@pytest.mark.parametrize('count', [1, 50])
@pytest.mark.parametrize('mesh', [pv.Cone(), pv.Cube(), pv.Arrow()], ids=['cone', 'cube', 'arrow'])
def test_light_meshes_are_drawn_as_they_are(scenes, see, mesh, count, unbaked):
    poses = np.random.default_rng(3).uniform(-2, 2, (count, 3))
    camera = {'eye': (0.0, -40.0, 9.0)}
    pl, things = scenes.instances(mesh, poses, bake=None, camera=camera)
    drawn = see.grab(pl)
    assert 'not baked' in things.report()['atlas 0']
    pl.close()
    np.testing.assert_array_equal(drawn, see.grab(scenes.actors(mesh, poses, camera=camera)))


def test_what_was_not_baked_can_be(scenes, see, bean):
    poses = [[0, 0, 0], [2, 0, 0]]
    camera = {'eye': (1.0, -30.0, 0.0), 'focus': (1, 0, 0)}
    pl, things = scenes.instances(bean, poses, bake=False, camera=camera)
    meshes = see.grab(pl)
    assert 'bake is False' in things.report()['atlas 0']
    things.bake()
    images = see.grab(pl)
    assert 'not baked' not in things.report()['atlas 0']
    assert 0 < np.abs(images - meshes).mean() < 0.01
    pl.close()


def test_a_forced_image_is_baked(scenes, see, bean):
    pl, things = scenes.instances(bean, [[0, 0, 0]], bake=None)
    assert 'single instance' in things.report()['atlas 0']
    things.force_level = 'mesh'
    assert 'single instance' in things.report()['atlas 0']
    things.force_level = 'flat'
    assert 'views of 128' in things.report()['atlas 0']
    see.grab(pl)
    pl.close()


def test_images_shrink_where_gpu_memory_is_limited(scenes, bean, monkeypatch):
    def atlas(**kwargs):
        own = bean.scale(1.01)  # what other sets hold already takes no more
        pl, things = scenes.instances(own, [[0, 0, 0]], level='flat', color='tan', **kwargs)
        report = things.report()['atlas 0']
        size = things.atlases[0].nbytes
        pl.close()
        return size, report

    _, report = atlas(gpu_memory=0.1)
    assert 'not baked: GPU memory' in report
    size, report = atlas(gpu_memory=4)
    assert size <= 4 * 2**20
    assert 'views of 32 texels, not 128' in report
    monkeypatch.setenv('PVIBR_GPU_MEMORY', '0')
    _, report = atlas(diffuse=0.9, opacity=0.99)
    assert 'at its limit' in report
    for bad in (-1, 'much', float('nan')):
        with pytest.raises(ValueError, match='gpu_memory'):
            atlas(gpu_memory=bad)
    monkeypatch.setenv('PVIBR_GPU_MEMORY', 'much')
    with pytest.raises(ValueError, match='PVIBR_GPU_MEMORY'):
        atlas()


@pytest.fixture
def limited(monkeypatch):
    """A function that leaves so much GPU memory for images, in MiB."""

    def limit(mib):
        forget()  # else the oldest goes, and leaves room, when a new one is kept
        gc.collect()
        held = memory.limit_bytes() - memory.available_bytes()
        monkeypatch.setattr('pvibr.instances.memory.limit_bytes', lambda: held + mib * 2**20)

    return limit


def test_what_was_refused_is_asked_for_again_where_there_is_room(scenes, bean, limited):
    limited(0)
    pl, things = scenes.instances(bean, [[0, 0, 0], [2, 0, 0]])
    (group,) = things.groups
    things.poses = [[0, 0, 0], [3, 0, 0]]
    assert things.groups[0] is group
    limited(128)
    things.poses = [[0, 0, 0], [2, 0, 0]]
    assert 'views of 128' in things.report()['atlas 0']
    pl.close()


def test_a_bake_that_failed_is_repeated_only_if_asked_for(scenes, bean, monkeypatch):
    tried = []

    def fail(*_args, **_kwargs):
        tried.append(1)
        raise RuntimeError

    monkeypatch.setattr('pvibr.instances.levels.bake_parts', fail)
    with pytest.warns(pvibr.PvibrWarning, match='cards are disabled'):
        pl, things = scenes.instances(bean.scale(1.02), [[0, 0, 0], [2, 0, 0]])
    things.poses = np.zeros((5, 3))
    assert len(tried) == 1
    with pytest.warns(pvibr.PvibrWarning, match='cards are disabled'):
        things.bake()
    pl.close()


def test_sets_of_a_mesh_share_images_that_had_to_shrink(scenes, bean, limited):
    limited(16)
    pl, one = scenes.instances(bean.scale(1.01), [[0, 0, 0]], color='tan')
    two = pl.ibr.add_instances(
        bean.scale(1.01), [[2, 0, 0]], cache=scenes.folder, bake=True, color='tan'
    )
    assert one.atlases[0].tile == 32
    assert two.atlases[0] is one.atlases[0]
    assert 'texels, not 128' in two.report()['atlas 0']
    pl.close()


@pytest.mark.parametrize('call', [Instances.bake, lambda t: setattr(t, 'force_level', 'flat')])
def test_an_interrupted_bake_was_not_asked_for(scenes, bean, monkeypatch, call):
    def interrupt(*_args, **_kwargs):
        raise KeyboardInterrupt

    pl, things = scenes.instances(bean, [[0, 0, 0]], bake=None)
    with monkeypatch.context() as patch:
        patch.setattr('pvibr.instances.mesh_models.make_model', interrupt)
        with pytest.raises(KeyboardInterrupt):
            call(things)
    assert things.force_level is None
    things.poses = np.zeros((2, 3))
    assert 'not baked' in things.report()['atlas 0']
    pl.close()
