"""What others of a set hide is not drawn, and nobody can tell."""

from __future__ import annotations

import numpy as np
import pytest
import pyvista as pv
from scipy.spatial.transform import Rotation

import pvibr
from pvibr.instances import hidden_blocks, mesh_groups
from pvibr.instances.group import InstanceGroup
from tests.marks import slow

SIDE = 12
BESIDE = (20, -26, 14)
GOLD, BLUE = (218, 165, 32), (0, 0, 255)


def ball():
    """Return a dented ball: no image of it is like another."""
    ball = pv.Icosphere(radius=1.0, nsub=3)
    ball.points *= 1 - 0.25 * np.abs(np.sin(3 * ball.points[:, :1] + ball.points[:, 1:2]))
    return ball


def ring():
    return pv.ParametricTorus(ringradius=0.7, crosssectionradius=0.3, u_res=24, v_res=12)


def poses(seed=0, side=SIDE, scale=(1.0, 1.0), offset=(0.0, 0.0, 0.0)):
    """Return a dense block of poses about an offset."""
    rng, count = np.random.default_rng(seed), side**3
    matrices = np.tile(np.eye(4), (count, 1, 1))
    turns = Rotation.random(count, random_state=seed).as_matrix()
    matrices[:, :3, :3] = turns * rng.uniform(*scale, (count, 1, 3))
    places = np.stack(np.unravel_index(np.arange(count), (side,) * 3), 1) - (side - 1) / 2
    matrices[:, :3, 3] = 1.6 * places + rng.normal(0, 0.05, (count, 3)) + offset
    return matrices


def look(pl, rng, offset=(0.0, 0.0, 0.0)):
    """Look at the block from anywhere, also from within, by a camera that jumps."""
    way = rng.normal(size=3)
    distance = SIDE * np.exp(rng.uniform(np.log(0.1), np.log(4)))
    focus = rng.normal(0, 2, 3) + offset
    pl.camera.position = focus + way / np.linalg.norm(way) * distance
    pl.camera.focal_point, pl.camera.up = focus, (0.1, 0.2, 1)
    pl.camera.view_angle = rng.uniform(20, 70)
    pl.camera.parallel_projection = rng.uniform() < 0.25
    pl.camera.parallel_scale = SIDE * rng.uniform(0.2, 1.2)
    pl.renderer.ResetCameraClippingRange()


@pytest.fixture
def culling(monkeypatch):
    """Have hidden blocks looked for in each frame, however few there are, until told otherwise."""
    monkeypatch.setattr(hidden_blocks, '_LEAST', 8)
    monkeypatch.setattr(hidden_blocks, '_PAUSE', 0)

    def switch(is_on):
        monkeypatch.setattr(hidden_blocks, '_WORTH', 1.0 if is_on else -1.0)

    switch(is_on=True)
    return switch


@pytest.fixture
def hidden_ids(monkeypatch):
    """The instances that were found hidden and are drawn by no other level either."""
    found: list = []
    without_hidden = InstanceGroup.without_hidden

    def noted(group, choices, are_behind):
        shown = without_hidden(group, choices, are_behind)
        rows = [
            {name: slots_of(group, blocks) for name, blocks in all_blocks.items()}
            for all_blocks in (choices, shown)
        ]
        drawn, kept = (set().union(*by_name.values()) for by_name in rows)
        found.extend(group.ids[sorted(drawn - kept)].tolist())
        return shown

    monkeypatch.setattr(InstanceGroup, 'without_hidden', noted)
    return found


def slots_of(group, blocks):
    numbers = blocks.table[:, 3].astype(int)
    slots = numbers[:, None] * blocks.unit + np.arange(blocks.unit)
    return set(slots[slots < len(group)].tolist())


def picture(pl, things):
    things._content_key = None
    pl.render()
    return pl.screenshot(return_img=True)


KINDS = {
    'dense': (ball, {}),
    'stretched': (ball, {'scale': (0.6, 1.2)}),
    'rings': (ring, {}),
    'in UTM': (ball, {'offset': (5e5, 4.5e6, 300.0)}),
}


@pytest.mark.sampled
@pytest.mark.parametrize('samples', [0, 8])
@pytest.mark.parametrize(
    'kind', [slow(kind, when=kind in ('stretched', 'rings')) for kind in KINDS]
)
def test_pictures_are_the_same_without_what_is_hidden(kind, samples, atlases, culling):
    make, options = KINDS[kind]
    rng, hidden = np.random.default_rng(samples), 0
    pl = pv.Plotter(off_screen=True, window_size=(200, 150))
    pl.ren_win.SetMultiSamples(samples)
    things = pl.ibr.add_instances(make(), poses(**options), color=GOLD, cache=atlases)
    pl.add_mesh(pv.Sphere(radius=5, center=things.poses[0, :3, 3]), color='b', opacity=0.4)
    for _ in range(12):
        look(pl, rng, options.get('offset', (0.0, 0.0, 0.0)))
        culling(is_on=True)
        culled = picture(pl, things)
        hidden += things.report()['hidden']
        culling(is_on=False)
        assert (picture(pl, things) == culled).all()
        assert things.report()['hidden'] == 0
    assert hidden > 0.5 * len(things)


