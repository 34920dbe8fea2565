"""Arrays that are carried from cut to cut are those of the patches, however they came there."""

from dataclasses import replace

import numpy as np
import pytest

from pvibr.large.cut_mesh import CutLook, CutMesh
from pvibr.large.hierarchy import NO_CELL
from pvibr.large.patch_arrays import PatchArrays
from pvibr.large.vertex_values import Values
from tests.large.surfaces import hierarchy_of, terrain

LOOKS = 'plain', 'normals', 'values', 'values of cells', 'edges'


def look_of(kind, hierarchy):
    rng = np.random.default_rng(1)
    by_vertex = rng.random(len(hierarchy.points), np.float32)
    by_triangle = rng.random(hierarchy.n_triangles, np.float32)
    return {
        'plain': CutLook(),
        'normals': CutLook(has_normals=True),
        'values': CutLook(Values('a', by_vertex), has_normals=True),
        'values of cells': CutLook(Values('a', by_vertex, by_triangle)),
        'edges': CutLook(edges=hierarchy.full_patches[::2]),
    }[kind]


@pytest.mark.parametrize('kind', LOOKS)
def test_what_was_carried_over_is_as_looked_up(kind):
    hierarchy = hierarchy_of(terrain)
    look, rng = look_of(kind, hierarchy), np.random.default_rng(2)
    arrays = PatchArrays.looked_up(hierarchy, look)
    for share in (0.3, 0.5, 0.5, 0.0, 1.0, 0.2):
        numbers = rng.permutation(len(hierarchy.patch_cells))
        patches = numbers[: round(share * len(numbers))].tolist()
        arrays = arrays.moved_to(hierarchy, look, patches)
        fresh = PatchArrays.looked_up(hierarchy, look, patches)
        assert arrays.columns.keys() == fresh.columns.keys()
        for name, column in fresh.columns.items():
            assert arrays.columns[name].dtype == column.dtype
            np.testing.assert_array_equal(arrays.columns[name], column)
        np.testing.assert_array_equal(arrays.triangles, fresh.triangles)
        assert arrays.vertex_starts == fresh.vertex_starts
        assert arrays.triangle_starts == fresh.triangle_starts


@pytest.mark.parametrize('kind', LOOKS)
def test_triangles_are_those_of_the_hierarchy(kind):
    """By places and values, patch by patch, as the hierarchy has them."""
    hierarchy = hierarchy_of(terrain)
    look = look_of(kind, hierarchy)
    patches = np.random.default_rng(3).permutation(len(hierarchy.patch_cells))[:20]
    arrays = PatchArrays.looked_up(hierarchy, look, patches.tolist())
    for place, patch in enumerate(patches.tolist()):
        own = arrays.triangles[slice(*arrays.triangle_starts[place : place + 2])]
        rows = slice(*hierarchy.triangle_starts[patch : patch + 2])
        vertices = hierarchy.vertices[hierarchy.vertex_starts[patch] + hierarchy.triangles[rows]]
        expected = hierarchy.points[vertices] + hierarchy.origin
        np.testing.assert_allclose(arrays.columns['points'][own], expected, atol=1e-7)
        if look.has_normals:
            np.testing.assert_array_equal(
                arrays.columns['normals'][own], hierarchy.normals[vertices]
            )
        if look.values is None:
            continue
        values = look.values.by_vertex[vertices]
        if look.has_corners and hierarchy.patch_cells[patch, 0] == NO_CELL:
            values = np.repeat(look.values.by_triangle[rows, None], 3, axis=1)
        np.testing.assert_array_equal(arrays.columns['scalars'][own], values)


@pytest.mark.parametrize(('shift', 'kind'), [(0.0, np.float32), (5e6, np.float64)])
def test_positions_are_as_precise_as_their_place_needs(shift, kind):
    hierarchy = hierarchy_of(terrain)
    hierarchy = replace(hierarchy, origin=hierarchy.origin + shift)
    cut = CutMesh()
    cut.show(hierarchy, hierarchy.full_patches, CutLook())
    points = np.asarray(cut.data.GetPoints().GetData())
    assert points.dtype == kind
    low, high = np.reshape(cut.data.GetBounds(), (3, 2)).T
    np.testing.assert_allclose([low, high], hierarchy.bounds, rtol=1e-7)
