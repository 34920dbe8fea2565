"""Blocks: neighbours together, nothing that can be seen left out."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pvibr.core import _vtk
from pvibr.maths.blocks import Blocks, morton_order
from pvibr.maths.views import View, frustum_planes
from pvibr.things.frame import Frame

FEW = settings(deadline=None, max_examples=40)


def frame_of(eye, focus, *, parallel=False, size=(120, 90), scale=1.0, angle=30.0):
    """Return a frame as VTK's own camera makes it."""
    camera = _vtk.vtkCamera()
    camera.SetPosition(*eye)
    camera.SetFocalPoint(*focus)
    camera.SetViewUp(0.1, 0.2, 1)
    camera.SetViewAngle(angle)
    camera.SetParallelProjection(parallel)
    camera.SetParallelScale(scale)
    away = float(np.linalg.norm(np.subtract(eye, focus)))
    camera.SetClippingRange(0.01 * away, 100 * away)

    def rows(m):
        return np.array([[m.GetElement(i, j) for j in range(4)] for i in range(4)])

    return Frame(
        None,
        None,
        size,
        (0, 0),
        View(
            rows(camera.GetModelViewTransformMatrix()),
            rows(camera.GetProjectionTransformMatrix(size[0] / size[1], -1, 1)),
            parallel=parallel,
            near=0.01 * away,
            far=100 * away,
            position=np.array(eye, float),
        ),
    )


def cloud(seed, n, extent=10.0):
    rng = np.random.default_rng(seed)
    return rng.uniform(-extent, extent, (n, 3)), rng.uniform(0.1, 0.8, n)


@FEW
@given(st.integers(0, 999), st.integers(0, 300))
def test_order_is_a_permutation(seed, n):
    points, _ = cloud(seed, n)
    assert sorted(morton_order(points).tolist()) == list(range(n))


def test_order_is_that_of_interleaved_bits():
    side = np.indices((8, 8, 8)).reshape(3, -1).T
    code = sum(((side[:, a] >> b) & 1) << (3 * b + a) for a in range(3) for b in range(3))
    scaled = side * (2**18)  # whole cells of the 21 bits, the last cell at the end
    scaled = np.concatenate([scaled, [[2**21 - 1] * 3]])
    order = morton_order(scaled.astype(float))
    assert order[:-1].tolist() == np.argsort(code, kind='stable').tolist()


@pytest.mark.parametrize('move', [0.0, 1e6, 1e9])
@pytest.mark.parametrize('scale', [1e-9, 1.0, 1e9])
def test_order_does_not_depend_on_scale(move, scale):
    side = np.indices((4, 4, 4)).reshape(3, -1).T.astype(float)
    points = (side + move) * scale
    np.testing.assert_array_equal(morton_order(points), morton_order(side))


def test_neighbours_stay_together():
    points, _ = cloud(0, 4096)
    order = morton_order(points)
    spread = np.linalg.norm(np.diff(points[order], axis=0), axis=1).mean()
    assert spread < 0.25 * np.linalg.norm(np.diff(points, axis=0), axis=1).mean()


@pytest.mark.parametrize('points', [np.zeros((0, 3)), np.ones((1, 3)), np.ones((70, 3))])
def test_order_of_nothing_and_of_the_same(points):
    assert sorted(morton_order(points).tolist()) == list(range(len(points)))


@pytest.mark.parametrize('parallel', [False, True])
def test_planes_are_those_of_clip_space(parallel):
    frame = frame_of((3, -5, 2), (0, 0, 0), parallel=parallel, scale=4)
    points = np.random.default_rng(2).uniform(-12, 12, (4000, 3))
    view = points @ frame.view_from_world[:3, :3].T + frame.view_from_world[:3, 3]
    clip = np.column_stack([view, np.ones(len(view))]) @ frame.clip_from_view.T
    inside = (np.abs(clip[:, :3]) <= clip[:, 3:]).all(1)
    planes = frustum_planes(frame.clip_from_view)
    np.testing.assert_allclose(np.linalg.norm(planes[:, :3], axis=1), 1)
    found = (view @ planes[:, :3].T + planes[:, 3] >= 0).all(1)
    assert 100 < inside.sum() < 3900
    np.testing.assert_array_equal(found, inside)


