"""Normals and scalars of lighter meshes: those of the surface that each triangle stands for."""

from __future__ import annotations

import numpy as np
import pytest
import pyvista as pv

from pvibr.instances.levels import make_model
from pvibr.instances.smoothed import interpolated, smoothed
from pvibr.meshes.decimate import lighter
from pvibr.meshes.parts import as_parts
from tests.makers import soup


def ball(sides):
    return pv.Sphere(theta_resolution=2 * sides, phi_resolution=sides)


def cut_ball(height=0.3, sides=60):
    """A ball with a flat top, whose rim is a crease of about 50 degrees."""
    mesh = ball(sides)
    mesh.clear_data()
    points = np.array(mesh.points)
    points[:, 2] = np.minimum(points[:, 2], height)
    mesh.points = points
    return mesh


def levels(mesh, share=0.1, **looks):
    """Return a lighter part, and the same with fitted normals."""
    (part,) = as_parts(mesh, **looks)
    light = lighter(part, share)
    return light, smoothed(part, light)


def corners(part):
    """Return places and normals at the corners of triangles, float64."""
    faces = part.mesh.regular_faces
    normals = np.asarray(part.mesh.point_data.active_normals, float)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    return np.asarray(part.mesh.points, float)[faces], normals[faces]


@pytest.mark.parametrize('looks', [{}, {'smooth_shading': True}], ids=['flat', 'smooth'])
def test_normals_are_those_of_the_surface(looks):
    rng = np.random.default_rng(7)
    radii = rng.uniform(0.6, 1.6, 3)
    mesh = ball(50)
    mesh.clear_data()
    mesh.points *= radii
    mesh = soup(mesh) if not looks else mesh
    light, part = levels(mesh, 0.05, color='tan', **looks)
    assert part.mesh.n_cells == light.mesh.n_cells < 0.06 * mesh.n_cells
    places, normals = corners(part)
    truth = places / radii**2  # the gradient of an ellipsoid
    truth /= np.linalg.norm(truth, axis=2, keepdims=True)
    assert (normals * truth).sum(2).min() > np.cos(np.radians(6))
    assert np.degrees(np.arccos(np.clip((normals * truth).sum(2), -1, 1))).mean() < 1
    assert part.actor.prop.interpolation.name in ('GOURAUD', 'PHONG')
    assert part.mesh.n_points < light.mesh.n_points * 1.5 or not looks


def test_creases_stay():
    """The flat top is flat up to its rim, the round side round."""
    _, part = levels(cut_ball(), color='tan')
    places, normals = corners(part)
    top = (places[..., 2] > 0.3 - 1e-6).all(1)
    assert top.any()
    assert (normals[top] @ (0, 0, 1)).min() > np.cos(np.radians(2))
    side = (places[..., 2] < 0.29).all(1)
    out = places[side] / np.linalg.norm(places[side], axis=2, keepdims=True)
    assert (normals[side] * out).sum(2).min() > np.cos(np.radians(8))


@pytest.mark.parametrize(
    ('mesh', 'looks'),
    [
        (pv.Cube().triangulate().subdivide(4, 'linear'), {}),
        (pv.Plane(i_resolution=20, j_resolution=20).triangulate(), {}),
        (ball(12), {'alpha_cutoff': 0.5}),
    ],
    ids=['cube', 'plane', 'cut out'],
)
def test_what_is_right_stays(mesh, looks):
    light, part = levels(mesh, **looks)
    assert part is light


def test_arrays_are_kept():
    mesh = ball(40)
    mesh['height'] = mesh.points[:, 2].copy()
    mesh.cell_data['side'] = np.sign(mesh.cell_centers().points[:, 0])
    _, part = levels(mesh, scalars='height')
    np.testing.assert_allclose(part.mesh['height'], part.mesh.points[:, 2], atol=0.01)
    assert part.mesh.active_scalars_name == 'height'
    light, part = levels(mesh, scalars='side')
    np.testing.assert_array_equal(part.mesh.cell_data['side'], light.mesh.cell_data['side'])


def wave(points):
    return np.sin(3 * points[..., 0]) + points[..., 2]


@pytest.mark.parametrize('smooth', [False, True], ids=['flat', 'smooth'])
def test_fields_on_cells_are_interpolated(smooth):
    """By the same table, and nearer to the field than a value for each cell."""
    mesh = ball(60)
    mesh.cell_data['wave'] = wave(mesh.cell_centers().points)
    (full,) = as_parts(mesh, scalars='wave', clim=(-1, 1), smooth_shading=smooth)
    light = smoothed(full, lighter(full, 0.05))
    part = interpolated(full, light)
    assert 'wave' not in part.mesh.cell_data
    drawn = np.asarray(part.mesh['wave'])[part.mesh.regular_faces].mean(1)
    truth = wave(part.mesh.cell_centers().points)
    off = [np.abs(v - truth).mean() for v in (drawn, light.mesh.cell_data['wave'])]
    assert off[0] < min(0.02, 0.7 * off[1])
    mapper = part.actor.mapper
    assert (mapper.GetScalarModeAsString(), mapper.GetArrayName()) == ('UsePointFieldData', 'wave')
    assert mapper.GetLookupTable() is full.actor.mapper.GetLookupTable()


@pytest.mark.parametrize(
    'values',
    [
        lambda c: (c[:, 2] > 0.1) + 3.0 * (c[:, 0] > 0),
        lambda c: np.where(c[:, 0] > 0, np.nan, c[:, 2]),
        lambda c: np.rint(255 * np.abs(c) / np.abs(c).max()).astype(np.uint8),
    ],
    ids=['regions', 'nan', 'rgb'],
)
def test_what_is_of_a_cell_stays(values):
    mesh = ball(60)
    mesh.cell_data['value'] = found = values(mesh.cell_centers().points)
    (full,) = as_parts(mesh, scalars='value', rgb=found.dtype == np.uint8)
    light = lighter(full, 0.05)
    assert interpolated(full, light) is light


def test_levels_of_the_cache_are_drawn_by_points_as_well(tmp_path):
    mesh = ball(60)
    mesh.cell_data['wave'] = wave(mesh.cell_centers().points)

    def modes():
        parts = as_parts(mesh, scalars='wave')
        model = make_model(parts, views=2, tile=16, cache=tmp_path)
        return [level.parts[0].actor.mapper.GetScalarModeAsString() for level in model.levels]

    made = modes()
    assert made[0] == 'UseCellData'
    # One half as fine may be as near with its own cells.
    assert set(made[2:]) == {'UsePointFieldData'}
    assert modes() == made


def test_levels_of_facets_too_small_to_see_are_smooth(tmp_path):
    kwargs = {'views': 2, 'tile': 16, 'cache': tmp_path}
    fine = ball(60)
    fine.points *= 1 + 0.1 * np.sin(fine.points @ np.random.default_rng(3).normal(size=(3, 1)) * 3)

    def shading():
        model = make_model(as_parts(soup(fine)), **kwargs)
        return [level.parts[0].actor.prop.interpolation.name for level in model.levels]

    made = shading()
    assert len(made) > 3
    assert made == ['FLAT', *['GOURAUD'] * (len(made) - 1)]
    assert shading() == made  # of the cache
