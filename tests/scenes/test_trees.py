"""Trees: heavy enough, the same for the same seed, well formed."""

import time

import numpy as np
import pytest
import pyvista as pv

from pvibr.scenes.trees import KINDS, leaf_texture, tree, tree_parts
from tests.refusals import refused

kinds = pytest.mark.parametrize('kind', KINDS)


@kinds
@pytest.mark.parametrize('triangles', [50_000, 50_001, 120_000])
def test_as_many_triangles_as_asked(kind, triangles):
    blocks = tree(kind, triangles=triangles)
    assert blocks.keys() == ['bark', 'leaves']
    assert sum(block.n_cells for block in blocks) in (triangles, triangles + 1)
    assert all(block.is_all_triangles for block in blocks)


@kinds
def test_a_tree_stands_on_the_origin(kind):
    blocks = tree(kind, seed=4, height=10)
    low, high = blocks.bounds[4:]
    assert -0.5 < low < 0.1
    assert 8 < high < 12
    assert np.abs(blocks.bounds[:4]).max() < 8


@kinds
def test_seeds_decide(kind):
    first, again, other = tree(kind, 7), tree(kind, 7), tree(kind, 8)
    assert first['bark'] == again['bark']
    assert first['leaves'] == again['leaves']
    assert first['leaves'] != other['leaves']


@kinds
def test_arrays_are_sound(kind):
    for block in tree(kind):
        assert block.points.dtype == np.float32
        assert np.isfinite(block.points).all()
        normals = block.point_data.active_normals
        np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1, atol=1e-5)
        assert block['color_rgb'].dtype == np.uint8
        assert block['color_rgb'].std(axis=0).min() > 3
        sizes = block.compute_cell_sizes(length=False, volume=False)['Area']
        assert sizes.min() > 0


@kinds
def test_leaves_have_their_fronts_to_the_light(kind):
    leaves = tree(kind)['leaves']
    corners = leaves.points[leaves.regular_faces]
    front = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    bent = leaves.point_data.active_normals[leaves.regular_faces[:, 0]]
    assert ((front * bent).sum(axis=1) >= -1e-6).all()
    texture = leaves.active_texture_coordinates
    assert (texture.min(), texture.max()) == (0, 1)


@kinds
def test_bark_is_closed_around_each_branch(kind):
    bark = tree(kind)['bark']
    outward = bark.compute_normals(
        cell_normals=False, consistent_normals=False, split_vertices=False
    )['Normals']
    assert ((outward * tree(kind)['bark']['Normals']).sum(axis=1) > 0).mean() > 0.99


@kinds
def test_growing_takes_less_than_a_second(kind):
    start = time.process_time()
    tree(kind)
    assert time.process_time() - start < 1


@kinds
def test_leaves_are_cut_out(kind):
    image = leaf_texture(kind).to_array()
    solid = image[..., 3] > 127
    assert image.shape == (64, 64, 4)
    assert 0.25 < solid.mean() < 0.75
    assert not image[[0, 0, -1], [0, -1, 0], 3].any()
    assert image[..., :3].min() > 100


@kinds
def test_a_tree_is_drawn_opaque_with_gaps(kind):
    plotter = pv.Plotter(off_screen=True, window_size=(120, 160))
    parts = tree_parts(kind)
    for part in parts:
        assert not part.actor.HasTranslucentPolygonalGeometry()
        plotter.add_actor(part.actor)
    plotter.view_xz()
    picture = plotter.screenshot(return_img=True)
    painted = (picture != 255).any(axis=2)
    assert 0.05 < painted.mean() < 0.6
    assert (picture[:5] == 255).all()


@pytest.mark.parametrize(
    ('kwargs', 'match'),
    [
        ({'kind': 'palm'}, 'broadleaf.*palm'),
        ({'height': 0}, 'height'),
        ({'height': np.nan}, 'height'),
        ({'triangles': 100}, 'triangles must be .*got 100'),
    ],
)
def test_bad_wishes_are_named(kwargs, match):
    refused(match, lambda: tree(**kwargs))
