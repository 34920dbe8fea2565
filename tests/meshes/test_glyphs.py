"""``mesh.ibr.glyph`` places, chooses and colours as ``mesh.glyph`` does."""

import inspect
import itertools

import numpy as np
import pytest
import pyvista as pv

from pvibr.core.errors import PvibrWarning
from tests.pictures import off, place, plotter, shot
from tests.refusals import refused

pytestmark = pytest.mark.sampled

CONE = pv.Cone(direction=(1.0, 2.0, 3.0), resolution=5)
TABLE = [CONE, pv.Cube()]


def grid(seed):
    """A grid with vectors and numbers on points and on cells."""
    rng = np.random.default_rng(seed)
    made = pv.ImageData(dimensions=(4, 3, 3))
    for data, mark, count in ((made.point_data, '', 36), (made.cell_data, 'c', 12)):
        data[f'{mark}wind'] = rng.normal(size=(count, 3))
        data[f'{mark}speed'] = rng.uniform(-0.5, 1.5, count)
    made.set_active_scalars('speed')
    made.set_active_vectors('wind')
    return made


def glyph_points(glyphs):
    meshes = [glyphs.meshes[k] for k in glyphs.index]
    parts = [m.points @ p[:3, :3].T + p[:3, 3] for m, p in zip(meshes, glyphs.poses, strict=True)]
    return np.concatenate(parts), np.repeat(glyphs.scalars, [m.n_points for m in meshes])


WAYS = [
    *itertools.product((True, False, 'wind'), (True, 'speed', 'wind'), (None,)),
    (False, 'cspeed', None),
    ('cwind', 'cspeed', None),
    ('cwind', 'cwind', None),
    (True, True, 0.3),
]


@pytest.mark.parametrize('way', WAYS)
@pytest.mark.parametrize('geom', [None, CONE, TABLE])
def test_points_and_scalars_are_those_of_pyvista(way, geom):
    kinds = itertools.product((False, True), (None, (-0.2, 1.2)), ('scale', 'scalar', 'vector'))
    for clamping, rng, color_mode in kinds:
        mesh = grid(len(color_mode) + 3)
        how = dict(zip(('orient', 'scale', 'tolerance'), way, strict=True))
        how |= {'geom': geom, 'clamping': clamping, 'rng': rng, 'color_mode': color_mode}
        made, wanted = mesh.ibr.glyph(factor=0.7, **how), mesh.copy().glyph(factor=0.7, **how)
        points, scalars = glyph_points(made)
        np.testing.assert_allclose(points, wanted.points, atol=1e-5, err_msg=str(how))
        if wanted.active_scalars_name is None:  # of a table, by vectors that there are not
            continue
        assert made.scalars.name == wanted.active_scalars_name, how
        shown = np.asarray(wanted.active_scalars)
        shown = shown if shown.ndim == 1 else np.linalg.norm(shown, axis=1)
        np.testing.assert_allclose(scalars, shown, atol=1e-6, err_msg=str(how))


def test_signature_is_that_of_pyvista():
    own = inspect.signature(pv.PolyData().ibr.glyph).parameters
    wanted = inspect.signature(pv.DataSetFilters.glyph).parameters
    assert list(own) == list(wanted)[1:]
    assert all(own[name].default == wanted[name].default for name in own)


@pytest.mark.parametrize('scalars', [None, 'speed', 'heat'])
def test_picture_and_bar_are_those_of_pyvista(scalars):
    mesh, pictures = grid(9), []
    mesh.point_data['heat'] = np.arange(36.0) % 5
    mesh.set_active_scalars('speed')
    for own in (True, False):
        pl = plotter()
        how = {'orient': 'wind', 'scale': 'speed', 'factor': 0.5, 'geom': TABLE}
        if own:
            pl.ibr.add_instances(mesh.ibr.glyph(**how), cmap='plasma', scalars=scalars)
        else:
            wanted, index = mesh.glyph(**how), mesh.ibr.glyph(**how).index
            counts = [TABLE[k].n_points for k in index]
            wanted['heat'] = np.repeat(mesh['heat'], counts)  # of which PyVista's have no copy
            pl.add_mesh(wanted, cmap='plasma', scalars=scalars or 'speed')
        assert list(pl.scalar_bars.keys()) == [scalars or 'speed']
        pictures.append(shot(place(pl, (8.0, -14.0, 7.0), (1.5, 1, 1))))
        pl.close()
    assert (pictures[1] != pictures[1][0, 0]).any(2).mean() > 0.03
    assert (off(*pictures) > 8).mean() < 0.001


def test_it_does_not_change_the_mesh():
    mesh = grid(2)
    before = mesh.copy()
    mesh.ibr.glyph(orient='cwind', scale='cspeed')
    assert mesh == before
    assert mesh.active_scalars_info == before.active_scalars_info
    assert mesh.active_vectors_info == before.active_vectors_info


def test_far_from_the_origin_glyphs_keep_their_shape():
    mesh = grid(4)
    mesh.origin = (4.5e6, 5.5e6, 0.0)
    made = mesh.ibr.glyph('wind', 'speed')
    mesh.origin = (0.0, 0.0, 0.0)
    near = mesh.ibr.glyph('wind', 'speed')
    np.testing.assert_allclose(
        made.poses[:, :3, 3] - near.poses[:, :3, 3], [[4.5e6, 5.5e6, 0]] * 36
    )
    np.testing.assert_array_equal(made.poses[:, :3, :3], near.poses[:, :3, :3])


BAD = [
    ({'progress_bar': True}, ValueError, 'progress_bar must be False'),
    (
        {'color_mode': 'scales'},
        ValueError,
        "color_mode must be one of 'scale', 'scalar'.* got 'scales'",
    ),
    ({'orient': 'wnd'}, ValueError, "orient must .*got 'wnd'; did you mean 'wind'"),
    ({'orient': 'speed'}, ValueError, r"orient must be vectors.*'speed' of shape \(36,\)"),
    ({'scale': 'spee'}, ValueError, "scale must .*got 'spee'; did you mean 'speed'"),
    ({'orient': 'wind', 'scale': 'cspeed'}, ValueError, 'scale and orient'),
    ({'geom': []}, ValueError, 'geom must hold'),
    ({'geom': TABLE, 'indices': [0, 2]}, ValueError, r'indices must .*got \[0, 2\]'),
    ({'rng': (2.0, 1.0)}, ValueError, r'rng must .*got \(2.0, 1.0\)'),
    ({'tolerance': -1.0}, ValueError, 'tolerance must .*got -1.0'),
    ({'clamping': 'no'}, TypeError, "clamping must be .* got 'no'"),
    ({'factor': np.inf}, ValueError, 'factor must be .* got inf'),
    ({'orient': 3}, TypeError, 'orient must be .* got 3'),
]


@pytest.mark.parametrize(('bad', 'kind', 'said'), BAD)
def test_bad_values_are_named(bad, kind, said):
    refused(said, grid(1).ibr.glyph, kind=kind, **bad)


def test_it_says_what_it_did_not_choose():
    mesh = grid(1)
    mesh.set_active_vectors(None)
    with pytest.warns(PvibrWarning, match=r'(?s)orient=False is used.*Name an array'):
        mesh.ibr.glyph()
    refused('combine', pv.MultiBlock([mesh]).ibr.glyph, kind=TypeError)
