"""The walker: closed limbs, and clips that go round."""

import numpy as np
import pytest

from pvibr.instances.enclosing_surfaces import winding
from pvibr.scenes.walker import walker
from tests.refusals import refused


@pytest.mark.parametrize('triangles', [300, 5000])
def test_is_about_as_heavy_as_asked(triangles):
    mesh = walker(triangles).meshes[0].mesh
    assert 0.6 * triangles < mesh.n_cells <= 1.1 * triangles
    assert winding(mesh.points, mesh.regular_faces) == 1


def test_stands_on_the_ground():
    low, high = np.reshape(walker(500).mesh().bounds, (3, 2)).T
    assert abs(low[2]) < 0.05
    assert 1.7 < high[2] < 1.9


@pytest.mark.parametrize('clip', ['Walk', 'Wave'])
def test_clips_go_round(clip):
    figure = walker(500)
    found = figure.clip(clip)
    first, last = (figure.mesh(t, clip, loop=False).points for t in (0.0, found.duration))
    assert np.allclose(first, last, atol=1e-6)
    moved = figure.mesh(0.2 * found.duration, clip).points
    assert np.linalg.norm(moved - first, axis=1).max() > 0.1


def test_too_few_triangles():
    refused('300 or more', walker, 100)
