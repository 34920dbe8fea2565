"""Poses of vectors, rotations, tables and transforms: as PyVista's own glyphs place them."""

import numpy as np
import pyarrow as pa
import pytest
import pyvista as pv
from scipy.spatial.transform import Rotation

import pvibr
from pvibr.core.errors import PvibrWarning
from tests.pictures import off, place, plotter, shot
from tests.refusals import refused

CONE = pv.Cone(direction=(1.0, 2.0, 3.0), resolution=5)  # no two rotations of it look alike


@pytest.fixture(params=[3, 5])
def points(request):
    """Points with vectors, some of them along x or of length 0, and with numbers."""
    rng = np.random.default_rng(request.param)
    made = pv.PolyData(rng.uniform(-2, 2, (40, 3)))
    made['wind'] = rng.normal(size=(40, 3))
    made['wind'][:4] = [[2, 0, 0], [-2, 0, 0], [0, 0, 0], [-1, 1e-9, 0]]
    made['speed'] = rng.uniform(-0.2, 0.6, 40)
    made['speed'][5] = 0.0
    return made


def placed(poses, mesh=CONE):
    """The points of a mesh at all of the poses."""
    return (poses[:, :3, :3] @ mesh.points.T).swapaxes(1, 2) + poses[:, None, :3, 3]


HOW = [
    {'orient': 'wind', 'scale': False},
    {'orient': 'wind', 'scale': 'speed', 'factor': 0.7},
    {'orient': False, 'scale': 'speed', 'factor': -2.0},
    {'orient': 'wind', 'scale': 'wind', 'factor': 0.3},
]


@pytest.mark.parametrize('how', HOW)
def test_instances_are_where_the_glyphs_are(points, how):
    expected = points.glyph(geom=CONE, **how).points.reshape(40, -1, 3)
    np.testing.assert_allclose(placed(pvibr.matrices(points, **how)), expected, atol=2e-6)
    arrays = how | {k: np.array(points[how[k]]) for k in ('orient', 'scale') if how[k]}
    np.testing.assert_array_equal(
        pvibr.matrices(points.points, **arrays), pvibr.matrices(points, **how)
    )


def test_pictures_are_those_of_the_glyphs(points):
    pictures = []
    for own in (True, False):
        pl = plotter()
        if own:
            pl.ibr.add_instances(
                CONE, points, orient='wind', scale='speed', factor=0.8, scalars='speed'
            )
        else:
            pl.add_mesh(
                points.glyph(orient='wind', scale='speed', factor=0.8, geom=CONE), scalars='speed'
            )
        assert list(pl.scalar_bars.keys()) == ['speed']
        pictures.append(shot(place(pl, (6.0, -9.0, 5.0))))
        pl.close()
    assert (pictures[1] != pictures[1][0, 0]).any(2).mean() > 0.03
    assert (off(*pictures) > 8).mean() < 0.001


def test_vectors_of_a_dataset_turn_unless_not(points):
    wanted = pvibr.matrices(points, orient='wind')
    np.testing.assert_array_equal(pvibr.matrices(points), wanted)
    assert pvibr.matrices(points, orient=False)[:, :3, :3].tolist() == [np.eye(3).tolist()] * 40
    points.point_data.active_normals = points['wind'] * 0 + [0, 0, 1]  # normals are no vectors
    np.testing.assert_array_equal(pvibr.matrices(points), wanted)
    points['other'] = points['wind'][::-1]
    with pytest.warns(PvibrWarning, match=r"\['wind', 'other'\].*orient='wind'"):
        pvibr.matrices(points)
    points.set_active_vectors('wind')
    np.testing.assert_array_equal(pvibr.matrices(points), wanted)


def test_poses_that_are_set_later_turn_as_the_first(points):
    pl = pv.Plotter(off_screen=True)
    things = pl.ibr.add_instances(CONE, points, orient='wind', scale='speed', factor=2.0)
    before = things.poses.copy()
    later = points.copy()
    later['wind'] = points['wind'][::-1]
    things.poses = later
    wanted = pvibr.matrices(later, orient='wind', scale='speed', factor=2.0)
    np.testing.assert_array_equal(things.poses, wanted)
    things.poses = before  # matrices are as they are
    np.testing.assert_array_equal(things.poses, before)


def test_rotations_quaternions_and_matrices_are_one():
    rng = np.random.default_rng(8)
    spins, at = Rotation.random(7, random_state=1), rng.normal(size=(7, 3))
    x, y, z, w = spins.as_quat().T
    wanted = np.tile(np.eye(4), (7, 1, 1))
    wanted[:, :3, :3], wanted[:, :3, 3] = spins.as_matrix(), at
    for orient in (spins, np.stack([w, x, y, z], 1), spins.as_matrix()):
        np.testing.assert_allclose(pvibr.matrices(at, orient=orient), wanted, atol=1e-12)
    one = pvibr.matrices(at, orient=spins[0])
    np.testing.assert_allclose(one[:, :3, :3], np.tile(wanted[0, :3, :3], (7, 1, 1)), atol=1e-12)
    moves = [pv.Transform().rotate(spins[k]).translate(at[k]) for k in range(7)]
    np.testing.assert_allclose(pvibr.matrices(moves), wanted, atol=1e-12)
    np.testing.assert_allclose(pvibr.matrices(moves[2]), wanted[2:3], atol=1e-12)
    refused('must have positions', pvibr.matrices, spins, kind=TypeError)


