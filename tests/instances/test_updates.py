"""Updates of instances: after any of them the next frame is that of a fresh set, to the bit."""

from __future__ import annotations

import numpy as np
import pytest
import pyvista as pv
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

import pvibr
from pvibr.gl import Texture
from pvibr.gl.mipmaps import put_rows
from pvibr.meshes.parts import as_parts

CAMERA = {'eye': (7, -9, 4), 'focus': (0, 0, 0)}
LOOK = {'color': 'tan', 'blend': 'multiply', 'clim': (0, 1)}
SIZE = (60, 45)


def points(n, rng):
    return rng.uniform(-2.5, 2.5, (n, 3))


def matrices(n, rng):
    out = np.tile(np.eye(4), (n, 1, 1))
    turns = Rotation.random(n, random_state=int(rng.integers(1000))).as_matrix()
    out[:, :3, :3] = turns * rng.uniform(0.2, 0.9, (n, 1, 1))
    out[:, :3, 3] = points(n, rng)
    return out


class Twin:
    """Arrays of a set, changed as the set is."""

    def __init__(self, n, rng):
        self.rng, self.poses, self.index = rng, points(n, rng), np.arange(n) % 2
        self.scalars = self.colors = self.visible = None

    def given(self) -> dict:
        names = ('poses', 'index', 'scalars', 'colors', 'visible')
        return {name: getattr(self, name) for name in names}

    def poses_of_another_kind_and_number(self, things):
        n = int(self.rng.integers(1, 2 * len(self.poses)))
        kind = points if self.rng.random() < 0.5 else matrices
        if n != len(self.poses):
            self.scalars = self.colors = self.visible = None
        self.poses, self.index = kind(n, self.rng), np.arange(n) % 2
        things.update(poses=self.poses, index=self.index)

    def poses_moved(self, things):
        self.poses = self.poses.copy()
        places = self.poses if self.poses.ndim == 2 else self.poses[:, :3, 3]
        places += self.rng.normal(size=places.shape) * 0.2
        things.poses = self.poses

    def poses_scattered(self, things):
        kind = points if self.poses.ndim == 2 else matrices
        self.poses = kind(len(self.poses), self.rng)
        things.poses = self.poses

    def poses_of_some(self, things):
        ids = np.unique(self.rng.integers(0, len(self.poses), 3))
        kind = points if self.poses.ndim == 2 else matrices
        self.poses = self.poses.copy()
        self.poses[ids] = kind(len(ids), self.rng)
        things.update(ids, poses=self.poses[ids])

    def meshes(self, things):
        self.index = self.rng.integers(0, 2, len(self.poses))
        things.index = self.index

    def scalars_of_all(self, things):
        self.scalars, self.colors = self.rng.random(len(self.poses)), None
        things.scalars = self.scalars

    def colors_of_some(self, things):
        ids = np.unique(self.rng.integers(0, len(self.poses), 3))
        things.update(ids, colors=self.rng.random((len(ids), 3)))
        self.scalars, self.colors = None, things.colors

    def some_hidden(self, things):
        self.visible = self.rng.random(len(self.poses)) < 0.7
        things.visible = self.visible


UPDATES = [name for name in vars(Twin) if name not in ('given', '__init__') and name[0] != '_']


@pytest.fixture(scope='module')
def shapes(bean):
    return [bean, pv.Sphere(theta_resolution=20, phi_resolution=20)]


def frame(see, pl):
    see.place(pl, **CAMERA)
    return see.grab(pl)


def fresh(scenes, shapes, twin):
    looks = twin.given()
    pl, things = scenes.instances(
        shapes, looks.pop('poses'), index=looks.pop('index'), size=SIZE, **LOOK
    )
    things.update(**looks)
    return pl, things


