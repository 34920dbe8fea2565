"""Figures posed together are where each is alone."""

import numpy as np
import pytest
import pyvista as pv

from pvibr import Figure
from pvibr.animation import Clip, ClipSource, FigureMesh, Pose, Skeleton, Track
from pvibr.animation.ensemble import Ensemble


def figure(rng, joints, clips):
    parents = np.arange(joints) - 1
    rest = Pose(rng.normal(size=(joints, 3)), rng.normal(size=(joints, 4)))
    return Figure([FigureMesh(pv.Cube(), node=joints - 1)], Skeleton(parents, rest), clips)


def clip(rng, joints, how='linear'):
    def track(node, path, width):
        k = int(rng.integers(1, 7))
        shape = (k, 3, width) if how == 'cubic' else (k, width)
        return Track(node, path, np.cumsum(rng.uniform(0.1, 1, k)), rng.normal(size=shape), how)

    paths = {'translation': 3, 'rotation': 4, 'scale': 3}
    return Clip(how, [track(i, *pair) for i in range(joints) for pair in paths.items()])


@pytest.mark.parametrize('seed', [1, 2])
def test_figures_are_posed_together_as_alone(seed):
    rng = np.random.default_rng(seed)
    shared = clip(rng, 2)
    first, second = figure(rng, 2, [shared]), figure(rng, 5, [clip(rng, 5, 'cubic'), shared])
    third, still = figure(rng, 3, [clip(rng, 3, 'step')]), figure(rng, 2, [Clip('none', [])])
    alone = first.sample(0.3)
    poses = [
        ClipSource(first, 0, speed=-1.5, offset=0.7),
        ClipSource(second, 1, loop='pingpong', count=2.5),
        alone,
        ClipSource(second, 0, speed=0.3, loop=False),
        ClipSource(third, 0, count=1.25),
        ClipSource(still),
    ]
    figures = [first, second, first, second, third, still]
    clips = [getattr(pose, 'clip', None) for pose in poses]
    together = Ensemble(list(zip(figures, ['linear'] * 6, clips, strict=True)))
    for time in (-1.0, 0.0, 0.77, 3.3, 50.0):
        for i, (pose, world, signs, bounds) in enumerate(together.posed(poses, time)):
            wanted = alone if poses[i] is alone else poses[i].sample(time)
            for part in ('translation', 'rotation', 'scale', 'time'):
                assert np.allclose(getattr(pose, part), getattr(wanted, part), atol=1e-12)
            assert np.allclose(world, figures[i].world(wanted), atol=1e-9)
            assert np.allclose(bounds, figures[i].bounds(wanted), atol=1e-9)
            assert np.array_equal(signs, np.sign(np.linalg.det(world[:, :3, :3])))


@pytest.mark.parametrize('loop', [True, False, 'pingpong'])
@pytest.mark.parametrize('count', [None, 1, 2.25])
def test_local_times_are_counted_by_hand(loop, count):
    one = Clip('one', [], duration=2.0)
    for time in np.linspace(-3.1, 14.3, 23):
        cycle = 4.0 if loop == 'pingpong' else 2.0
        cycles = 1 if loop is False else count
        wanted = time
        if cycles is not None:
            wanted = min(max(time, 0.0), cycles * cycle)
        done = cycles is not None and wanted == cycles * cycle and cycles % 1 == 0
        wanted = cycle if done else wanted - cycle * np.floor(wanted / cycle)
        if wanted > 2.0:
            wanted = 4.0 - wanted
        if done and loop == 'pingpong':
            wanted = 0.0
        assert np.isclose(one.local_time(time, loop, count), wanted, atol=1e-9), time
