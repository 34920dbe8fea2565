"""Normals of flat-shaded surfaces: means of facets that bend, but not at creases."""

from __future__ import annotations

import numpy as np
import pytest
import pyvista as pv

from pvibr.instances.levels import make_model
from pvibr.meshes.parts import as_parts
from pvibr.meshes.smoothed import smoothed


def soup(mesh):
    """Return triangles that share no points."""
    return pv.PolyData.from_regular_faces(
        mesh.points[mesh.regular_faces].reshape(-1, 3), np.arange(3 * mesh.n_cells).reshape(-1, 3)
    )


def ball(sides):
    return pv.Sphere(theta_resolution=2 * sides, phi_resolution=sides)


def prism(sides=6):
    return pv.Cylinder(resolution=sides, capping=True).triangulate().subdivide(3, 'linear')


def smooth(mesh, **looks):
    (part,) = as_parts(mesh, **looks)
    return smoothed(part)


def test_normals_are_those_of_the_surface():
    part = smooth(soup(ball(30)), color='tan')
    normals = part.mesh.point_data.active_normals
    out = part.mesh.points / np.linalg.norm(part.mesh.points, axis=1, keepdims=True)
    assert (normals * out).sum(1).min() > 0.995
    assert part.actor.prop.interpolation.name == 'GOURAUD'
    assert part.mesh.active_scalars_name is None


def test_creases_stay():
    """A can of many sides: its rim is a crease, its side is round."""
    part = smooth(prism(40))
    places = np.asarray(part.mesh.points, float)[part.mesh.regular_faces]
    normals = part.mesh.point_data.active_normals[part.mesh.regular_faces]
    cap = np.ptp(places[..., 0], axis=1) < 1e-6
    np.testing.assert_allclose(np.abs(normals[cap][..., 0]), 1, atol=1e-5)
    round_ = places[~cap] * [0, 1, 1]
    round_ /= np.linalg.norm(round_, axis=2, keepdims=True)
    assert (normals[~cap] * round_).sum(2).min() > 0.99


@pytest.mark.parametrize(
    ('mesh', 'looks'),
    [
        (prism(), {}),
        (pv.Plane().triangulate(), {}),
        (ball(12), {'smooth_shading': True}),
        (ball(12), {'alpha_cutoff': 0.5}),
    ],
    ids=['prism', 'plane', 'smooth', 'cut out'],
)
def test_what_is_flat_or_smooth_stays_so(mesh, looks):
    assert smooth(mesh, **looks) is None


def test_arrays_are_kept():
    mesh = ball(20)
    mesh['height'] = mesh.points[:, 2].copy()
    mesh.cell_data['side'] = np.arange(mesh.n_cells)
    part = smooth(mesh, scalars='height')
    np.testing.assert_allclose(part.mesh['height'], part.mesh.points[:, 2], atol=1e-6)
    assert part.mesh.active_scalars_name == 'height'
    part = smooth(mesh, scalars='side')
    np.testing.assert_array_equal(part.mesh.cell_data['side'], np.arange(mesh.n_cells))


def shading(model):
    """Return how each level interpolates light."""
    return [level.parts[0].actor.prop.interpolation.name for level in model.levels]


@pytest.mark.parametrize('seed', [3, 8])
def test_levels_have_the_shading_with_the_least_error(tmp_path, monkeypatch, seed):
    """Facets too small to see become smooth; those that are seen do not."""
    monkeypatch.setattr('pvibr.instances.measure.SIZES', (8, 64))
    kwargs = {'views': 2, 'tile': 16, 'cache': tmp_path}
    rng = np.random.default_rng(seed)
    fine = ball(60)
    fine.points *= 1 + 0.1 * np.sin(fine.points @ rng.normal(size=(3, 1)) * 3)
    model = make_model(as_parts(soup(fine)), **kwargs)
    # The first lighter level, of a quarter of the facets, is about as close either way.
    assert shading(model)[0] == 'FLAT'
    assert len(model.levels) > 3
    assert set(shading(model)[2:]) == {'GOURAUD'}
    again = make_model(as_parts(soup(fine)), **kwargs)  # of the cache
    assert shading(again) == shading(model)
    # Cut by planes that meet at less than what counts as a crease.
    cut = ball(40)
    for normal in (
        pv.Icosahedron()
        .subdivide(1)
        .compute_normals(cell_normals=True, point_normals=False, inplace=False)['Normals']
    ):
        over = np.maximum(np.array(cut.points) @ normal - 0.46, 0)
        cut.points = np.array(cut.points) - over[:, None] * normal
    assert set(shading(make_model(as_parts(cut), **kwargs))) == {'FLAT'}