@pytest.mark.slow
@pytest.mark.parametrize('sorted_up_to', [16_384, 30], ids=['single', 'blocks'])
@settings(deadline=None, max_examples=5)
@given(
    seed=st.integers(0, 999),
    n=st.sampled_from([1, 40, 150]),
    steps=st.lists(st.sampled_from(UPDATES), min_size=1, max_size=4),
)
def test_an_updated_set_is_a_fresh_one(scenes, see, shapes, sorted_up_to, seed, n, steps):
    with pytest.MonkeyPatch.context() as patch, pvibr.deterministic():
        patch.setattr('pvibr.instances.group.SORTED', sorted_up_to)
        twin = Twin(n, np.random.default_rng(seed))
        pl, things = fresh(scenes, shapes, twin)
        frame(see, pl)
        for step in steps:
            getattr(twin, step)(things)
            drawn = frame(see, pl)
        other, anew = fresh(scenes, shapes, twin)
        np.testing.assert_array_equal(drawn, frame(see, other))
        assert things.bounds == anew.bounds
        picks = [(t.pick(30, 20), t.pick(22, 25)) for t in (things, anew)]
        assert picks[0] == picks[1]
        pl.close()
        other.close()


def test_motion_keeps_the_order_until_neighbours_have_parted(scenes, see, shapes, monkeypatch):
    monkeypatch.setattr('pvibr.instances.group.SORTED', 30)
    rng = np.random.default_rng(1)
    places = points(4000, rng)
    _, things = scenes.instances(shapes[0], places, size=SIZE)
    before = things.groups[0].ids
    things.poses = places + rng.normal(size=places.shape) * 0.01
    assert things.groups[0].ids is before
    things.poses = points(4000, rng)
    assert (things.groups[0].ids != before).any()


def test_one_pose_uploads_one_row_of_them(scenes, see, shapes, monkeypatch):
    places = matrices(4000, np.random.default_rng(2))
    pl, things = scenes.instances(shapes[0], places, size=SIZE)
    frame(see, pl)
    sizes, upload = [], Texture.upload
    monkeypatch.setattr(Texture, 'upload', lambda t, a: (sizes.append(a.size), upload(t, a))[1])
    monkeypatch.setattr(type(things.groups), '_show_cards', lambda *_: None)
    things.update(2, poses=places[3])
    see.grab(pl)
    assert sizes == [3072 * 4]


def test_the_same_array_changed_in_place_is_new(scenes, see, shapes):
    places = points(20, np.random.default_rng(3))
    pl, things = scenes.instances(shapes[0], places, size=SIZE)
    before = frame(see, pl)
    places += [0.5, 0, 0]
    things.poses = places
    assert np.abs(frame(see, pl) - before).max() > 0.1
    with pytest.raises(ValueError, match='read-only'):
        things.poses[0] = 1


@pytest.mark.parametrize('limit', [16_384, 1])  # up to which each is sorted by itself
def test_bounds_of_many_turned_on_a_plane(monkeypatch, limit):
    monkeypatch.setattr('pvibr.instances.group.SORTED', limit)
    rng, meshes = np.random.default_rng(8), [pv.ParametricEllipsoid(0.5, 0.4, 0.2), pv.Cube()]
    poses = matrices(800, rng)
    poses[:, :3, :3] /= np.cbrt(np.linalg.det(poses[:, :3, :3]))[:, None, None]
    index = rng.integers(0, 2, len(poses))
    things = pvibr.Instances(meshes, points(5, rng), index=[0, 1, 0, 1, 0], bake=False)
    for height in (0, -3):  # new poses of another number, then some of these
        poses[:100, 2, 3] = height
        poses[100:, 2, 3] = 0
        if height:
            things.update(np.arange(100), poses=poses[:100])
        else:
            things.update(poses=poses, index=index)
        posed = [
            np.einsum('nij,pj->npi', poses[index == k, :3, :3], mesh.points.astype(float))
            + poses[index == k, None, :3, 3]
            for k, mesh in enumerate(meshes)
        ]
        ends = np.concatenate([p.reshape(-1, 3) for p in posed])
        truth = np.stack([ends.min(0), ends.max(0)], 1)
        off = (np.reshape(things.bounds, (3, 2)) - truth) * [-1, 1]
        assert off.min() > -1e-6
        assert off.max() < 1e-3 * 0.5