def truth(points, radii, frame):
    """Return which spheres cover a pixel, by many points on each, and their diameters."""
    view = points @ frame.view_from_world[:3, :3].T + frame.view_from_world[:3, 3]
    rng = np.random.default_rng(0)
    shell = rng.normal(size=(200, 3))
    shell = np.concatenate(
        [shell / np.linalg.norm(shell, axis=1, keepdims=True), np.zeros((1, 3))]
    )
    clip = (view[:, None] + radii[:, None, None] * shell) @ frame.clip_from_view[:, :3].T
    clip += frame.clip_from_view[:, 3]
    w = clip[..., 3]
    inside = (w > 0) & (np.abs(clip[..., 0]) <= w) & (np.abs(clip[..., 1]) <= w)
    away = 1.0 if frame.parallel else np.linalg.norm(view, axis=1)
    return inside.any(1), 2 * radii * frame.pixel_scale / away


@FEW
@given(
    seed=st.integers(0, 999),
    parallel=st.booleans(),
    inside=st.booleans(),
    unit=st.sampled_from([1, 16, 64]),
    n=st.integers(1, 400),
)
def test_nothing_seen_is_left_out(seed, parallel, inside, unit, n):
    points, radii = cloud(seed, n)
    order = morton_order(points)
    points, radii = points[order], radii[order]
    eye = np.random.default_rng(seed + 1).uniform(-1, 1, 3) * (5 if inside else 40)
    frame = frame_of(eye, (0, 0, 0), parallel=parallel, scale=6, size=(160, 60))
    blocks = Blocks.of(points, radii, unit)
    index, origins, small, large, depths = blocks.seen(frame)
    seen, sizes = truth(points, radii, frame)
    assert set(np.flatnonzero(seen) // unit) <= set(index.tolist())
    low = dict(zip(index.tolist(), np.broadcast_to(small, len(index)), strict=True))
    high = dict(zip(index.tolist(), np.broadcast_to(large, len(index)), strict=True))
    for i in np.flatnonzero(seen):
        assert low[i // unit] <= sizes[i] * (1 + 1e-9)
        assert high[i // unit] >= sizes[i] * (1 - 1e-9)
    # The farthest first, and where they are said to be.
    distances = -origins[:, 2] if parallel else np.linalg.norm(origins, axis=1)
    assert (np.diff(distances) <= 1e-9).all()
    np.testing.assert_allclose(depths, -distances, atol=1e-9)
    view = blocks.centers[index] @ frame.view_from_world[:3, :3].T + frame.view_from_world[:3, 3]
    np.testing.assert_allclose(origins, view, atol=1e-9)


def test_much_is_left_out():
    """What is behind the camera or beside it costs nothing."""
    points, radii = cloud(3, 4096)
    order = morton_order(points)
    frame = frame_of((0, 0, 0), (1, 0, 0))
    for unit, share in ((1, 0.1), (64, 0.7)):
        blocks = Blocks.of(points[order], radii[order], unit)
        assert len(blocks.seen(frame)[0]) < share * len(blocks.centers)


def test_of_one_block_with_fewer():
    points, radii = cloud(4, 70)
    blocks = Blocks.of(points, radii, 64)
    assert len(blocks.centers) == 2
    for k, part in enumerate((slice(0, 64), slice(64, 70))):
        away = np.linalg.norm(points[part] - blocks.centers[k], axis=1)
        assert away.max() == pytest.approx(blocks.reach[k])
        assert radii[part].max() == pytest.approx(blocks.largest[k])
        assert radii[part].min() == pytest.approx(blocks.smallest[k])
