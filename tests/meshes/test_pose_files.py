"""Poses in files: text, arrays, Parquet, clouds of points, and cities."""

import gzip
import json
import subprocess
import sys

import numpy as np
import pytest
import pyvista as pv
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from pvibr.io.cities import read_city
from pvibr.meshes.mesh_files import read_mesh, scene_instances
from pvibr.meshes.pose_files import read_poses
from tests.refusals import refused

finite = st.floats(-1e12, 1e12)


@given(
    arrays(np.float64, st.tuples(st.integers(0, 8), st.just(4)), elements=finite),
    st.sampled_from(',;\t'),
    st.sampled_from(['.csv', '.csv.gz', '.txt']),
    st.booleans(),
)
@settings(max_examples=25, deadline=None)
def test_tables_round_trip(tmp_path_factory, values, delimiter, suffix, marked):
    file = tmp_path_factory.mktemp('poses') / f'a{suffix}'
    lines = ['X,y,growth,Z'] + [','.join(map(repr, row)) for row in values.tolist()]
    text = '\r\n'.join(lines).replace(',', delimiter) + '\r\n\r\n'
    data = text.encode('utf-8-sig' if marked else 'utf-8')
    file.write_bytes(gzip.compress(data) if suffix.endswith('gz') else data)
    poses, columns = read_poses(file)
    np.testing.assert_array_equal(poses, values[:, [0, 1, 3]])
    np.testing.assert_array_equal(columns['growth'], values[:, 2])


def _write(tmp_path, text):
    file = tmp_path / 'poses.csv'
    file.write_text(text)
    return file


def test_rotation_and_scale(tmp_path):
    poses, columns = read_poses(
        _write(tmp_path, 'x,y,z,qw,qx,qy,qz,scale,id\n1,2,3,0,0,0,5,2,7\n')
    )
    expected = [[-2, 0, 0, 1], [0, -2, 0, 2], [0, 0, 2, 3], [0, 0, 0, 1]]
    np.testing.assert_allclose(poses[0], expected, atol=1e-12)
    assert list(columns) == ['id']


def test_scale_per_axis(tmp_path):
    poses, _ = read_poses(_write(tmp_path, 'x y z'.replace(' ', ';') + ';sx;sy;sz\n0;0;0;1;2;3\n'))
    np.testing.assert_array_equal(poses[0], np.diag([1.0, 2.0, 3.0, 1.0]))


def test_text_columns_gaps_and_quotes(tmp_path):
    text = '"x",y,z,kind,h\n1,2,3,"oak, old",NA\n\n4,5,6,elm,2.5\n'
    poses, columns = read_poses(_write(tmp_path, text))
    np.testing.assert_array_equal(poses, [[1, 2, 3], [4, 5, 6]])
    assert columns['kind'].tolist() == ['oak, old', 'elm']
    np.testing.assert_array_equal(columns['h'], [np.nan, 2.5])


def test_named_columns(tmp_path):
    file = _write(tmp_path, 'east,north,x\n1,2,9\n')
    poses, columns = read_poses(file, columns=('east', 'North', None))
    np.testing.assert_array_equal(poses, [[1, 2, 0]])
    assert columns['x'] == [9]


@pytest.mark.parametrize(
    ('text', 'match'),
    [
        ('x,y,z\n1,2,3\n\n1,oops,3\n', r"line 4, column 2 \('y'\): .* got 'oops'"),
        ('x,y,z\n1,2,nan\n', r"line 2, column 3 \('z'\): .* got 'nan'"),
        ('x,y,z\n1,2,\n', r"line 2, column 3 \('z'\): .* got ''"),
        ('x,y,z\n1,2,3\n1,2\n', 'line 3, column 3: .* got 2'),
        ('x,y,z\n1,2,3\n1,2,3,4\n', 'line 3, column 4: .* got 4'),
        ('x,y,z,s\n1,2,3,4\n1,2,3,a\n', r"line 3, column 4 \('s'\): must be a number, got 'a'"),
        ('x,y,kind\n1,2,a\n', "no column 'z'"),
        ('1,2,3\n', "no column 'x'"),
        ('', 'empty'),
        ('x,y,z,qw,qx\n1,2,3,1,0\n', "no column 'qy'"),
        ('x,y,z,qw,qx,qy,qz\n1,2,3,0,0,0,0\n', r'poses.csv: quaternions\[0\]'),
        ('x,y,z,scale\n1,2,3,0\n', 'inverse'),
    ],
)
def test_broken_tables_say_where(tmp_path, text, match):
    refused(match, read_poses, _write(tmp_path, text))