def test_an_update_leaves_the_array_of_the_user(scenes, shapes):
    places = points(5, np.random.default_rng(4))
    kept = places.copy()
    pl, things = scenes.instances(shapes[0], places, size=SIZE)
    things.update([1], poses=[0, 0, 0])
    np.testing.assert_array_equal(places, kept)
    np.testing.assert_array_equal(things.poses[1], 0)
    pl.close()


def test_meshes_are_baked_when_they_are_shown(scenes, shapes):
    pl, things = scenes.instances(shapes, np.zeros((3, 3)), index=[1, 1, 1], size=SIZE)
    assert len(things.atlases) == 1
    things.update([0], index=0)
    assert len(things.atlases) == 2
    assert things.index.tolist() == [0, 1, 1]
    things.phase = [0.1, 0.6, 1.2]
    assert things.index.tolist() == [0, 1, 0]
    pl.close()


def test_looks_of_another_number_are_reset(scenes, shapes):
    pl, things = scenes.instances(
        shapes[0], np.zeros((2, 3)), scalars=[0.0, 1.0], cmap='gray', clim=(0, 2), size=SIZE
    )
    things.poses = np.zeros((3, 3))
    assert things.scalars is None
    assert things.colors is None
    assert things.visible.tolist() == [True] * 3
    things.scalars = [2.0, 1.0, 0.0]
    assert things.colors[:, 0].tolist() == [255, 128, 0]
    things.update(poses=np.ones((1, 3)), scalars=[2.0], visible=[False])
    assert (things.scalars.tolist(), things.visible.tolist()) == ([2.0], [False])
    pl.close()


BAD = {
    'another number without index': ({'poses': np.zeros((5, 3))}, ValueError, 'index'),
    'index out of range': ({'index': [0, 1, 2]}, ValueError, 'index'),
    'poses of some': ({'ids': [0, 1], 'poses': np.zeros((3, 3))}, ValueError, 'poses'),
    'NaN': ({'poses': np.full((3, 3), np.nan)}, ValueError, 'finite'),
    'phase': ({'phase': [np.nan] * 3}, ValueError, 'phase'),
    'phase of another number': ({'phase': [0.0, 0.5]}, ValueError, 'index'),
    'visible of some': ({'ids': [0], 'visible': [0.5]}, ValueError, 'visible'),
    'ids': ({'ids': [3], 'poses': [0, 0, 0]}, IndexError, '3'),
    'scalars': ({'poses': np.zeros((3, 3)), 'scalars': [1.0]}, ValueError, 'scalars'),
    'visible': ({'poses': np.zeros((3, 3)), 'visible': [1, 0, 2]}, ValueError, 'visible'),
}


@pytest.mark.parametrize(('given', 'kind', 'words'), BAD.values(), ids=BAD)
def test_bad_updates_change_nothing(scenes, shapes, given, kind, words):
    places = points(3, np.random.default_rng(5))
    pl, things = scenes.instances(shapes, places, index=[1, 1, 0], size=SIZE)
    with pytest.raises(kind, match=words):
        things.update(**given)
    np.testing.assert_array_equal(things.poses, places)
    assert things.index.tolist() == [1, 1, 0]
    assert things.scalars is None
    assert things._models.required_meshes == frozenset()
    pl.close()


def test_a_culled_mesh_that_nothing_shows_may_be_mirrored(scenes, see, shapes):
    meshes = [as_parts(shapes[0], culling='back'), as_parts(shapes[1])]
    poses = np.tile(np.eye(4), (2, 1, 1))
    given = {'size': SIZE, 'bake': False}
    pl, things = scenes.instances(meshes, poses, index=[0, 1], **given)
    poses = np.diag([-1.0, 1, 1, 1]) @ poses
    for index in ([1, 1], [0, 1]):
        things.update(poses=poses, index=index)
        fresh, _ = scenes.instances(meshes, poses, index=index, **given)
        np.testing.assert_array_equal(frame(see, pl), frame(see, fresh))
        fresh.close()
    pl.close()


