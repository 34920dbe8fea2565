"""Poses: shapes, checks, files."""

import gzip

import numpy as np
import pytest
import pyvista as pv
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from pvibr.actors.poses import as_poses, read_poses

finite = st.floats(-1e12, 1e12)


@given(arrays(np.float64, st.tuples(st.integers(0, 20), st.just(3)), elements=finite))
def test_points_stay_points_and_are_not_copied(points):
    poses = as_poses(points)
    assert poses.shape == points.shape
    assert np.shares_memory(poses, points) or not points.size


@given(st.integers(-9, 9), st.booleans())
def test_scales_and_mirroring_pass(exponent, mirrored):
    matrix = np.diag([10.0**exponent] * 3 + [1.0])
    matrix[0] *= -1 if mirrored else 1
    assert as_poses(matrix).shape == (1, 4, 4)


def test_accepted_kinds():
    assert as_poses((1, 2, 3)).shape == (1, 3)
    assert as_poses([]).shape == (0, 3)
    assert as_poses(np.zeros((0, 4, 4))).shape == (0, 4, 4)
    assert as_poses(pv.Sphere()).shape == (842, 3)
    assert as_poses(pv.PointSet(np.ones((5, 3), np.float32))).dtype == np.float64


def test_huge_values_are_not_taken_for_infinite():
    assert len(as_poses(np.full((4, 3), 1e308))) == 4


def _broken(row, value):
    matrices = np.tile(np.eye(4), (3, 1, 1))
    matrices[2][row] = value
    return matrices


@pytest.mark.parametrize(
    ('poses', 'error', 'match'),
    [
        ([[0, 0, 0], [0, np.nan, 0]], ValueError, r'poses\[1\].*finite'),
        ([[0, 0, np.inf]], ValueError, r'poses\[0\].*finite'),
        (_broken(3, 0.5), ValueError, r'poses\[2\].*last row'),
        (_broken(1, [0, 0, 0, 5]), ValueError, r'poses\[2\].*inverse'),
        (_broken(1, [1, 0, 0, 5]), ValueError, r'poses\[2\].*inverse'),
        (np.zeros((4, 2)), ValueError, r'shape \(4, 2\)'),
        (np.zeros((4, 3, 3)), ValueError, r'\(n, 4, 4\)'),
        (5.0, ValueError, 'shape'),
        ('words', TypeError, 'numbers'),
        (None, ValueError, 'shape|finite'),
    ],
)
def test_bad_poses_are_named(poses, error, match):
    with pytest.raises(error, match=match):
        as_poses(poses)


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
        ('x,y,z\n1,2,3\n\n1,oops,3\n', r"line 4, column 2 \('y'\): 'oops'"),
        ('x,y,z\n1,2,nan\n', r"line 2, column 3 \('z'\): 'nan'"),
        ('x,y,z\n1,2,\n', r"line 2, column 3 \('z'\): ''"),
        ('x,y,z\n1,2,3\n1,2\n', 'line 3, column 3: 2 values'),
        ('x,y,z\n1,2,3\n1,2,3,4\n', 'line 3, column 4: 4 values'),
        ('x,y,z,s\n1,2,3,4\n1,2,3,a\n', r"line 3, column 4 \('s'\): 'a' is not a number"),
        ('x,y,kind\n1,2,a\n', "no column 'z'"),
        ('1,2,3\n', "no column 'x'"),
        ('', 'empty'),
        ('x,y,z,qw,qx\n1,2,3,1,0\n', "no column 'qy'"),
        ('x,y,z,qw,qx,qy,qz\n1,2,3,0,0,0,0\n', r'poses.csv: quaternions\[0\]'),
        ('x,y,z,scale\n1,2,3,0\n', 'inverse'),
    ],
)
def test_broken_tables_say_where(tmp_path, text, match):
    with pytest.raises(ValueError, match=match):
        read_poses(_write(tmp_path, text))


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
    with pytest.raises(ValueError, match=r'a\.npy'):
        read_poses(file)
    file.write_bytes(b'')
    with pytest.raises(ValueError, match=r'a\.npy'):
        read_poses(file)
    with pytest.raises(FileNotFoundError):
        read_poses(tmp_path / 'no.csv')


def test_bad_mapping(tmp_path):
    file = _write(tmp_path, 'x,y,z\n1,2,3\n')
    with pytest.raises(ValueError, match='columns is'):
        read_poses(file, columns=('x', 'y'))
    with pytest.raises(ValueError, match="no column 'gx'"):
        read_poses(file, columns=('gx', 'y', None))