@pytest.mark.sampled
@pytest.mark.parametrize('sorted_count', [10**6, 0], ids=['sorted', 'in blocks'])
def test_what_is_hidden_is_seen_nowhere(sorted_count, atlases, culling, hidden_ids, monkeypatch):
    """Of two meshes, and in large sets; what is left may be drawn in another order."""
    monkeypatch.setattr('pvibr.instances.group.SORTED', 1000)
    monkeypatch.setattr(mesh_groups, 'SORTED_SEEN', sorted_count)
    rng, pl = np.random.default_rng(5), pv.Plotter(off_screen=True, window_size=(200, 150))
    block = poses(3)
    index = rng.integers(0, 2, len(block))
    things = pl.ibr.add_instances([ball(), ring()], block, index=index, cache=atlases)
    assert things.groups[0].unit > 1
    for _ in range(8):
        look(pl, rng)
        culling(is_on=True)
        picture(pl, things)
        culling(is_on=False)
        pictures = []
        for paint in (GOLD, BLUE):
            colors = np.tile(np.array(GOLD, np.uint8), (len(things), 1))
            colors[hidden_ids] = paint
            things.colors = colors
            pictures.append(picture(pl, things))
        assert (pictures[0] == pictures[1]).all()
        hidden_ids.clear()


def test_most_of_a_dense_block_is_not_drawn(atlases):
    """As users have it."""
    pl = pv.Plotter(off_screen=True)
    things = pl.ibr.add_instances(ball(), poses(side=20), cache=atlases)
    pl.show(auto_close=False)
    report = things.report()
    assert report['hidden'] > 0.5 * len(things)
    assert sum(report[name] for name in ('flat', 'parallax', 'blended')) < 0.5 * len(things)


def test_what_becomes_invisible_hides_nothing(atlases, culling):
    pl = pv.Plotter(off_screen=True, window_size=(200, 150))
    things = pl.ibr.add_instances(ball(), poses(), cache=atlases)
    pl.camera.position = BESIDE
    picture(pl, things)
    assert things.report()['hidden'] > 0
    inner = np.abs(things.poses[:, :3, 3]).max(1) < 3
    things.visible = inner
    culled = picture(pl, things)
    culling(is_on=False)
    assert (picture(pl, things) == culled).all()


def test_other_sizes_subplots_and_a_thing_removed(atlases, culling):
    pl = pv.Plotter(off_screen=True, window_size=(240, 100), shape=(1, 2))
    pl.subplot(0, 1)
    things = pl.ibr.add_instances(ball(), poses(), cache=atlases)
    for size in [(240, 100), (300, 260), (160, 80)]:
        pl.window_size = size
        culling(is_on=True)
        culled = picture(pl, things)
        assert things.report()['hidden'] > 0
        culling(is_on=False)
        assert (picture(pl, things) == culled).all()
    culling(is_on=True)
    picture(pl, things)
    things.remove()
    assert things.report()['bytes'] == 0
    pl.ibr.add(things)
    picture(pl, things)
    assert things.report()['hidden'] > 0


def test_shadows_know_what_is_hidden(atlases, culling):
    """A light sees what the eye does not."""
    pl = pv.Plotter(off_screen=True, window_size=(200, 150))
    things = pl.ibr.add_instances(ball(), poses(), cache=atlases)
    pl.add_mesh(pv.Plane(center=(0, 0, -12), i_size=80, j_size=80), color='w')
    pl.ibr.add(pvibr.Shadows())
    pl.camera.position = BESIDE
    culled = picture(pl, things)
    assert things.report()['hidden'] > 0
    culling(is_on=False)
    assert (picture(pl, things) == culled).all()


def test_tries_in_vain_are_seldom(atlases, monkeypatch):
    monkeypatch.setattr(hidden_blocks, '_LEAST', 8)
    monkeypatch.setattr(hidden_blocks, '_LAYERS', (0.01,))
    tries = []
    draw = hidden_blocks.DepthPrepass.farthest_depths
    monkeypatch.setattr(
        hidden_blocks.DepthPrepass, 'farthest_depths', lambda *a: (tries.append(1), draw(*a))[1]
    )
    pl = pv.Plotter(off_screen=True, window_size=(100, 80))
    things = pl.ibr.add_instances(ball(), poses(side=8), cache=atlases)
    pl.camera.position = BESIDE
    for k in range(hidden_blocks._PAUSE):
        pl.camera.azimuth = k
        picture(pl, things)
    assert len(tries) == 1