def test_headers_alone_are_an_empty_set(tmp_path):
    poses, columns = read_poses(_write(tmp_path, 'x,y,z,h,kind\n'))
    assert poses.shape == (0, 3)
    assert columns['h'].shape == (0,)


def test_arrays_on_disk(tmp_path):
    file = tmp_path / 'a.npy'
    np.save(file, np.arange(6.0).reshape(2, 3))
    poses, columns = read_poses(file)
    assert poses.shape == (2, 3)
    assert columns == {}
    np.save(file, np.array([{}], dtype=object), allow_pickle=True)
    refused(r'a\.npy', read_poses, file)
    file.write_bytes(b'')
    refused(r'a\.npy', read_poses, file)
    with pytest.raises(FileNotFoundError, match=r'existing poses file, got .*no\.csv'):
        read_poses(tmp_path / 'no.csv')


def test_bad_mapping(tmp_path):
    file = _write(tmp_path, 'x,y,z\n1,2,3\n')
    refused('columns must be', read_poses, file, columns=('x', 'y'))
    refused("no column 'gx'", read_poses, file, columns=('gx', 'y', None))


def test_others_are_read_only_when_wanted(tmp_path):
    names = ['x', 'y', 'z', *(f'c{k}' for k in range(1000))]
    text = ','.join(names) + '\n' + ','.join(map(str, range(1003))) + '\n'
    file = _write(tmp_path, '\ufeff' + text)
    poses, columns = read_poses(file, others=['c7', 'C999'])
    np.testing.assert_array_equal(poses, [[0, 1, 2]])
    assert {k: v.tolist() for k, v in columns.items()} == {'c7': [10], 'c999': [1002]}
    assert len(read_poses(file)[1]) == 1000
    assert read_poses(file, others=())[1] == {}
    refused("others must be columns, got 'c1000'", read_poses, file, others=['c1000'])


def _parquet(tmp_path, **columns):
    pa, pq = pytest.importorskip('pyarrow'), pytest.importorskip('pyarrow.parquet')
    file = tmp_path / 'poses.parquet'
    pq.write_table(pa.table(columns), file)
    return file


def test_parquet(tmp_path):
    columns = {'X': [1.0, 2.0], 'y': [3, 4], 'z': [5.0, 6.0], 'scale': [1.0, 2.0]}
    extra = {'h': [None, 7], 'kind': ['oak', None], 'good': [True, False], 'list': [[1], [2]]}
    poses, found = read_poses(_parquet(tmp_path, **columns, **extra))
    np.testing.assert_array_equal(poses[:, :3, 3], [[1, 3, 5], [2, 4, 6]])
    np.testing.assert_array_equal(poses[1, :3, :3], 2 * np.eye(3))
    assert list(found) == ['h', 'kind', 'good']
    np.testing.assert_array_equal(found['h'], [np.nan, 7])
    assert found['kind'].tolist() == ['oak', '']


def test_broken_parquet_says_where(tmp_path):
    with pytest.raises(ValueError, match="row 1, column 'y': must be finite, got nan"):
        read_poses(_parquet(tmp_path, x=[1, 2], y=[1, None], z=[0, 0]))
    with pytest.raises(ValueError, match="column 'y' must hold numbers"):
        read_poses(_parquet(tmp_path, x=[1, 2], y=['a', 'b'], z=[0, 0]))
    file = tmp_path / 'broken.parquet'
    file.write_bytes(b'PAR1 and nothing else PAR1')
    refused(r'broken\.parquet: not a readable Parquet file', read_poses, file)


@pytest.mark.parametrize('deep', [1, 256])
def test_clouds_of_points(tmp_path, deep):
    laspy = pytest.importorskip('laspy')
    cloud = laspy.create(point_format=2)
    points = np.array([[637177.98, 849393.95, 411.19], [637177.3, 849396.95, 411.25]])
    cloud.header.offsets, cloud.header.scales = points[0].round(), [0.01] * 3
    cloud.x, cloud.y, cloud.z = points.T
    cloud.intensity = [7, 9]
    cloud.red, cloud.green, cloud.blue = np.array([[255, 1], [2, 3], [0, 4]]) * deep
    file = tmp_path / 'points.las'
    cloud.write(file)
    poses, columns = read_poses(file)
    np.testing.assert_allclose(poses, points, atol=0.006)
    assert columns['intensity'].tolist() == [7, 9]
    assert columns['rgb'].tolist() == [[255, 2, 0], [1, 3, 4]]
    assert list(read_poses(file, others=['rgb'])[1]) == ['rgb']
    file.write_bytes(file.read_bytes()[:200])
    refused(r'points\.las: not a readable', read_poses, file)


