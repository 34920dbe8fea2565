"""Hierarchies in files and in the cache: whole, checked, and never trusted."""

import numpy as np
import pytest
import pyvista as pv

import pvibr.cli.app as cli
from pvibr.core.errors import PvibrError, PvibrWarning
from pvibr.instances.cache import AtlasCache
from pvibr.large import stored
from pvibr.large.checked_file import open_checked, write_checked
from pvibr.large.sources import source_of
from tests.large.surfaces import terrain
from tests.pictures import off, place, plotter, shot
from tests.refusals import refused

SIZE = (160, 120)


@pytest.fixture(scope='module')
def file(tmp_path_factory):
    return terrain().ibr.large(tmp_path_factory.mktemp('large') / 'terrain.pvl', progress=False)


def picture(mesh, **kwargs):
    pl = plotter(SIZE)
    thing = pl.ibr.add_large_mesh(mesh, show_scalar_bar=False, **kwargs)
    place(pl, (0.4, -1.0, 0.9), (0.5, 0.5, 0))
    pl.show(auto_close=False)
    return shot(pl), thing


@pytest.mark.parametrize('look', [{}, {'scalars': 'pattern'}, {'color': 'red'}])
def test_file_looks_like_its_mesh(file, look):
    from_file, thing = picture(file, **look)
    from_mesh, other = picture(terrain(), **look)
    np.testing.assert_array_equal(from_file, from_mesh)
    assert thing.n_triangles == other.n_triangles
    assert thing.pick(80, 60) == other.pick(80, 60)
    thing.set_scalars(terrain()['pattern'])
    refused('one value per point', thing.set_scalars, np.zeros(2), kind=ValueError)


def test_file_is_mapped_and_not_read(file):
    hierarchy, source = stored.load(file)
    base = hierarchy.points
    while base is not None and not isinstance(base, np.memmap):
        base = getattr(base, 'base', None) if isinstance(base, np.ndarray) else base.obj
    assert base is not None
    assert set(source.arrays) >= {'height', 'pattern'}
    assert source.active == 'height'


def test_grid_in_a_file(tmp_path):
    grid = pv.ImageData(dimensions=(60, 60, 3), spacing=(1 / 59, 1 / 59, 0.01))
    grid['x'] = grid.points[:, 0]
    path = grid.ibr.large(tmp_path / 'grid.pvl')
    _, thing = picture(path)
    values = np.linspace(0, 1, grid.n_points)
    thing.set_scalars(values)
    assert thing.mapper.scalar_range == (0, 1)
    assert thing.pick(80, 60).index < grid.n_cells


