"""What is said to be hidden is, and rectangles hold what they should."""

from __future__ import annotations

import numpy as np
import pytest

from pvibr.maths.views import View
from pvibr.things.frame import Frame
from pvibr.things.occlusion_culling import behind, likely_seen, on_screen

SIZE = 96, 64


def frame(parallel):
    """Return a frame of a camera at the origin."""
    near, far = 0.5, 20.0
    clip = np.zeros((4, 4))
    clip[0, 0], clip[1, 1] = 2.0 * SIZE[1] / SIZE[0], 2.0
    if parallel:
        clip[:2] /= 10
        clip[2, 2], clip[2, 3], clip[3, 3] = -2 / (far - near), -(far + near) / (far - near), 1
    else:
        clip[2, 2], clip[2, 3] = -(far + near) / (far - near), -2 * far * near / (far - near)
        clip[3, 2] = -1
    return Frame(
        None, None, SIZE, (0, 0), View(np.eye(4), clip, parallel=parallel, near=near, far=far)
    )


def project(seen, points):
    """Return pixels and depths of points in eye space."""
    clip = np.c_[points, np.ones(len(points))] @ seen.clip_from_view.T
    ndc = clip[:, :3] / clip[:, 3:]
    return (ndc[:, :2] / 2 + 0.5) * SIZE, ndc[:, 2] / 2 + 0.5


def balls(count=400):
    rng = np.random.default_rng(0)
    centers = np.c_[rng.uniform(-6, 6, (count, 2)), rng.uniform(-18, -1.5, count)]
    return centers, rng.uniform(0.05, 0.9, count)


@pytest.mark.parametrize('parallel', [False, True])
def test_rectangles_hold_pictures_and_are_tight(parallel):
    centers, radii = balls()
    ways = np.random.default_rng(1).normal(size=(2000, 3))
    ways /= np.linalg.norm(ways, axis=1, keepdims=True)
    seen = frame(parallel)
    low, high = on_screen(seen, centers, radii)
    for c, r, a, b in zip(centers, radii, low, high, strict=True):
        pixels, _ = project(seen, c + r * ways)
        assert (pixels >= a - 1e-9).all()
        assert (pixels <= b + 1e-9).all()
        if r < 0.2 * -c[2]:
            assert (np.ptp(pixels, axis=0) > 0.6 * (b - a)).all()


@pytest.mark.parametrize('tile', [4, 8])
@pytest.mark.parametrize('parallel', [False, True])
def test_what_is_behind_is_behind_everywhere(parallel, tile):
    rng = np.random.default_rng(2)
    shape = -(-SIZE[1] // tile), -(-SIZE[0] // tile)
    farthest = rng.uniform(0.0, 0.6, shape) if parallel else rng.uniform(0.6, 0.95, shape)
    farthest[rng.uniform(size=shape) < 0.02] = 1.0
    centers, radii = balls()
    seen = frame(parallel)
    hidden = behind(seen, farthest, tile, centers, radii, margin=1.0)
    assert 0.02 < hidden.mean() < 0.9
    low, high = on_screen(seen, centers, radii)
    _, depth = project(seen, centers + radii[:, None] * [0, 0, 1])
    low, high = ((x + d) // tile for x, d in ((low, -1), (high, 1)))
    on = ((high >= 0) & (low < shape[::-1])).all(1)
    low, high = (np.clip(x, 0, np.array(shape[::-1]) - 1).astype(int) for x in (low, high))
    truth = [
        d > farthest[a[1] : b[1] + 1, a[0] : b[0] + 1].max()
        for a, b, d in zip(low, high, depth, strict=True)
    ]
    assert not (hidden & ~np.array(truth) & on).any()
    assert (hidden[on] == np.array(truth)[on]).mean() > 0.95


def test_what_reaches_the_near_plane_is_never_hidden():
    seen = frame(parallel=False)
    hidden = behind(seen, np.zeros((8, 12)), 8, np.array([[0, 0, -1.0], [0, 0, 0.3]]), np.ones(2))
    assert not hidden.any()


def test_the_nearest_are_likely_seen():
    pixels = np.array([[10.0, 10], [200, 10], [12, 12], [14, 9], [210, 12]])
    areas = np.array([900.0, 100, 900, 100, 100])
    found = likely_seen(pixels, areas, layers=1.5)
    assert found.tolist() == [True, True, True, False, True]
    assert likely_seen(pixels[:0], areas[:0], 1.0).shape == (0,)