def test_real_clouds_of_points(data_dir):
    pytest.importorskip('lazrs')
    poses, columns = read_poses(data_dir / 'instances/autzen_trim.laz', others=['rgb'])
    assert poses.shape == (110000, 3)
    assert columns['rgb'].max() == 236


@pytest.mark.parametrize('kind', ['csv', 'parquet', 'npy'])
def test_instances_stand_where_a_file_says(tmp_path, kind):
    rows = np.array([[0.0, 0, 0, 5], [2, 0, 0, 7]])
    if kind == 'csv':
        file = _write(tmp_path, 'x,y,z,h\n0,0,0,5\n2,0,0,7\n')
    elif kind == 'parquet':
        file = _parquet(tmp_path, **dict(zip(['x', 'y', 'z', 'h'], rows.T, strict=True)))
    else:
        file = tmp_path / 'a.npy'
        np.save(file, rows[:, :3])
    pl = pv.Plotter(off_screen=True)
    known = {} if kind == 'npy' else {'scalars': 'H'}
    cones = pl.ibr.add_instances(pv.Cone(), file, cache=False, **known)
    np.testing.assert_array_equal(cones.poses, rows[:, :3])
    if known:
        np.testing.assert_array_equal(cones.scalars, [5, 7])


def test_columns_of_text_colour_by_words(tmp_path):
    file = _write(tmp_path, 'x,y,z,kind\n0,0,0,oak\n2,0,0,ash\n4,0,0,oak\n')
    pl = pv.Plotter(off_screen=True)
    cones = pl.ibr.add_instances(pv.Cone(), file, scalars='kind', cache=False)
    assert cones.scalars.tolist() == ['oak', 'ash', 'oak']
    assert list(pl.scalar_bars.keys()) == ['kind']
    cones.update([1], scalars='hornbeam')  # longer than all before
    assert cones.scalars.tolist() == ['oak', 'hornbeam', 'oak']
    names = cones.table.GetAnnotations()
    assert [names.GetValue(k) for k in range(names.GetNumberOfValues())] == ['hornbeam', 'oak']


# -- cities ----------------------------------------------------------------------------------

SQUARE = [[[0, 1, 2, 3], [4, 5, 6, 7]]]  # with a hole


def city(tmp_path, **changes):
    pytest.importorskip('cjio')
    pytest.importorskip('mapbox_earcut')
    outer = [[0, 0, 0], [4000, 0, 0], [4000, 4000, 0], [0, 4000, 0]]
    inner = [[1000, 1000, 0], [1000, 3000, 0], [3000, 3000, 0], [3000, 1000, 0]]
    wall = [[0, 0, 1], [1, 0, 1], [1, 0, 0], [0, 0, 0]]
    turn = [[0, -2, 0, 1], [2, 0, 0, 0], [0, 0, 2, 0], [0, 0, 0, 1]]
    tree = {'type': 'GeometryInstance', 'template': 0, 'boundaries': [1]}
    tree['transformationMatrix'] = np.ravel(turn).tolist()
    plaza = {'type': 'MultiSurface', 'lod': '1', 'boundaries': SQUARE}
    objects = {
        'plaza': {'type': 'Road', 'attributes': {'width': 4, 'n': 'x'}, 'geometry': [plaza]},
        'oak': {'type': 'SolitaryVegetationObject', 'geometry': [tree]},
        'elm': {'type': 'SolitaryVegetationObject', 'geometry': [{**tree, 'boundaries': [2]}]},
        'group': {'type': 'CityObjectGroup'},
    }
    template = {'type': 'MultiSurface', 'lod': '1', 'boundaries': [[[0, 1, 2, 3]]]}
    city = {
        'type': 'CityJSON',
        'version': '2.0',
        'CityObjects': objects,
        'vertices': outer + inner,
        'transform': {'scale': [0.001] * 3, 'translate': [84616.0, 447422.0, 5.0]},
        'geometry-templates': {'templates': [template], 'vertices-templates': wall},
    } | changes
    file = tmp_path / 'town.city.json'
    file.write_text(json.dumps(city))
    return file


