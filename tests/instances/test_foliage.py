"""Leaves as quads, clusters and turntables: in the right places, with the right looks."""

from __future__ import annotations

import numpy as np
import pytest
import pyvista as pv
from scipy.spatial.transform import Rotation

import pvibr
from pvibr.instances.foliage_quads import (
    Groups,
    TextureLayout,
    clusters,
    components,
    quads,
)
from pvibr.instances.levels import _levels, content_key
from pvibr.maths.filled_texels import dilated
from pvibr.meshes.parts import as_parts
from tests.marks import slow


@pytest.fixture(scope='module')
def leaves():
    """Discs of several colours, each turned its own way, on a ball; the trunk is a cylinder."""
    rng = np.random.default_rng(0)
    disc = pv.Disc(inner=0, outer=0.12, c_res=10).triangulate()
    points = rng.normal(size=(60, 3))
    points *= rng.uniform(0.6, 1, (60, 1)) / np.linalg.norm(points, axis=1, keepdims=True)
    pieces = []
    for point, turn in zip(points, Rotation.random(60, random_state=1), strict=True):
        piece = pv.PolyData(turn.apply(disc.points) + point + [0, 0, 2.0], disc.faces)
        piece['paint'] = np.tile(rng.integers(0, 256, 3, dtype=np.uint8), (piece.n_points, 1))
        pieces.append(piece)
    return pieces


@pytest.fixture(scope='module')
def plant(leaves):
    trunk = pv.Cylinder(center=(0, 0, 1), direction=(0, 0, 1), radius=0.1, height=2).triangulate()
    trunk['paint'] = np.tile(np.array([90, 60, 30], np.uint8), (trunk.n_points, 1))
    return trunk.append_polydata(*leaves)


LOOK = {'scalars': 'paint', 'rgb': True}


def test_bark_is_simplified_before_leaves_are_thinned_out():
    places = pv.PolyData(np.random.default_rng(2).uniform(-1, 1, (80, 3)))
    leaf = pv.Disc(inner=0, outer=0.05, c_res=8).triangulate()
    crown = places.glyph(geom=leaf, scale=False, orient=False)
    trunk = pv.Cylinder(radius=0.1, height=2, resolution=60).triangulate().subdivide(2)
    full, first, second, *_ = _levels(as_parts(trunk) + as_parts(crown))
    assert first.parts[1].mesh is full.parts[1].mesh
    assert first.parts[0].mesh.n_cells < 0.3 * trunk.n_cells
    assert second.parts[1].mesh.n_cells < 0.8 * crown.n_cells
    # What is all leaves, or has hardly any bark, has no such level.
    twig = pv.Cylinder(radius=0.1, resolution=6).triangulate()
    for few in (as_parts(crown), as_parts(twig) + as_parts(crown)):
        assert _levels(few)[1].parts[-1].mesh.n_cells < 0.8 * crown.n_cells


def test_components_are_what_hangs_together(leaves):
    mesh = leaves[0].append_polydata(*leaves[1:])
    found = components(mesh)
    assert (np.diff(found) >= 0).all() or len(set(found.tolist())) == 60
    assert np.unique(found).tolist() == list(range(60))
    per_piece = found.reshape(60, -1)
    assert (per_piece == per_piece[:, :1]).all()


def test_quads_lie_in_the_planes_of_flat_parts(leaves):
    mesh = leaves[0].append_polydata(*leaves[1:])
    (part,) = as_parts(mesh, **LOOK)
    groups = Groups.of(part.mesh, components(part.mesh))
    assert (groups.high - groups.low)[:, 2].max() < 2e-6
    quad = quads(part, [groups], texels=256)
    assert quad.mesh.n_cells == 120
    corners = np.asarray(quad.mesh.points).reshape(60, 4, 3)
    order = [
        int(np.argmin(np.linalg.norm(corners.mean(1) - p.points.mean(0), axis=1))) for p in leaves
    ]
    assert sorted(order) == list(range(60))
    for k, piece in zip(order, leaves, strict=True):
        # All points of the leaf are on its quad, whose sides are little longer than the leaf.
        origin, along, across = corners[k, 0], *(corners[k, [1, 3]] - corners[k, 0])
        normal = np.cross(along, across)
        normal /= np.linalg.norm(normal)
        off = piece.points - origin
        assert np.abs(off @ normal).max() < 1e-5
        for side in (along, across):
            share = off @ side / (side @ side)
            assert share.min() > 0
            assert share.max() < 1
            assert np.linalg.norm(side) < 1.5 * 0.24


