"""Weights of photographs: how far from borders, and where they jump."""

import numpy as np
import pytest
import pyvista as pv
from PIL import Image
from scipy.ndimage import gaussian_filter
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra

import pvibr
from pvibr.photos.photo_choice import Surface, Visibility, choose
from pvibr.photos.photo_sources import load_small, sources_of
from tests.photos.test_photo_mesh import ground, photographs


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


@pytest.mark.parametrize(
    ('shrunk', 'least'), [(1.0, 60.0), (10 / 9, 40.0), (1.25, 39.0), (2.0, 50.0)]
)
def test_a_photograph_seen_from_its_camera_is_the_photograph(shrunk, least, tmp_path):
    """Of any size, it is the mean of what a pixel covers: neither blurred nor ragged."""
    rng, size = np.random.default_rng(9), (160, 120)
    noise = gaussian_filter(rng.normal(0, 45, (size[1], size[0], 3)), (0.7, 0.7, 0))
    picture = np.clip(128 + 2.4 * noise, 0, 255).astype(np.uint8)
    Image.fromarray(picture).save(tmp_path / 'a.png')
    K = [[140.0, 0, 79.5], [0, 140.0, 59.5], [0, 0, 1]]
    camera = pvibr.Pinhole(K, np.diag([1.0, -1, -1]), [0, 0, 3.0], size)
    photo = pvibr.Photo('a.png', camera, tmp_path / 'a.png')
    width, height = (round(side / shrunk) for side in size)
    pl = pv.Plotter(off_screen=True, window_size=(width, height), lighting='none')
    pl.ibr.add_photos(pv.Plane(i_size=9, j_size=9), [photo])
    pl.camera = photo.to_pyvista()
    pl.show(auto_close=False)
    shown = pl.screenshot(return_img=True).astype(float)
    fine = Image.fromarray(picture).resize((16 * width, 16 * height), Image.Resampling.NEAREST)
    true = np.asarray(fine, float).reshape(height, 16, width, 16, 3).mean((1, 3))
    error = (shown - true)[4:-4, 4:-4]
    assert 10 * np.log10(255**2 / max((error**2).mean(), 1e-9)) > least