def test_cities_have_templates_and_objects(tmp_path):
    meshes, index, matrices = read_city(city(tmp_path))
    assert index.tolist() == [0, 0, 1]
    assert meshes[0].area == pytest.approx(1)
    np.testing.assert_allclose(matrices[0][:3, 3], [84616 + 4 + 1, 447422, 5])
    np.testing.assert_allclose(matrices[1][:3, 3], [84616 + 4 + 1, 447422 + 4, 5])
    np.testing.assert_array_equal(matrices[0][:3, :3], [[0, -2, 0], [2, 0, 0], [0, 0, 2]])
    assert meshes[1].area == pytest.approx(16 - 4)  # the hole is a hole
    kinds = [mesh.field_data['type'].tolist() for mesh in meshes]
    assert kinds == [['SolitaryVegetationObject'], ['Road']]
    assert set(meshes[1].cell_data['object']) == {0}
    assert set(meshes[1].cell_data['width']) == {4.0}
    np.testing.assert_allclose(matrices[2][:3, 3], [84616 + 2, 447422 + 2, 5])


def test_cities_are_drawn(tmp_path):
    file = city(tmp_path)
    pl = pv.Plotter(off_screen=True)
    drawn = pl.ibr.add_instances(file, cache=False)
    assert len(drawn) == 3
    bounds, whole = np.array(drawn.bounds), np.array(read_mesh(file).bounds)
    assert (bounds[::2] <= whole[::2]).all()
    assert (bounds[1::2] >= whole[1::2]).all()
    pl.show(auto_close=False)
    assert np.ptp(pl.screenshot(return_img=True), axis=(0, 1)).any()


@pytest.mark.parametrize(
    'changes',
    [
        {'type': 'CityGML'},
        {'version': '9.9'},
        {'version': 3},
        {'vertices': [[0, 0, 0]]},
        {'vertices': [[0, 0, None]] * 8},
        {'vertices': 'none'},
        {'CityObjects': []},
        {'CityObjects': {}},
        {'CityObjects': {'a': {'type': 'Road', 'geometry': [{'type': 'Solid'}]}}},
        {'geometry-templates': {}},
        {'transform': {'scale': [1, 1], 'translate': [0, 0, 0]}},
        {'transform': {'scale': [1, 1, None], 'translate': [0, 0, 0]}},
    ],
)
def test_broken_cities_say_so(tmp_path, changes):
    refused('town', read_city, city(tmp_path, **changes))


def test_other_json_is_no_city(tmp_path):
    file = tmp_path / 'list.json'
    file.write_text('[1, 2]')
    refused('list', read_mesh, file)
    with pytest.raises(FileNotFoundError):
        read_city(tmp_path / 'no.json')


def test_a_city_leaves_the_json_of_others_as_it_is(tmp_path):
    """In a process of its own: the library is imported once."""
    program = 'import json, sys; from pvibr import read_city; read_city(sys.argv[1]); '
    program += 'assert json.loads(json.dumps([0.1 + 0.2, 1e-300])) == [0.1 + 0.2, 1e-300]'
    subprocess.run([sys.executable, '-c', program, str(city(tmp_path))], check=True)


def test_a_real_city(data_dir):
    pytest.importorskip('cjio')
    meshes, index, matrices = scene_instances(data_dir / 'instances/delft.json')
    assert len(meshes) == len(index) == len(matrices) == 7
    heights = np.concatenate([mesh.cell_data['measuredHeight'] for mesh in meshes])
    assert np.nanmax(heights) == 8.57
    (solid,) = (m for m in meshes if np.isfinite(m.cell_data['measuredHeight']).any())
    assert len(np.unique(solid.cell_data['object'])) == 160


@pytest.mark.parametrize(
    'content', [b'x,y,z', gzip.compress(b'x,y,z' * 99)[:-12]], ids=['plain', 'cut off']
)
def test_what_is_no_gzip_file_is_named(tmp_path, content):
    file = tmp_path / 'a.csv.gz'
    file.write_bytes(content)
    refused(r'a\.csv\.gz: not a readable gzip file', read_poses, file)


def test_a_thousand_columns_make_a_short_message(tmp_path):
    file = tmp_path / 'a.csv'
    file.write_text(','.join(f'c{k}' for k in range(1000)) + '\n', encoding='utf-8-sig')
    for options in ({}, {'columns': ('c1', 'c2', 'c3'), 'others': ['height']}):
        with pytest.raises(ValueError, match='and 980 more') as caught:
            read_poses(file, **options)
        assert len(str(caught.value)) < 500