def test_quads_show_the_colours_of_their_parts(leaves):
    mesh = leaves[0].append_polydata(*leaves[1:])
    (part,) = as_parts(mesh, **LOOK)
    quad = quads(part, [Groups.of(part.mesh, components(part.mesh))], texels=256)
    image = quad.actor.GetTexture().to_array()
    height, width = image.shape[:2]
    uv = np.asarray(quad.mesh.active_texture_coordinates).reshape(60, 4, 2).mean(1)
    centers = np.asarray(quad.mesh.points).reshape(60, 4, 3).mean(1)
    for center, (u, v) in zip(centers, uv, strict=True):
        piece = min(leaves, key=lambda p: np.linalg.norm(p.points.mean(0) - center))
        texel = image[height - 1 - int(v * height), int(u * width)]
        assert texel[3] == 255
        assert np.abs(texel[:3].astype(int) - piece['paint'][0]).max() <= 2


def test_a_disc_covers_its_share_of_its_quad(leaves):
    (part,) = as_parts(leaves[0], color='red')
    quad = quads(part, [Groups.of(part.mesh, np.zeros(part.mesh.n_cells, int))], texels=128)
    image = quad.actor.GetTexture().to_array()
    texel = np.linalg.norm(np.diff(np.asarray(quad.mesh.points)[:2], axis=0))
    texel /= image.shape[1] - 1
    area = (image[..., 3] / 255).sum() * texel**2
    assert abs(area / part.mesh.area - 1) < 0.02


def test_layouts_fit_and_do_not_overlap():
    extents = np.random.default_rng(2).uniform(0.1, 3, (50, 2))
    layout = TextureLayout.of(extents, 300)
    taken = np.zeros(layout.size[::-1], int)
    for (x, y), (w, h) in zip(layout.corners, layout.sizes, strict=True):
        taken[y : y + h, x : x + w] += 1
    assert taken.max() == 1
    assert max(layout.size) <= 300
    assert (layout.sizes - 2 >= extents * layout.scale - 1e-9).all()
    with pytest.raises(ValueError, match='texels must be larger'):
        TextureLayout.of(extents, 16)


def test_clusters_are_near_things():
    rng = np.random.default_rng(0)
    centers = np.array([[0, 0, 0], [9, 0, 0], [0, 9, 0], [9, 9, 9.0]])
    truth = rng.integers(0, 4, 200)
    found = clusters(centers[truth] + rng.normal(0, 0.3, (200, 3)), 4)
    assert all(len(set(found[truth == k].tolist())) == 1 for k in range(4))
    assert len(set(found.tolist())) == 4
    assert clusters(np.zeros((3, 3)), 5).tolist() == [0, 1, 2]
    assert set(clusters(np.zeros((6, 3)), 2).tolist()) == {0}


def test_dilation_leaves_what_is_covered():
    picture = np.zeros((9, 13, 4))
    picture[2:5, 3:6] = (0.5, 0.25, 0.0, 0.5)
    out = dilated(picture)
    assert (out[..., 3] == np.rint(255 * picture[..., 3])).all()
    assert (np.abs(out[..., :3].astype(int) - [255, 128, 0]) <= 1).all()


def test_levels_of_foliage(plant):
    levels = pvibr.foliage_levels(plant, texels=256, view_size=64, views=8, **LOOK)
    names = [level.name for level in levels.levels]
    assert names == ['mesh', 'parts', 'clusters', 'turntable', 'billboard']
    assert levels.levels[1].quads == 60
    triangles = [level.triangles for level in levels.levels]
    assert triangles == sorted(triangles, reverse=True)
    levels.measure(64, 3)
    flips = [level.error['flip'] for level in levels.levels]
    assert flips[1] < 2.2 * flips[0]
    assert max(flips[:4]) < flips[4]
    assert str(levels).count('\n') == 5


def test_labels_say_what_parts_are(plant):
    labels = np.full(plant.n_cells, -1)
    trunk = components(plant)[0]
    small = components(plant) != trunk
    labels[small] = np.arange(small.sum()) % 3
    levels = pvibr.foliage_levels(plant, labels, texels=128, view_size=16, views=2, **LOOK)
    assert levels.levels[1].quads == 3
    for wrong in (labels[:-1], labels.astype(float)):
        with pytest.raises(ValueError, match='labels'):
            pvibr.foliage_levels(plant, wrong, **LOOK)


def test_what_has_no_small_parts_is_refused():
    with pytest.raises(ValueError, match='must have parts below'):
        pvibr.foliage_levels(pv.Sphere())
    for wrong in ({'largest': 0}, {'crossed': 4}, {'views': 0}):
        with pytest.raises(ValueError, match=next(iter(wrong))):
            pvibr.foliage_levels(pv.Sphere(), **wrong)


