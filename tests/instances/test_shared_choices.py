"""Sets of a subplot choose their levels in one pass, and each chooses what it would alone."""

import numpy as np
import pytest
import pyvista as pv

from pvibr.instances import shared_choices
from pvibr.instances.choices import GroupBlocks
from pvibr.things.frame import Frame

_BALL, _CONE = pv.Sphere(theta_resolution=24, phi_resolution=20), pv.Cone(resolution=60)


def _matrices(count, seed):
    rng = np.random.default_rng(seed)
    matrices = np.tile(np.eye(4), (count, 1, 1))
    matrices[:, :3, :3] = np.linalg.qr(rng.normal(size=(count, 3, 3)))[0]
    matrices[:, :3, 3] = rng.uniform(-8, 8, (count, 3)) * (1, 1, 0.2)
    return matrices


def _scene():
    """Return a plotter with sets of points and matrices, of a mesh or two, in levels of theirs."""
    plotter = pv.Plotter(off_screen=True, window_size=(240, 160))
    poses = [_matrices(40, seed) for seed in range(4)]
    sets = [
        plotter.ibr.add_instances(_BALL, poses[0][:, :3, 3], bake=True),
        plotter.ibr.add_instances(_CONE, poses[1], bake=True),
        plotter.ibr.add_instances([_BALL, _CONE], poses[2], bake=True),
        plotter.ibr.add_instances(_CONE, poses[3], force_level={'flat': (0, 9), 'mesh': (9, 1e6)}),
    ]
    plotter.camera_position = [(14, -12, 6), (0, 0, 0), (0, 0, 1)]
    plotter.show(auto_close=False)
    return plotter, sets


def _walk(plotter, sets):
    """Return pictures of a camera that moves, and of sets that change meanwhile."""
    pictures = []
    for step in range(6):
        plotter.camera.Azimuth(11.0)
        if step == 2:
            sets[0].poses = np.add(sets[0].poses, (0.4, 0, 0))
        if step == 3:
            sets[1].visibility, sets[2].max_error = False, 4.0
            plotter.camera.Dolly(2.5)
        if step == 4:
            sets[1].visibility, sets[3].position = True, (1, 0, 0.5)
            plotter.enable_parallel_projection()
        plotter.render()
        pictures.append(plotter.screenshot(return_img=True))
    return np.stack(pictures)


def test_pictures_are_those_of_sets_that_choose_alone(monkeypatch):
    shared = _walk(*_scene())
    monkeypatch.setattr(shared_choices, '_MOST', 0)
    np.testing.assert_array_equal(_walk(*_scene()), shared)


@pytest.mark.parametrize('parallel', [False, True])
def test_groups_get_the_same_together_and_alone(parallel):
    plotter, sets = _scene()
    if parallel:
        plotter.enable_parallel_projection()
    for distance in (2.0, 0.3):
        plotter.camera.Dolly(1 / distance)
        frame = Frame.of(plotter.renderer)
        limits = [x for things in sets for x in things.version(frame)[0]]
        groups = [group for things in sets for group in things.groups]
        together = GroupBlocks(groups).choose(frame, limits)
        for group, group_limits, choice in zip(groups, limits, together, strict=True):
            (alone,) = GroupBlocks([group]).choose(frame, [group_limits])
            np.testing.assert_array_equal(alone.visible, choice.visible)
            np.testing.assert_array_equal(alone.meshes, choice.meshes)
            assert alone.cards.keys() == choice.cards.keys()
            for name, blocks in alone.cards.items():
                np.testing.assert_array_equal(blocks.table, choice.cards[name].table)
                np.testing.assert_array_equal(blocks.radii, choice.cards[name].radii)


def test_one_pass_serves_all_sets(monkeypatch):
    plotter, sets = _scene()
    passes, choose = [], GroupBlocks.choose

    def noted(blocks, frame, limits):
        passes.append(len(blocks.groups))
        return choose(blocks, frame, limits)

    monkeypatch.setattr(GroupBlocks, 'choose', noted)
    for _ in range(2):
        plotter.camera.Azimuth(5.0)
        plotter.render()
    assert passes == [5, 5]
    plotter.render()
    assert passes == [5, 5]  # nothing has moved
    sets[1].visible = np.arange(40) > 5
    plotter.render()
    assert passes == [5, 5, 1]  # the others have their choice
    plotter.ibr.remove(sets[0])
    plotter.camera.Azimuth(5.0)
    plotter.render()
    assert passes == [5, 5, 1, 4]
    plotter.ibr.add(sets[0])
    plotter.camera.Azimuth(5.0)
    plotter.render()
    assert passes[4:] == [5]
