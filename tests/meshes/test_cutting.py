"""Cut triangles: no gaps (`tests/export` has more), and places found in their pieces."""

import numpy as np
import pytest
import pyvista as pv

from pvibr.meshes.cutting import cut_at


@pytest.mark.parametrize('seed', range(3))
def test_places_are_where_they_were(seed):
    rng = np.random.default_rng(seed)
    mesh = pv.Sphere(theta_resolution=8, phi_resolution=6).clean()
    points, faces, cuts = np.asarray(mesh.points, float), np.array(mesh.regular_faces), []
    face, share = rng.integers(0, len(faces), 500), rng.dirichlet([1, 1, 1], 500)
    before = np.einsum('nk,nkd->nd', share, points[faces[face]])
    for _ in range(3):
        points, cut = cut_at(points, faces, rng.random(faces.shape) < 0.6)
        area = pv.PolyData.from_regular_faces(points, cut.faces).area
        assert np.isclose(area, mesh.area)
        found, share = cut.at(face, share)
        np.testing.assert_array_equal(cut.parent[found], face)
        faces, face = cut.faces, found
        cuts.append(cut)
    assert len(faces) > 5 * mesh.n_cells
    np.testing.assert_allclose(np.einsum('nk,nkd->nd', share, points[faces[face]]), before)
    assert share.min() >= 0