class Frame(dict):
    """A DataFrame as pandas and polars have it: names of columns, and columns by name."""

    @property
    def columns(self):
        return list(self)


class Stream:
    """What can only be read as a stream of Arrow."""

    def __init__(self, table):
        self._table = table

    def __arrow_c_stream__(self, schema=None):
        return self._table.__arrow_c_stream__(schema)


TABLES = {
    'frame': Frame,
    'dict': dict,
    'arrow': pa.table,
    'stream': lambda columns: Stream(pa.table(columns)),
    'structured': lambda columns: np.rec.fromarrays(
        list(columns.values()), names=','.join(columns)
    ),
}


@pytest.mark.parametrize('kind', TABLES)
def test_tables_are_points_with_columns(kind, tmp_path):
    rng = np.random.default_rng(11)
    columns = dict(zip('xyz', rng.normal(size=(3, 6)), strict=True))
    columns |= {'size': rng.uniform(1, 2, 6), 'u': rng.normal(size=6), 'v': rng.normal(size=6)}
    columns['kind'] = np.array(['oak', 'elm', 'ash'] * 2)
    table = TABLES[kind](columns)
    at = np.stack([columns[c] for c in 'xyz'], 1)
    wanted = pvibr.matrices(
        at, np.stack([columns['u'], columns['v'], columns['size']], 1), columns['size']
    )
    found = pvibr.matrices(table, orient=('u', 'v', 'size'), scale='size')
    np.testing.assert_allclose(found, wanted)
    pl = pv.Plotter(off_screen=True)
    things = pl.ibr.add_instances(CONE, table, scalars='size')
    np.testing.assert_array_equal(things.poses, at)
    np.testing.assert_array_equal(things.scalars, columns['size'])
    things = pl.ibr.add_instances(CONE, table, scalars='kind')
    np.testing.assert_array_equal(things.scalars, columns['kind'])
    refused("'sise'", pvibr.matrices, table, scale='sise')
    bare = TABLES[kind]({'east': at[:, 0], 'north': at[:, 1], 'up': at[:, 2]})
    np.testing.assert_array_equal(pvibr.matrices(bare)[:, :3, 3], at)


def test_quaternions_of_a_table_are_w_first():
    spin = Rotation.from_euler('xyz', [0.3, 0.5, -0.2])
    x, y, z, w = spin.as_quat()
    table = {'x': [1.0], 'y': [2.0], 'z': [3.0], 'qw': [w], 'qx': [x], 'qy': [y], 'qz': [z]}
    table['scale'] = [2.0]
    poses = pvibr.matrices(table)
    np.testing.assert_allclose(poses[0, :3, :3], 2 * spin.as_matrix())
    np.testing.assert_allclose(pvibr.matrices(table, scale='scale'), poses)


BAD = [
    ({'orient': 'wnd'}, ValueError, "orient must .*got 'wnd'; did you mean 'wind'"),
    ({'orient': np.ones((3, 3, 3))}, ValueError, r'orient must be .*got shape \(3, 3, 3\)'),
    ({'orient': [[1.0, np.nan, 0]]}, ValueError, r'orient\[0, 1\] must be finite, got nan'),
    ({'orient': np.zeros((40, 4))}, ValueError, r'orient\[0\] must be a quaternion.*length 0'),
    ({'orient': 'speed'}, ValueError, r'orient must be .*got shape \(40,\)'),
    ({'orient': object()}, TypeError, 'orient must be numbers'),
    ({'orient': [[1.0, 0, 0], [1.0]]}, TypeError, 'orient must be numbers'),
    ({'scale': 'sped'}, ValueError, "scale must .*got 'sped'; did you mean 'speed'"),
    ({'scale': [1.0, 2.0]}, ValueError, r'scale must be .*got shape \(2,\)'),
    ({'scale': np.inf}, ValueError, r'scale must .*got inf'),
    ({'scale': ['x', 'y']}, TypeError, 'scale must be numbers'),
    ({'factor': 'big'}, TypeError, r"factor must .*got 'big'"),
    ({'scale': 1e300}, ValueError, 'scale must be at most'),
    ({'factor': 1e300}, ValueError, r'factor must .*got 1e'),
    ({'factor': np.nan}, ValueError, r'factor must .*got nan'),
    ({'factor': [1.0, 2.0]}, ValueError, 'factor must'),
]


@pytest.mark.parametrize(('bad', 'kind', 'said'), BAD)
def test_bad_values_are_named_and_leave_nothing_behind(points, bad, kind, said):
    pl = pv.Plotter(off_screen=True)
    pl.ibr.add_instances(CONE, points, name='it')
    before = list(pl.actors.items())
    refused(said, pl.ibr.add_instances, CONE, points, kind=kind, name='it', **bad)
    assert list(pl.actors.items()) == before