def test_every_flipped_or_cut_byte_is_found_and_named(file, tmp_path):
    whole, entry = file.read_bytes(), open_checked(file)
    places = {name: (a.offset, a.nbytes) for name, a in entry.items() if a.nbytes}
    rng = np.random.default_rng(0)
    broken = tmp_path / 'broken.pvl'

    def flipped(at):
        altered = bytearray(whole)
        altered[at] ^= 0x10
        broken.write_bytes(altered)
        return broken

    for name, (start, size) in places.items():
        for at in (start, start + size - 1, start + int(rng.integers(size))):
            message = f'broken.pvl.*array {name!r} is damaged'
            refused(message, stored.load, flipped(at), kind=PvibrError)
    table = whole.index(b'{"arrays"')
    for at in (0, 9, 20, 27, table, table + 40, len(whole) - 1):
        refused('broken.pvl', stored.load, flipped(at), kind=PvibrError)
    for length in (0, 10, 100, len(whole) // 2, len(whole) - 1):
        broken.write_bytes(whole[:length])
        with pytest.raises((PvibrError, ValueError), match='broken'):
            stored.load(broken)
    broken.write_bytes(whole + b'x')
    refused('instead of', stored.load, broken, kind=PvibrError)


def test_flip_anywhere_is_an_error_or_the_same_picture(file, tmp_path):
    whole, expected = file.read_bytes(), picture(file)[0]
    broken, refusals = tmp_path / 'broken.pvl', 0
    for at in np.linspace(0, len(whole) - 1, 60).astype(int):
        altered = bytearray(whole)
        altered[at] ^= 1 << int(at) % 8
        broken.write_bytes(altered)
        try:
            found, _ = picture(broken)
        except PvibrError:
            refusals += 1
        else:  # between two arrays
            np.testing.assert_array_equal(found, expected)
    assert refusals > 50


def written(path, arrays, meta):
    write_checked(path, {name: [array] for name, array in arrays.items()}, meta)
    return path


@pytest.mark.parametrize('name', ['vertices', 'triangles', 'vertex_of_point', 'patch_cells'])
def test_forged_file_is_found(file, tmp_path, name):
    """Its checksums are right, but its arrays point outside of each other."""
    entry = open_checked(file)
    forged = entry[name].copy()
    forged[-1] = np.iinfo(forged.dtype).max
    path = written(tmp_path / 'forged.pvl', dict(entry) | {name: forged}, entry.meta)
    refused(f'belong together.*{name}', stored.load, path, kind=PvibrError)
    path = written(tmp_path / 'other.pvl', {'a': forged}, {'kind': 'other'})
    refused('not a large mesh', stored.load, path, kind=PvibrError)
    del entry[name]
    path = written(tmp_path / 'less.pvl', entry, entry.meta)
    refused('content is wrong', stored.load, path, kind=PvibrError)


@pytest.mark.parametrize('name', ['active', 'point_count', 'cell_count'])
def test_forged_description_is_found(file, tmp_path, name):
    entry = open_checked(file)
    path = written(tmp_path / 'forged.pvl', dict(entry), entry.meta | {name: 3})
    refused('belong together', stored.load, path, kind=PvibrError)


def test_file_that_cannot_be_written_leaves_the_old_one(file, tmp_path):
    refused('end in .pvl', terrain().ibr.large, tmp_path / 'a.ply', kind=ValueError)
    refused('no folder', terrain().ibr.large, tmp_path / 'b' / 'a.pvl', kind=FileNotFoundError)
    refused('existing', stored.load, tmp_path / 'no.pvl', kind=FileNotFoundError)
    old = tmp_path / 'old.pvl'
    old.write_bytes(b'old')
    flat = pv.PolyData(np.zeros((3, 3)), faces=[3, 0, 1, 2])
    refused('none with an area', flat.ibr.large, old, kind=ValueError)
    assert old.read_bytes() == b'old'
    assert list(tmp_path.iterdir()) == [old]


def test_cache_is_checked_and_built_again(tmp_path):
    mesh = source_of(terrain()).mesh
    first = stored.built(mesh, AtlasCache(tmp_path))
    (entry,) = tmp_path.glob('*.atlas')
    content = bytearray(entry.read_bytes())
    content[len(content) // 2] ^= 1
    entry.write_bytes(content)
    with pytest.warns(PvibrWarning, match='altered'):
        second = stored.built(mesh, AtlasCache(tmp_path))
    np.testing.assert_array_equal(first.triangles, second.triangles)
    assert stored.hierarchy_key(mesh) in AtlasCache(tmp_path)


def test_key_follows_content():
    mesh = terrain().copy()
    keys = {stored.hierarchy_key(source_of(mesh).mesh)}
    assert stored.hierarchy_key(source_of(mesh.copy()).mesh) in keys
    mesh.points[5, 2] += 1e-3
    keys.add(stored.hierarchy_key(source_of(mesh).mesh))
    mesh.regular_faces = np.asarray(mesh.regular_faces)[:, [1, 2, 0]]
    keys.add(stored.hierarchy_key(source_of(mesh).mesh))
    mesh.compute_normals(split_vertices=False, inplace=True)
    keys.add(stored.hierarchy_key(source_of(mesh).mesh))
    assert len(keys) == 4


def test_command_builds_a_file(tmp_path, capsys):
    terrain().copy().save(tmp_path / 'a.ply')
    out = tmp_path / 'a.pvl'
    assert cli.main(['build', str(tmp_path / 'a.ply'), '-o', str(out)]) == 0
    assert 'wrote' in capsys.readouterr().out
    from_file, _ = picture(out, color='white')
    from_mesh, _ = picture(terrain(), color='white')
    assert (off(from_file, from_mesh) > 15).mean() < 0.01
    assert cli.main(['build', str(tmp_path / 'a.ply'), '-o', str(tmp_path / 'a.npz')]) == 2
    assert cli.main(['build', str(tmp_path / 'no.ply'), '-o', str(out)]) == 2