LONG = 'b' * 200_000
BROKEN = {
    'a value more in all': ('x,y,z\n1,2,3,9\n4,5,6,9\n', 'line 2, column 4'),
    'a value more in one': ('x,y,z,h\n1,2,3,4\n\n4,5,6,7,8\n', 'line 4, column 5'),
    'a value less': ('x,y,z,h\n1,2,3,4\n4,5,6\n', 'line 3, column 4'),
    'a long field': (f'x,y,z,k\n1,2,3,a\n1,2,{LONG},3\n', 'line 3, column 3'),
    'a long name': (f'x,{LONG},y,z\n1,2,3,4\n', 'line 1, column 2'),
    'an open quote': ('x,y,z,k\n1,2,3,"a\n' + '4,5,6,b\n' * 40_000, 'line 2, column 4'),
    'a long line': ('x,y,z\n1,2,' + '3' * 5_000_000, 'line 2, column 3'),
    'a name twice': ('x,y,z,h,h\n1,2,3,4,5\n', 'line 1, column 5.*h'),
}


@pytest.mark.parametrize('what', BROKEN)
@pytest.mark.parametrize('others', [None, []])
def test_what_is_no_table_is_named_with_its_place(tmp_path, what, others):
    text, match = BROKEN[what]
    refused(rf'poses\.csv, {match}', read_poses, _write(tmp_path, text), others=others)


@pytest.mark.parametrize('kind', ['', 'oak'])
def test_gzip_files_that_end_early_say_from_where(tmp_path, kind):
    rows = np.random.default_rng(2).uniform(size=(9000, 3))
    lines = [','.join(map(str, row)) + f',{kind}' for row in rows.tolist()]
    whole = gzip.compress('\n'.join(['x,y,z,k', *lines]).encode())
    file = tmp_path / 'a.csv.gz'
    file.write_bytes(whole[: len(whole) // 2])
    refused(r'a\.csv\.gz: not.* from line (3|4)\d\d\d on', read_poses, file)


def _npy(shape):
    text = f"{{'descr': '<f8', 'fortran_order': False, 'shape': {shape}, }}"
    text += ' ' * (53 - len(text) % 64) + '\n'
    return b'\x93NUMPY\x01\x00' + len(text).to_bytes(2, 'little') + text.encode() + bytes(96)


@pytest.mark.parametrize('shape', [f'({10**12}, 3)', f'({10**30}, 3)', '(-4, 3)', '(' * 3000])
def test_arrays_that_promise_too_much_are_named(tmp_path, shape):
    file = tmp_path / 'a.npy'
    file.write_bytes(_npy('(4, 3)'))
    assert read_poses(file)[0].shape == (4, 3)
    file.write_bytes(_npy(shape))
    refused(r'a\.npy', read_poses, file)


def test_an_array_of_no_poses_is_an_empty_set(tmp_path):
    np.save(tmp_path / 'a.npy', np.zeros((0, 3)))
    assert read_poses(tmp_path / 'a.npy')[0].shape == (0, 3)


def test_odd_schemas_of_parquet(tmp_path):
    pa = pytest.importorskip('pyarrow')
    parquet = pytest.importorskip('pyarrow.parquet')
    file, one = tmp_path / 'a.parquet', pa.array([1.0, 2.0])
    columns = {'x': pa.array([2**63 - 1, 5]), 'y': one, 'z': one}
    columns['k'] = pa.array(['a', None], pa.string_view())
    columns['s'] = pa.array([{'x': 1}, {'x': 2}])
    parquet.write_table(pa.table(columns), file)
    poses, found = read_poses(file)
    assert poses[0, 0] == 2.0**63
    assert {k: v.tolist() for k, v in found.items()} == {'k': ['a', '']}
    names = ['x', 'x', 'y', 'z']
    parquet.write_table(pa.Table.from_arrays([one] * 4, names=names), file)
    refused(r"a\.parquet: two columns are named 'x'", read_poses, file)


@pytest.mark.parametrize('suffix', ['csv', 'parquet'])
def test_ten_thousand_columns_are_read_in_linear_time(tmp_path, suffix):
    names = ['x', 'y', 'z', *(f'c{k}' for k in range(9997))]
    file = tmp_path / f'a.{suffix}'
    if suffix == 'csv':
        file.write_text(','.join(names) + '\n' + ','.join(map(str, range(10_000))) + '\n')
    else:
        pa = pytest.importorskip('pyarrow')
        parquet = pytest.importorskip('pyarrow.parquet')
        parquet.write_table(pa.table({n: [float(k)] for k, n in enumerate(names)}), file)
    poses, found = read_poses(file)
    assert poses.tolist() == [[0, 1, 2]]
    assert [found[f'c{k}'][0] for k in (0, 5000, 9996)] == [3, 5003, 9999]