def test_a_turntable_shows_the_side_that_the_eye_sees(plant, see):
    levels = pvibr.foliage_levels(plant, texels=128, view_size=96, views=16, **LOOK)
    truth = levels._meshes()[0]
    for azimuth in (0.0, np.pi / 2, 4.3):
        pictures = []
        for way in range(2):
            pl = pv.Plotter(off_screen=True, window_size=(96, 96))
            pl.disable_anti_aliasing()
            pl.set_background('white')
            if way:
                pl.ibr.add_billboards([[0, 0, 0]], **levels.turntable)
            else:
                pl.add_mesh(truth[0].mesh, **LOOK)
            eye = 20 * np.array([np.cos(azimuth), np.sin(azimuth), 0]) + [0, 0, 1.5]
            see.place(pl, eye, (0, 0, 1.5), angle=10)
            pictures.append(see.grab(pl))
            pl.close()
        both = [(p < 0.95).any(2) for p in pictures]
        assert (both[0] & both[1]).sum() / (both[0] | both[1]).sum() > 0.8
        assert np.abs(pictures[0] - pictures[1])[both[0] & both[1]].mean() < 0.12


def test_foliage_joins_the_levels_of_instances(plant, atlases):
    levels = pvibr.foliage_levels(plant, texels=256, view_size=32, views=2, **LOOK)
    meshes = _levels(levels.parts)
    assert [m.triangles for m in meshes] == [level.triangles for level in levels.levels[:3]]
    plain = as_parts(plant, **LOOK)
    assert content_key(levels.parts) != content_key(plain)
    pl = pv.Plotter(off_screen=True, window_size=(160, 100))
    things = pl.ibr.add_instances(levels.parts, [[0, 0, 0], [0, 40, 0]], cache=atlases)
    pl.camera.position, pl.camera.focal_point, pl.camera.up = (0, -8, 2), (0, 0, 1.5), (0, 0, 1)
    pl.show(auto_close=False)
    errors = things.atlases[0].errors
    assert {'mesh1', 'mesh2'} <= set(errors)
    assert f'mesh {plant.n_cells}' in things.report()
    pl.close()


def textured(seed):
    """Return trunk, leaves that wear a part of an image each, and the image."""
    rng = np.random.default_rng(seed)
    image = np.zeros((16, 16, 3), np.uint8)
    image[:8], image[8:, :8], image[8:, 8:] = (200, 40, 30), (240, 200, 20), (40, 160, 40)
    leaf, leaves = pv.Plane(i_resolution=2, j_resolution=2).triangulate(), []
    for turn in Rotation.random(40, random_state=seed):
        one = leaf.copy()
        one.points = 0.3 * turn.apply(one.points) + rng.uniform(-1, 1, 3) + (0, 0, 3)
        one.point_data.active_normals = turn.apply(one.point_data.active_normals)
        leaves.append(one)
    trunk = pv.Cylinder(center=(0, 0, 1), direction=(0, 0, 1), radius=0.1, height=2).triangulate()
    return trunk, leaves[0].append_polydata(*leaves[1:]), pv.Texture(image)


def by_texture(trunk, leaves, image, _folder):
    whole = trunk.append_polydata(leaves)
    coordinates = np.full((whole.n_points, 2), 0.1, np.float32)
    coordinates[trunk.n_points :] = leaves.active_texture_coordinates
    whole.active_texture_coordinates = coordinates
    return whole, {'texture': image}


def by_actors(trunk, leaves, image, _folder):
    pl = pv.Plotter(off_screen=True)
    return [pl.add_mesh(trunk, color='brown'), pl.add_mesh(leaves, texture=image)], {}


def by_parts(trunk, leaves, image, _folder):
    return [*as_parts(trunk, color='brown'), *as_parts(leaves, texture=image)], {}


def by_blocks(trunk, leaves, _image, _folder):
    return pv.MultiBlock([trunk, leaves]), {'color': 'green'}


def by_glb(trunk, leaves, image, folder):
    pl = pv.Plotter(off_screen=True)
    pl.add_mesh(trunk, color='brown')
    pl.add_mesh(leaves, texture=image)
    pl.export_gltf(str(folder / 'tree.gltf'))
    return folder / 'tree.gltf', {}


@pytest.mark.sampled
@pytest.mark.parametrize('seed', [0, slow(7)])
@pytest.mark.parametrize('given', [by_texture, by_actors, by_parts, by_blocks, by_glb])
def test_a_plant_is_given_as_add_mesh_takes_it(given, seed, tmp_path):
    what, looks = given(*textured(seed), tmp_path)
    levels = pvibr.foliage_levels(what, texels=256, view_size=32, views=4, **looks)
    assert levels.levels[1].quads == 40
    levels.measure(64, 2)
    assert levels.levels[1].error['iou'] > 0.7
    assert levels.levels[1].error['flip'] < 0.15
