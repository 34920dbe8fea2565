"""The atlas: what its pictures show, files, keys, limits, stand-ins."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
import pyvista as pv

from pvibr import Atlas, PvibrWarning
from pvibr.core.errors import ShaderError
from pvibr.instances import levels
from pvibr.instances.atlas import MARGIN
from pvibr.instances.bake import bake_parts, fill_depth
from pvibr.instances.cache import AtlasCache
from pvibr.instances.levels import atlas_key, bake, content_key, make_model
from pvibr.instances.limits import limits_of
from pvibr.instances.measure import measure
from pvibr.meshes.decimate import lighter
from pvibr.meshes.parts import as_parts

pytestmark = pytest.mark.sampled


def tiles(picture, atlas):
    """Return the tiles of a picture, shape (views, views, tile, tile, 4), 0 to 1."""
    n, t = atlas.views, atlas.tile
    return picture.reshape(n, t, n, t, 4).swapaxes(1, 2) / 255.0


@pytest.fixture(scope='module')
def ball():
    sphere = pv.Sphere(radius=2.0, center=(5, 0, 0), theta_resolution=48, phi_resolution=48)
    return bake_parts(as_parts(sphere, color='red', smooth_shading=True), views=4, tile=32)


def test_a_ball_is_a_disk_from_everywhere(ball):
    np.testing.assert_allclose(ball.center, [5, 0, 0], atol=1e-2)
    geometry, albedo = tiles(ball.geometry, ball), tiles(ball.albedo, ball)
    area = geometry[..., 1].mean((2, 3)) * (2 * MARGIN) ** 2
    np.testing.assert_allclose(area, np.pi, rtol=0.02)
    covered = geometry[..., 1] > 0.99
    np.testing.assert_allclose(albedo[covered][:, :3], [[1, 0, 0]] * covered.sum(), atol=0.01)
    depth = (geometry[..., 15:17, 15:17, 0] * 2 - 1) * MARGIN
    np.testing.assert_allclose(depth, 1, atol=0.03)


def test_normals_are_those_of_the_object(ball):
    middle = (slice(None), slice(None), 16, 16)
    geometry, albedo = tiles(ball.geometry, ball)[middle], tiles(ball.albedo, ball)[middle]
    normals = np.concatenate([geometry[..., 2:], albedo[..., 3:]], -1) * 2 - 1
    np.testing.assert_allclose(normals, ball.directions(), atol=0.08)


@pytest.mark.parametrize('closed', [True, False])
def test_backs_that_nobody_sees_are_not_drawn(closed, monkeypatch):
    mesh = pv.ParametricTorus(u_res=60, v_res=40)
    mesh = mesh if closed else mesh.clip('z')
    parts = as_parts(mesh, smooth_shading=True)
    drawn = bake_parts(parts, views=3, tile=32)
    monkeypatch.setattr('pvibr.instances.bake.winding', lambda *_: 0)
    both = bake_parts(parts, views=3, tile=32)
    # Along outlines a sample may meet front and back at once.
    differs = (drawn.albedo != both.albedo).any(-1) | (drawn.geometry != both.geometry).any(-1)
    assert differs.mean() < (2e-3 if closed else 1e-12)
    assert np.abs(drawn.geometry[..., 1].astype(int) - both.geometry[..., 1]).mean() < 1e-2


def test_depth_is_filled_within_each_tile():
    geometry = np.zeros((8, 8, 4), np.uint8)
    geometry[1, 1, :2] = 200, 255
    fill_depth(geometry, 4)
    assert (geometry[:4, :4, 0] == 200).all()
    assert (geometry[4:, 4:, 0] == 128).all()


def test_files_come_back_and_bad_ones_are_named(ball, tmp_path):
    path = tmp_path / 'ball.npz'
    ball.errors = {'sizes': np.array([8.0])}
    ball.save(path)
    again = Atlas.load(path)
    np.testing.assert_array_equal(again.geometry, ball.geometry)
    np.testing.assert_array_equal(again.box, ball.box)
    assert again.errors['sizes'].tolist() == [8.0]
    assert [p.name for p in tmp_path.iterdir()] == ['ball.npz']
    path.write_bytes(path.read_bytes()[:1000])
    with pytest.raises(ValueError, match=r'ball\.npz: not an atlas'):
        Atlas.load(path)
    np.savez(path, grid=np.array([2, 4, 0]))
    with pytest.raises(ValueError, match='not an atlas'):
        Atlas.load(path)


def test_contact_sheet(ball, tmp_path):
    sheet = ball.contact_sheet(tmp_path / 'sheet.png')
    assert sheet.shape == (2 * 128, 128, 3)
    assert (tmp_path / 'sheet.png').stat().st_size > 1000


@pytest.mark.parametrize('grid', [{'views': 0}, {'views': 1}, {'tile': 48}, {'tile': 0}])
def test_a_grid_that_cannot_be(grid):
    for call in (bake_parts, make_model):
        with pytest.raises(ValueError, match='must be'):
            call(as_parts(pv.Cube()), **grid)


def test_the_key_is_of_the_content():
    def key(**looks):
        return content_key(as_parts(pv.Sphere(), **looks))

    assert key(color='red') == key(color='red')
    assert len({key(color='red'), key(color='blue'), key(color='red', smooth_shading=True)}) == 3
    assert atlas_key('', 4, 16, False) != atlas_key('', 4, 16, True)


def test_a_truncated_cache_file_is_baked_again_with_one_warning(tmp_path):
    kwargs = {'views': 3, 'tile': 16, 'cache': tmp_path}
    first = bake(pv.Cone(), **kwargs)
    (file,) = tmp_path.glob('*.atlas')
    file.write_bytes(file.read_bytes()[:-100])
    with pytest.warns(PvibrWarning) as caught:
        again = bake(pv.Cone(), **kwargs)
    assert len(caught) == 1
    np.testing.assert_array_equal(first.geometry, again.geometry)


def is_same(one, other):
    same = all((one.cards[name] == other.cards[name]).all() for name in one.cards)
    return (
        same and (one.mesh_to == other.mesh_to).all() and (one.mesh_from == other.mesh_from).all()
    )


def test_limits_grow_with_the_error():
    rng = np.random.default_rng(0)
    rows = np.cumsum(rng.uniform(0, 0.5, (5, 16, 4)), 0)
    names = ('splat', 'flat', 'parallax', 'blended', 'fine', 'mesh1')
    table = {n: rows * s for n, s in zip(names, (4, 2, 1, 0.5, 0.4, 0.2), strict=True)}
    table |= {'sizes': np.array([8.0, 16, 32, 64, 128]), 'mesh1.radii': np.array(0.01)}
    reached = [limits_of(table, 2, e).mesh_from for e in (0.25, 0.5, 1, 2, 4)]
    assert (np.diff(reached, axis=0) >= 0).all()
    assert np.ptp(reached, axis=1).any()
    for error in (0.5, 1.0, 2.0):
        cards = limits_of(table, 2, error).cards.values()
        assert all((a[1] == b[0]).all() for a, b in itertools.pairwise(cards))


def test_no_cards_where_nothing_was_measured():
    limits = limits_of({}, 3, 1.0)
    assert not limits.mesh_from.any()
    assert np.isinf(limits.mesh_to[0]).all()
    assert not limits.mesh_to[1:].any()


def test_a_driver_without_cards_gets_meshes_and_one_warning(monkeypatch):
    def fails(*_):
        msg = 'no'
        raise ShaderError(msg)

    monkeypatch.setattr(levels, 'measure', fails)
    with pytest.warns(PvibrWarning, match='meshes are drawn instead') as caught:
        model = make_model(as_parts(pv.Sphere()), cache=False)
    assert len(caught) == 1
    assert not model.limits(1.0).mesh_from.any()


def test_scattered_matter_is_thinned_and_keeps_its_area():
    rng = np.random.default_rng(1)
    leaves = pv.merge([pv.Triangle().scale(0.02).translate(p) for p in rng.uniform(size=(400, 3))])
    (part,) = as_parts(leaves.extract_surface(algorithm=None))
    light = lighter(part, 0.25).mesh
    assert light.n_cells == 100
    assert light.area == pytest.approx(part.mesh.area, rel=0.02)


def test_lighter_levels_are_read_again(tmp_path):
    mesh = pv.Sphere(theta_resolution=30, phi_resolution=30)
    mesh['height'] = mesh.points[:, 2].copy()
    mesh.cell_data['half'] = np.arange(mesh.n_cells) % 2
    kwargs = {'views': 3, 'tile': 16, 'cache': tmp_path}

    def made():
        return make_model(as_parts(mesh, scalars='height', smooth_shading=True), **kwargs)

    first, again = made(), made()
    assert len(first.levels) == len(again.levels) > 1
    assert is_same(first.limits(1.0), again.limits(1.0))
    for one, other in zip(first.levels, again.levels, strict=True):
        assert one.error == other.error
        a, b = one.parts[0].mesh, other.parts[0].mesh
        assert a == b
        assert a.point_data.active_normals_name == b.point_data.active_normals_name


def test_corners_that_differ_by_rounding_are_read_again(tmp_path, monkeypatch):
    parts = as_parts(pv.Cube().triangulate())
    make_model(parts, views=3, tile=16, cache=tmp_path)
    store, key = AtlasCache(tmp_path), atlas_key(content_key(parts), 3, 16, False)
    arrays = dict(store.get(key))
    # Of faces that lie askew by rounding errors a hull keeps no points inside.
    arrays['corners'] = (1 - 1e-13) * arrays['corners']
    assert store.put(key, arrays)
    monkeypatch.setattr(levels, 'bake_parts', None)  # warnings are errors
    again = make_model(parts, views=3, tile=16, cache=tmp_path)
    np.testing.assert_array_equal(again.corners, arrays['corners'])


FORGED = {
    'no levels': lambda a: a.pop('levels'),
    'no errors': lambda a: [a.pop(k) for k in list(a) if k.startswith('errors.')],
    'errors of another shape': lambda a: a.update({'errors.flat': np.zeros(2)}),
    'no grid': lambda a: a.pop('grid'),
    'a grid of text': lambda a: a.update(grid=np.array(['a', 'b', 'c'])),
    'faces beyond the points': lambda a: a.update({'level0.0.faces': a['level0.0.faces'] + 10**6}),
    'points missing': lambda a: a.pop('level0.0.points'),
    'no corners': lambda a: a.pop('corners'),
    'corners of another mesh': lambda a: a.update(corners=2 * a['corners']),
    'corners of NaN': lambda a: a.update(corners=np.nan * a['corners']),
}


@pytest.fixture(scope='module')
def sphere_model():
    """Parts of a sphere, and its model."""
    parts = as_parts(pv.Sphere(theta_resolution=30, phi_resolution=30))
    with pytest.MonkeyPatch.context() as patch:
        found = []
        patch.setattr(levels, 'measure', lambda *args: found.append(measure(*args)) or found[-1])
        model = make_model(parts, cache=False, views=3, tile=16)
    return parts, model, found[-1]


@pytest.mark.parametrize('how', FORGED)
def test_what_is_forged_is_baked_again_once(how, sphere_model, tmp_path, monkeypatch):
    parts, wanted, errors = sphere_model
    kwargs = {'views': 3, 'tile': 16, 'cache': tmp_path}
    monkeypatch.setattr(levels, 'measure', lambda *_: dict(errors))  # as those of a new bake are
    make_model(parts, **kwargs)
    store = AtlasCache(tmp_path)
    key = atlas_key(content_key(parts), 3, 16, False)
    arrays = dict(store.get(key))
    FORGED[how](arrays)
    assert store.put(key, arrays)
    with pytest.warns(PvibrWarning, match='baked again') as caught:
        again = make_model(parts, **kwargs)
    assert len(caught) == 1
    assert is_same(again.limits(1.0), wanted.limits(1.0))
    make_model(parts, **kwargs)  # warnings are errors
