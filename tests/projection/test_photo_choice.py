"""Weights of photographs: how far from borders, and where they jump."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra

from pvibr.projection.photo_choice import Surface, Visibility, choose
from pvibr.projection.photo_sources import load_small, sources_of
from tests.projection.test_photo_mesh import ground, photographs


@pytest.mark.parametrize('scale', [1e-9, 1.0, 1e9])
def test_distances_are_those_along_edges(scale):
    mesh, rng = ground(8), np.random.default_rng(8)
    surface = Surface(mesh.points * scale, mesh.regular_faces)
    those = rng.random(mesh.n_points) < 0.02
    reach = scale * rng.uniform(0.3, 0.5, mesh.n_points)
    across = surface.points[surface.edges[:, 0]] - surface.points[surface.edges[:, 1]]
    graph = csr_array((np.linalg.norm(across, axis=1), tuple(surface.edges.T)))
    true = dijkstra(graph, indices=np.flatnonzero(those), min_only=True)
    found = surface.distances(those, np.full(mesh.n_points, scale))
    np.testing.assert_allclose(found, np.minimum(true, scale), rtol=1e-5)
    short = surface.distances(those, reach)
    assert (short <= reach * (1 + 1e-6)).all()
    assert not those.all()
    assert (short[those] == 0).all()
    assert surface.distances(np.zeros(mesh.n_points, bool), reach) == pytest.approx(reach)


@pytest.mark.parametrize('seed', [11, 14])
def test_weights_seldom_jump_between_triangles(seed, tmp_path):
    """Triangles that share a corner give a photograph the same weight there."""
    mesh = ground(seed)
    sources = load_small(sources_of(photographs(mesh, tmp_path, 10, seed)))
    with Visibility([mesh]) as visibility:
        choice = choose(Surface(mesh.points, mesh.regular_faces), sources, visibility)
    whole = (np.bincount(choice.origin)[choice.origin] == 1) & (choice.photos[:, 0] >= 0)
    photos, weights = choice.photos[whole], choice.weights[whole]
    shown = np.zeros((len(photos), 3, len(sources)))
    row, place = np.nonzero(photos >= 0)
    shown[row, :, photos[row, place]] = weights[row, :, place]
    corners, shown = choice.faces[whole].ravel(), shown.reshape(-1, len(sources))
    most, least = np.zeros((2, mesh.n_points, len(sources)))
    least += 1
    np.maximum.at(most, corners, shown)
    np.minimum.at(least, corners, shown)
    jumps = (most - least)[np.unique(corners)].max(1)
    assert len(jumps) > 2000
    assert (jumps > 0.3).mean() < 0.0125
