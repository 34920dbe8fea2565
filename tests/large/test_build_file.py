"""Hierarchies built out of core: bounded, in pieces, and from where a stopped build was."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
import pyvista as pv

import pvibr.cli.app as cli
from pvibr.core.errors import PvibrWarning
from pvibr.large import build_file, cells, stored
from pvibr.large.build import Builder, build_hierarchy
from pvibr.large.columns import Columns
from pvibr.large.pieces import source_in_pieces
from pvibr.large.sources import source_of
from tests.large.surfaces import folded, noise, terrain
from tests.large.test_edges import quads
from tests.large.textured import charts
from tests.refusals import refused

FORMATS = '<', '>'


@pytest.fixture(autouse=True)
def small_blocks(monkeypatch):
    """Let meshes of tests have several blocks."""
    for module in ('build', 'distribution'):
        monkeypatch.setattr(f'pvibr.large.{module}.BLOCK_TRIANGLES', 3 * cells.CELL_TRIANGLES)


def write_ply(path, mesh, order='<', extra=()):
    """Write a binary PLY file with double coordinates and some arrays."""
    names = {'<': 'little', '>': 'big'}
    fields = [(n, f'{order}f8') for n in 'xyz'] + [(n, f'{order}f4') for n in extra]
    vertices = np.empty(mesh.n_points, fields)
    for k, name in enumerate('xyz'):
        vertices[name] = mesh.points[:, k]
    for name in extra:
        vertices[name] = mesh[name]
    faces = np.empty(mesh.n_cells, [('n', 'u1'), ('corners', f'{order}i4', 3)])
    faces['n'], faces['corners'] = 3, mesh.regular_faces
    head = ['ply', f'format binary_{names[order]}_endian 1.0', f'element vertex {mesh.n_points}']
    head += [f'property double {n}' for n in 'xyz'] + [f'property float {n}' for n in extra]
    head += [f'element face {mesh.n_cells}', 'property list uchar int vertex_indices']
    content = '\n'.join([*head, 'end_header', '']).encode() + vertices.tobytes() + faces.tobytes()
    path.write_bytes(content)
    return path


def assert_same(first, second):
    for name, array in first.to_arrays().items():
        np.testing.assert_array_equal(array, getattr(second, name), err_msg=name)


@pytest.mark.parametrize('make', [terrain, folded, charts, quads])
def test_files_pieces_and_processes_change_nothing(make, tmp_path, monkeypatch):
    """One builder: in memory, in files by pieces of few rows, by two processes."""
    mesh = source_of(make()).mesh
    expected = build_hierarchy(mesh)
    assert_same(build_hierarchy(mesh, workers=2), expected)
    monkeypatch.setattr('pvibr.large.columns.np.memmap', _counted(np.memmap, maps := []))
    builder = Builder(columns := Columns(tmp_path), workers=2)
    builder._rows = 5000
    arrays = builder.build(mesh)
    assert len(maps) > 10
    for name, array in expected.to_arrays().items():
        found = np.concatenate([part[:] for part in arrays[name]])
        np.testing.assert_array_equal(found, array, err_msg=name)
    columns.close()


def _counted(function, calls):
    def counted(*args, **kwargs):
        calls.append(args)
        return function(*args, **kwargs)

    return counted


def test_kept_triangles_keep_their_cells():
    """Where no simplification is possible, triangles of the mesh go to coarser levels."""
    rng = np.random.default_rng(0)
    loose = rng.random((9000, 1, 3)) + 0.01 * rng.random((9000, 3, 3)) + (1.5, 0, 0)
    soup = pv.PolyData.from_regular_faces(loose.reshape(-1, 3), np.arange(27_000).reshape(-1, 3))
    mesh = pv.merge([terrain().copy(), soup], merge_points=False)
    hierarchy = build_hierarchy(source_of(mesh).mesh)
    faces = np.concatenate(
        [
            hierarchy.vertices[slice(*hierarchy.vertex_starts[p : p + 2])][
                hierarchy.triangles[slice(*hierarchy.triangle_starts[p : p + 2])]
            ]
            for p in hierarchy.full_patches
        ]
    )
    corners = hierarchy.points[faces] + hierarchy.origin
    surface = mesh.extract_surface(algorithm='dataset_surface').regular_faces
    expected = np.asarray(mesh.points)[surface[hierarchy.mesh_cells]]
    np.testing.assert_allclose(corners, expected, atol=1e-6)


@pytest.mark.parametrize('order', FORMATS)
def test_ply_in_pieces(order, tmp_path):
    path = write_ply(tmp_path / 'a.ply', terrain(), order, ['height', 'pattern'])
    source = source_in_pieces(path)
    assert list(source.arrays) == ['height', 'pattern']
    out = build_file.write_large(path, tmp_path / 'a.pvl', progress=False)
    hierarchy, found = stored.load(out)
    assert_same(hierarchy, build_hierarchy(source_of(terrain()).mesh))
    np.testing.assert_array_equal(found.arrays['height'], terrain()['height'].astype(np.float32))
    assert found.point_count == terrain().n_points


def test_no_piece_is_larger_than_the_memory_allows(tmp_path, monkeypatch):
    source = source_in_pieces(write_ply(tmp_path / 'a.ply', terrain(300)))
    monkeypatch.setattr('pvibr.large.pieces.np.fromfile', _counted(np.fromfile, pieces := []))
    builder = Builder(columns := Columns(tmp_path), memory_bytes=1e6)
    builder.build(source.mesh)
    columns.close()
    counts = [count for path, _, count in pieces if path.suffix == '.ply']
    assert max(counts) <= 1 << 16
    assert sum(counts) < 5 * (terrain(300).n_points + terrain(300).n_cells)


def test_colours_and_normals_of_ply(tmp_path):
    ball = pv.Sphere(theta_resolution=20)
    ball['colours'] = np.random.default_rng(0).integers(0, 255, (ball.n_points, 3), np.uint8)
    ball.save(tmp_path / 'a.ply', texture='colours')
    source, whole = source_in_pieces(tmp_path / 'a.ply'), source_of(str(tmp_path / 'a.ply'))
    assert source.active == whole.active == 'RGB'
    np.testing.assert_array_equal(source.arrays['RGB'][:], whole.arrays['RGB'])
    np.testing.assert_array_equal(source.mesh.normals[:], whole.mesh.normals)
    np.testing.assert_array_equal(source.mesh.faces[7:20], whole.mesh.faces[7:20])


def test_stl_in_pieces_is_welded(tmp_path):
    mesh = folded(40)
    mesh.save(tmp_path / 'a.stl')
    out = build_file.write_large(tmp_path / 'a.stl', tmp_path / 'a.pvl', progress=False)
    hierarchy, source = stored.load(out)
    read = pv.read(tmp_path / 'a.stl')
    assert source.point_count == read.n_points
    assert hierarchy.n_triangles == read.n_cells
    low, high = hierarchy.bounds
    np.testing.assert_allclose(np.c_[low, high].ravel(), read.bounds, atol=1e-6)
    # Numbered as its reader does.
    places = hierarchy.points[hierarchy.vertex_of_point] + hierarchy.origin
    np.testing.assert_allclose(places, read.points, atol=1e-6)


def write_heights(path, heights, nodata=None):
    rasterio = pytest.importorskip('rasterio')
    transform = rasterio.Affine(2.0, 0, 500_000.0, 0, -2.0, 5_000_000.0)
    kind = {'count': 1, 'dtype': 'float32', 'crs': 'EPSG:32632', 'transform': transform}
    size = {'height': heights.shape[0], 'width': heights.shape[1], 'nodata': nodata}
    with rasterio.open(path, 'w', driver='GTiff', **kind, **size) as file:
        file.write(heights.astype(np.float32), 1)
    return path


def test_heights_of_a_geotiff(tmp_path):
    heights = 30 * noise(120, 3, 1.9)[:, :90]
    heights[40:50, 20:30] = -9999
    path = write_heights(tmp_path / 'a.tif', heights, -9999)
    out = build_file.write_large(path, tmp_path / 'a.pvl', progress=False)
    hierarchy, source = stored.load(out)
    assert source.active == 'height'
    assert (
        hierarchy.n_triangles == 2 * (119 * 89 - 11 * 11) + 2
    )  # at two corners of the hole one is left
    low, high = hierarchy.bounds
    known = heights[heights > -9000]
    expected = [500_001, 5_000_000 - 2 * 119 - 1, known.min(), 500_179, 4_999_999, known.max()]
    np.testing.assert_allclose([*low, *high], expected, atol=1e-2)
    corners = hierarchy.points[hierarchy.vertices[:3]]
    assert len(corners) == 3
    assert (hierarchy.normals[hierarchy.areas.nonzero()[0], 2] > 0).all(), 'they face upwards'
    values = source.arrays['height'].reshape(heights.shape)
    np.testing.assert_allclose(values[heights > -9000], known, rtol=1e-6)
    assert np.isnan(values[45, 25])


def test_other_files_are_read_whole_and_it_says_so(tmp_path, monkeypatch):
    terrain().save(tmp_path / 'a.vtp')
    assert source_in_pieces(tmp_path / 'a.vtp') is None
    monkeypatch.setattr(build_file, '_WHOLE_SHARE', 0)
    with pytest.warns(PvibrWarning, match='read whole'):
        build_file.write_large(tmp_path / 'a.vtp', tmp_path / 'a.pvl', progress=False)


@pytest.mark.parametrize(
    ('faces', 'count'), [([4, 0, 1, 2, 3], 2), ([3, 0, 1, 2, 4, 0, 1, 2, 3], 3)]
)
def test_ply_of_other_faces_is_read_whole(faces, count, tmp_path):
    square = np.array([(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)], float)
    path, out = tmp_path / 'a.ply', tmp_path / 'a.pvl'
    pv.PolyData(square, faces=faces).save(path)
    assert source_in_pieces(path) is None
    assert stored.load(build_file.write_large(path, out))[0].n_triangles == count


def test_wrong_faces_of_a_ply_are_refused(tmp_path):
    square = np.array([(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)], float)
    path, out = tmp_path / 'a.ply', tmp_path / 'a.pvl'
    mesh = pv.PolyData(square, faces=[3, 0, 1, 2, 3, 0, 1, 2])
    content = write_ply(path, mesh).read_bytes()
    path.write_bytes(content[:-1] + b'\x7f')
    refused('of its 4 points', build_file.write_large, path, out)
    path.write_bytes(content[:-13] + b'\x04' + content[-12:])
    refused('must be triangles', build_file.write_large, path, out)
    path.write_bytes(content[:-1])
    refused('a.ply: .*it is cut', build_file.write_large, path, out)
    mesh.points[0, 0] = np.nan
    refused(r'points\[0\] must be finite', build_file.write_large, write_ply(path, mesh), out)
    assert sorted(p.name for p in tmp_path.iterdir()) == ['a.ply']


class _Stopped(Exception):
    pass


def stopped_after(monkeypatch, commits, error=_Stopped):
    """Let a build raise an error at a certain commit."""
    commit, counts = Columns.commit, []

    def counted(self, state):
        commit(self, state)
        counts.append(1)
        if len(counts) == commits:
            raise error

    monkeypatch.setattr(Columns, 'commit', counted)
    return counts


@pytest.mark.parametrize('commits', [1, 2, 4, 7, 9])
def test_stopped_build_goes_on(commits, tmp_path, monkeypatch):
    path = write_ply(tmp_path / 'a.ply', terrain())
    out = tmp_path / 'a.pvl'
    with monkeypatch.context() as patch:
        counts = stopped_after(patch, 1000)
        whole = build_file.write_large(path, tmp_path / 'b.pvl', workers=1).read_bytes()
        total = len(counts)
    with monkeypatch.context() as patch:
        stopped_after(patch, commits, KeyboardInterrupt)
        with pytest.raises(KeyboardInterrupt):
            build_file.write_large(path, out, workers=1)
    assert not out.exists()
    with monkeypatch.context() as patch:
        counts = stopped_after(patch, 1000)
        build_file.write_large(path, out, workers=1)
    assert len(counts) == total - commits, 'what was done was not done again'
    assert out.read_bytes() == whole
    assert sorted(p.name for p in tmp_path.iterdir()) == ['a.ply', 'a.pvl', 'b.pvl']


def test_columns_stay_while_the_journal_has_them(tmp_path):
    """A build that is killed once a level is done, and let go of, does not start over."""
    columns = Columns(tmp_path)
    columns.append('a', np.arange(3))
    columns.append('b', np.arange(4))
    columns.commit({'level': 1})
    columns.drop('a')
    columns.close()
    again = Columns(tmp_path)
    assert again.resumed() == {'level': 1}
    assert again.all_of('a').tolist() == [0, 1, 2]
    again.drop('a')
    again.commit({'level': 2})
    again.close()
    assert sorted(p.name for p in tmp_path.iterdir()) == ['b.column', 'journal.json']


@pytest.mark.parametrize('level', [0, 1])
def test_build_killed_after_a_level_goes_on(level, tmp_path, monkeypatch):
    path = write_ply(tmp_path / 'a.ply', terrain())
    out = tmp_path / 'a.pvl'
    whole = build_file.write_large(path, tmp_path / 'b.pvl', workers=1).read_bytes()
    drop = Columns.drop

    def killed(self, *names):
        drop(self, *names)
        if f'{level}.faces' in names:
            raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(Columns, 'drop', killed)
        with pytest.raises(KeyboardInterrupt):
            build_file.write_large(path, out, workers=1)
    monkeypatch.setattr(Builder, '_read', None)  # it would start over
    assert build_file.write_large(path, out, workers=1).read_bytes() == whole


@pytest.mark.parametrize('harm', ['flip', 'cut', 'journal', 'other'])
def test_damaged_work_is_done_again(harm, tmp_path, monkeypatch):
    path = write_ply(tmp_path / 'a.ply', terrain())
    out = tmp_path / 'a.pvl'
    whole = build_file.write_large(path, tmp_path / 'b.pvl', workers=1).read_bytes()
    with monkeypatch.context() as patch:
        stopped_after(patch, 5)
        with pytest.raises(_Stopped):
            build_file.write_large(path, out, workers=1)
    (folder,) = (tmp_path / 'a.pvl.build').iterdir()
    column = folder / 'base.points.column'
    content = bytearray(column.read_bytes())
    if harm == 'flip':
        content[1000] ^= 1
        column.write_bytes(content)
    elif harm == 'cut':
        column.write_bytes(content[:-1])
    elif harm == 'journal':
        (folder / 'journal.json').write_text('{"state"')
    else:
        write_ply(path, folded(40))
        whole = build_file.write_large(path, tmp_path / 'b.pvl', workers=1).read_bytes()
    assert build_file.write_large(path, out, workers=1).read_bytes() == whole


def test_file_of_the_same_mesh_is_left(tmp_path, monkeypatch):
    out = terrain().ibr.large(tmp_path / 'a.pvl')
    content = out.read_bytes()
    with monkeypatch.context() as patch:
        patch.setattr(build_file, '_build', None)
        terrain().ibr.large(out)
    out.write_bytes(content[:-9])
    assert terrain().ibr.large(out).read_bytes() == content, 'a damaged one is built again'


def test_full_disk_is_one_error_and_leaves_what_is_done(tmp_path, monkeypatch):
    import pvibr.large.columns as module

    out, append = tmp_path / 'a.pvl', module._InFile.append

    with monkeypatch.context() as patch:
        counts = stopped_after(patch, 1000)

        def full(self, rows):
            append(self, rows[:1])
            if len(counts) == 6:
                raise OSError(28, 'No space left on device')
            append(self, rows[1:])

        patch.setattr(module._InFile, 'append', full)
        with pytest.raises(OSError, match=r'disk is full.*a\.pvl\.build.*goes on') as error:
            terrain().ibr.large(out, workers=1)
    assert error.value.errno == 28
    assert not out.exists()
    with monkeypatch.context() as patch:
        counts = stopped_after(patch, 1000)
        resumed = terrain().ibr.large(out, workers=1).read_bytes()
    counts_resumed = len(counts)
    with monkeypatch.context() as patch:
        counts = stopped_after(patch, 1000)
        assert terrain().ibr.large(tmp_path / 'b.pvl', workers=1).read_bytes() == resumed
    assert counts_resumed == len(counts) - 6


def started(path, out, *more):
    program = (
        'import sys; import pvibr.large.build as b, pvibr.large.distribution as d;'
        f'b.BLOCK_TRIANGLES = d.BLOCK_TRIANGLES = {3 * cells.CELL_TRIANGLES};'
        'from pvibr.cli.app import main; sys.exit(main(sys.argv[1:]))'
    )
    arguments = [sys.executable, '-c', program, 'build', str(path), '-o', str(out), *more]
    return subprocess.Popen(arguments, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE)


def wait_for(condition, seconds=60):
    end = time.monotonic() + seconds
    while not condition() and time.monotonic() < end:
        time.sleep(0.005)
    assert condition()


@pytest.mark.skipif(os.name == 'nt', reason='it has no such signals')
@pytest.mark.parametrize('how', [signal.SIGKILL, signal.SIGINT])
def test_killed_build_goes_on(how, tmp_path):
    path = write_ply(tmp_path / 'a.ply', terrain(300))
    out, work = tmp_path / 'a.pvl', tmp_path / 'a.pvl.build'
    process = started(path, out, '--workers', '2')
    wait_for(lambda: list(work.glob('*/1.faces.column')))
    process.send_signal(how)
    _, errors = process.communicate()
    assert process.returncode == (130 if how == signal.SIGINT else -9)
    assert b'Traceback' not in errors
    assert (b'goes on' in errors) == (how == signal.SIGINT)
    assert not out.exists()
    assert not list(tmp_path.glob('.*.pvl')), 'no half file'
    again = started(path, out)
    assert again.wait() == 0
    again.stderr.close()
    expected = build_hierarchy(source_of(terrain(300)).mesh)
    assert_same(stored.load(out)[0], expected)
    assert not work.exists()


def test_two_builders_at_once_both_end_right(tmp_path):
    path, out = write_ply(tmp_path / 'a.ply', terrain(300)), tmp_path / 'a.pvl'
    both = [started(path, out) for _ in range(2)]
    for process in both:
        assert process.wait() == 0
        process.stderr.close()
    assert stored.load(out)[0].n_triangles == terrain(300).n_cells
    assert sorted(p.name for p in tmp_path.iterdir()) == ['a.ply', 'a.pvl']


def test_process_that_dies_is_named(tmp_path, monkeypatch):
    program = 'pvibr.core.child_processes._PROGRAM'
    monkeypatch.setattr(program, 'raise SystemExit("no memory")')
    with pytest.raises(RuntimeError, match='no memory'):
        terrain().ibr.large(tmp_path / 'a.pvl', workers=2)
    monkeypatch.setattr('pvibr.large.block.simplify_cell', None)
    with pytest.raises(TypeError, match='not callable'):
        terrain().ibr.large(tmp_path / 'a.pvl', workers=1)


@pytest.mark.parametrize('option', [{'memory': 0.1}, {'memory': 'x'}, {'workers': 0}])
def test_options_are_checked(option, tmp_path):
    (name,) = option
    kind = TypeError if 'x' in option.values() else ValueError
    refused(name, terrain().ibr.large, tmp_path / 'a.pvl', **option, kind=kind)
    assert cli.main(['build', str(Path(__file__)), '-o', str(tmp_path / 'a.pvl')]) == 2


def test_texture_coordinates_and_face_values_of_ply(tmp_path):
    mesh = terrain().copy()
    mesh['s'], mesh['t'] = mesh.points[:, 0], mesh.points[:, 1]
    path = write_ply(tmp_path / 'a.ply', mesh, extra=['s', 't', 'height'])
    content = path.read_bytes().replace(
        b'vertex_indices\nend_header', b'vertex_indices\nproperty uchar part\nend_header'
    )
    start = len(content) - 13 * mesh.n_cells
    faces = np.frombuffer(content[start:], np.uint8).reshape(-1, 13)
    parts = (np.arange(mesh.n_cells) % 7).astype(np.uint8)
    path.write_bytes(content[:start] + np.c_[faces, parts].tobytes())
    out = build_file.write_large(path, tmp_path / 'a.pvl')
    hierarchy, source = stored.load(out)
    np.testing.assert_array_equal(source.cell_arrays['part'], parts)
    assert list(source.arrays) == ['height']
    places = hierarchy.points[hierarchy.vertices, :2] + hierarchy.origin[:2]
    slides = np.linalg.norm(places - hierarchy.texture_coordinates, axis=1)
    assert np.median(slides) < 1e-3