@pytest.mark.parametrize('blend', ['replace', 'multiply'])
def test_colours_of_some_leave_the_others(scenes, see, shapes, blend):
    meshes = [as_parts(shapes[1], color=color) for color in ('red', 'blue')]
    given = {'index': [0, 1, 1], 'blend': blend, 'size': SIZE, 'bake': False}
    pl, things = scenes.instances(meshes, [[0, 0, 0], [2, 0, 0], [-2, 0, 0]], **given)
    before = frame(see, pl)
    things.update([0], colors=[255, 0, 0])
    np.testing.assert_allclose(frame(see, pl), before, atol=1.01 / 255)
    pl.close()


def test_none_are_updated_by_nothing(scenes, see, shapes):
    pl, things = scenes.instances(shapes, np.zeros((0, 3)), size=SIZE)
    none = {'poses': np.zeros((0, 3)), 'scalars': [], 'visible': np.zeros(0, bool)}
    things.update([], colors=np.zeros((0, 3)))
    things.update([], **none)
    things.update(**none)
    things.phase = []
    assert things.pick(3, 3) is None
    assert frame(see, pl).min() == 1
    pl.close()


@pytest.mark.parametrize('dtype', [np.uint8, np.float32])
@pytest.mark.parametrize('rows', [[0], [9], [2, 3, 4, 7]])
def test_rows_of_textures(scenes, dtype, rows):
    pl = scenes.empty((8, 8))
    pl.show(auto_close=False)
    rng = np.random.default_rng(6)
    before, after = (rng.integers(0, 255, (10, 5, 4)).astype(dtype) / dtype(3) for _ in range(2))
    before, after = before.astype(dtype), after.astype(dtype)
    texture = Texture(pl.render_window).upload(before)
    put_rows(texture, after, np.array(rows))
    before[rows] = after[rows]
    np.testing.assert_array_equal(texture.download(), before)
    texture.release()
    pl.close()


def test_a_set_that_grows_is_baked_where_that_pays(scenes, shapes):
    pl, things = scenes.instances(shapes[1], np.zeros((1, 3)), size=SIZE, bake=None)
    assert 'single' in things.report()['atlas 0']
    things.poses = points(3000, np.random.default_rng(7))
    assert 'views' in things.report()['atlas 0']
    pl.close()


def test_sets_of_a_mesh_share_its_textures(scenes, see, shapes):
    """They are freed with the last of these, and each set is whole without the other."""
    pl, one = scenes.instances(shapes[1], np.zeros((2, 3)), size=SIZE, bake=True)
    alone = frame(see, pl)
    two = pl.ibr.add_instances(shapes[1], np.ones((2, 3)), cache=scenes.folder, bake=True)
    frame(see, pl)
    names = 'ibr_geometry', 'ibr_poses'
    held = [[t.groups[0].cards.textures[name] for name in names] for t in (one, two)]
    assert [a is b for a, b in zip(*held, strict=True)] == [True, False]
    two.remove()
    np.testing.assert_array_equal(frame(see, pl), alone)
    assert held[0][0].nbytes > 0
    one.remove()
    see.grab(pl)
    assert held[0][0].nbytes == 0
    pl.close()


def test_memory_of_an_instance_is_bounded(scenes, shapes):
    places = np.random.default_rng(0).uniform(0, 9, (40_000, 3))
    pl, things = scenes.instances(shapes[1], places, size=SIZE)
    pl.show(auto_close=False)
    numbers = [int(word) for word in things.report()['an instance'].split() if word.isdigit()]
    assert max(numbers) < 40
    pl.close()
