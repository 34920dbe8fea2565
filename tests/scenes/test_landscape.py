"""The landscape: trees on the ground, apart, off the trail; a walk that sees thousands."""

import time

import numpy as np
import pytest
from scipy.spatial import cKDTree

from pvibr.scenes.landscape import CLEARING, SCALES, landscape
from tests.marks import slow
from tests.refusals import refused


@pytest.fixture(scope='module')
def scene():
    return landscape(10_000)


def _feet(scene):
    return scene.matrices[:, :3, 3]


def test_ten_thousand_trees_in_less_than_a_second(scene):
    start = time.process_time()
    again = landscape(10_000)
    assert time.process_time() - start < 2
    assert scene.matrices.shape == (10_000, 4, 4)
    np.testing.assert_array_equal(again.matrices, scene.matrices)
    np.testing.assert_array_equal(again.index, scene.index)
    assert again.terrain == scene.terrain
    assert again.path(7) == scene.path(7)
    assert not np.array_equal(landscape(10_000, seed=1).matrices, scene.matrices)


def test_trees_are_upright_scaled_and_apart(scene):
    scales = np.linalg.norm(scene.matrices[:, :3, :3], axis=1)
    assert np.ptp(scales, axis=1).max() < 1e-12
    assert SCALES[0] <= scales.min() < scales.max() <= SCALES[1]
    np.testing.assert_allclose(scene.matrices[:, :3, 2] / scales, np.tile([0, 0, 1], (10_000, 1)))
    feet = _feet(scene)[:, :2]
    assert cKDTree(feet).query(feet, k=2)[0][:, 1].min() > 2.5
    assert np.bincount(scene.index).min() > 1000


def test_feet_stand_on_the_ground_drawn(scene):
    feet = _feet(scene)
    for x, y, z in feet[::500]:
        point, _ = scene.terrain.ray_trace([x, y, -2000], [x, y, 2000], first_point=True)
        assert 0.1 < point[2] - z < 0.5
    sunk = scene.height_at(feet[:, :2]) - feet[:, 2]
    assert 0.1 < sunk.min() < sunk.max() < 0.5
    np.testing.assert_allclose(
        scene.height_at(scene.terrain.points[:, :2]), scene.terrain.points[:, 2], atol=1e-3
    )


def test_clumps_and_clearings(scene):
    counts = np.histogram2d(*_feet(scene)[:, :2].T, bins=40)[0]
    assert counts.var() > 3 * counts.mean()


def test_the_walk_is_smooth_and_free(scene):
    eyes, focus, _ = np.array(scene.path(1100)).transpose(1, 0, 2)
    above = eyes[:, 2] - scene.height_at(eyes[:, :2])
    assert 2 <= above.min() < 4
    assert 9 < above.max() <= 12
    steps = np.linalg.norm(np.diff(eyes, axis=0), axis=1)
    assert steps.max() < 5
    looks = (focus - eyes) / np.linalg.norm(focus - eyes, axis=1, keepdims=True)
    assert (looks[1:] * looks[:-1]).sum(axis=1).min() > np.cos(np.radians(5))
    feet = _feet(scene)
    nearest = cKDTree(feet[:, :2]).query(eyes[:, :2])[0]
    assert nearest.min() > CLEARING - 0.5
    reach = max(np.abs(mesh.bounds[:4]).max() for mesh in scene.meshes) * SCALES[1]
    assert (nearest < reach).mean() < 0.2
    inside = np.abs(eyes[:, :2]).max()
    assert inside < scene.size / 2


def test_most_frames_see_thousands_and_a_handful_near(scene):
    feet = _feet(scene)
    far, near = [], []
    for eye, focus, _ in scene.path(30):
        look = np.subtract(focus, eye)[:2]
        away = feet[:, :2] - eye[:2]
        distance = np.linalg.norm(away, axis=1)
        seen = away @ look / distance / np.linalg.norm(look) > np.cos(np.radians(38))
        far.append((seen & (distance > 100)).sum())
        near.append((seen & (distance < 25)).sum())
    assert np.median(far) > 1500
    assert np.median(near) < 12


def test_parts_of_the_walk(scene):
    assert scene.path(1, 0.5, 0.5) == [scene.path(3)[1]]
    for bad in ({'frames': 0}, {'frames': 3, 'start': 0.7, 'stop': 0.2}):
        refused('frames must be', scene.path, **bad)


def test_parts_are_ready_to_draw():
    parts = landscape(20).parts()
    assert [[part.alpha_cutoff for part in tree] for tree in parts] == [[None, 0.5]] * 3


@pytest.mark.parametrize(
    ('kwargs', 'match'), [({'n': 0}, 'n must be.*got 0'), ({'n': 5000, 'size': 30}, 'larger size')]
)
def test_bad_wishes_are_named(kwargs, match):
    refused(match, landscape, **kwargs)


@pytest.mark.parametrize('n', [1, 100, slow(100_000)])
def test_any_number_of_trees(n):
    scene = landscape(n)
    assert len(np.unique(scene.matrices, axis=0)) == n
    assert np.isfinite(scene.matrices).all()
