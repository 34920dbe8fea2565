"""Why an instance is drawn as it is: what is told agrees with what is drawn."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from types import SimpleNamespace

import numpy as np
import pytest
import pyvista as pv
from scipy.spatial.transform import Rotation

import pvibr
from pvibr.core import _vtk
from pvibr.instances.cards import FADE
from pvibr.instances.explain import measured_error
from pvibr.things.frame import Frame
from tests.marks import slow

pytestmark = pytest.mark.all_sizes


def placed(count=60, seed=3, *, matrices=True):
    """Return poses at distances of all orders."""
    rng = np.random.default_rng(seed)
    away = rng.normal(size=(count, 3))
    away *= (10 ** rng.uniform(0.2, 2.2, count) / np.linalg.norm(away, axis=1))[:, None]
    if not matrices:
        return away
    poses = np.tile(np.eye(4), (count, 1, 1))
    poses[:, :3, :3] = Rotation.from_quat(rng.normal(size=(count, 4))).as_matrix()
    poses[:, :3, :3] *= rng.uniform(0.5, 2.0, (count, 1, 1))
    poses[:, :3, 3] = away
    return poses


@pytest.fixture
def knots(atlases):
    """A set of knots all around the eye, and its plotter."""
    pl = pv.Plotter(off_screen=True, window_size=(320, 240))
    knot = pv.ParametricTorus(1.0, 0.4, u_res=60, v_res=40)
    things = pl.ibr.add_instances(knot, placed(), bake=True, cache=atlases, progress=False)
    pl.camera_position = [(0, 0, 0), (0, 1, 0), (0, 0, 1)]
    pl.show(auto_close=False)
    yield SimpleNamespace(pl=pl, things=things)
    pl.close()


def drawn(things, index):
    """Return what draws an instance: 'cards', a mesh level, or nothing, and if it is fading."""
    (group,) = things.groups
    slot = int(np.flatnonzero(group.ids == index)[0])
    return int(group.near.level_of[slot])


@pytest.mark.parametrize('parallel', [False, True])
@pytest.mark.parametrize('turn', [0.0, 130.0])
def test_the_level_told_is_the_level_drawn(knots, turn, parallel):
    pl, things = knots.pl, knots.things
    pl.camera_position = [(0, 0, 0), (0, 1, 0), (0, 0, 1)]
    pl.camera.parallel_projection, pl.camera.parallel_scale = parallel, 12.0
    pl.camera.Yaw(turn)
    pl.reset_camera_clipping_range()
    pl.render()
    told = [things.explain(i) for i in range(len(things))]
    seen = [e for e in told if e.level]
    assert 5 < len(seen) < len(told) or parallel
    for e in seen:
        near = drawn(things, e.index)
        span = next(s for s in e.levels if s.name == e.level)
        if e.level.startswith('mesh'):
            assert near == int(e.level[4:] or 0)
        elif span.high * FADE < e.size or e.size < 0.98 * span.high:
            assert near == -1
    for e in told:
        if e.note == 'it is out of view':
            assert drawn(things, e.index) == -1
    pl.camera.parallel_projection = False


def alone(things, pl, index):
    """Return the names of what draws an instance when no other is visible."""
    things.visible = np.arange(len(things)) == index
    pl.render()
    (group,) = things.groups
    names = {f'mesh {level.triangles}': f'mesh{k or ""}' for k, level in enumerate(group.levels)}
    counts = {k: n for k, n in group.counts.items() if n and 'blocks' not in k}
    return {names.get(name, name) for name in counts}


@pytest.mark.parametrize('turntable', [False, True])
@pytest.mark.parametrize('matrices', [False, True])
def test_the_shader_told_is_the_shader_drawn(atlases, matrices, turntable):
    pl = pv.Plotter(off_screen=True, window_size=(320, 240))
    mesh = fir() if turntable else pv.ParametricTorus(1.0, 0.4, u_res=60, v_res=40)
    poses = placed(40, 8, matrices=matrices) * ([1, 1, 0.05] if turntable and not matrices else 1)
    things = pl.ibr.add_instances(mesh, poses, bake=True, cache=atlases, progress=False)
    assert bool(things.limits[0].side_cards) == turntable
    pl.camera_position = [(0, 0, 0), (0, 1, 0), (0, 0, 1)]
    pl.camera.view_angle = 120
    pl.show(auto_close=False)
    told = [e for e in map(things.explain, range(len(things))) if e.level]
    seen = {e.level for e in told}
    assert len(seen) > 2
    for e in told:
        assert e.level in alone(things, pl, e.index), str(e)
    pl.close()


def fir():
    """Return discs of two colours about a stem, as a mesh with foliage's levels."""
    rng = np.random.default_rng(2)
    discs = []
    for normal, height in zip(rng.normal(size=(50, 3)), rng.uniform(0.2, 3, 50), strict=True):
        center = (*rng.normal(size=2) * (3.2 - height) * 0.25, height)
        disc = pv.Disc(center=center, inner=0, outer=0.2, normal=normal, c_res=8).triangulate()
        discs.append(disc)
    mesh = discs[0].append_polydata(*discs[1:])
    return pvibr.foliage_levels(mesh, texels=128, view_size=32, views=12)


def test_levels_follow_one_another_from_nothing_to_any_size(knots):
    for index in range(0, len(knots.things), 7):
        spans = knots.things.explain(index).levels
        assert [s.name for s in spans][-1] == 'mesh'
        assert spans[0].low == 0
        assert spans[-1].high == np.inf
        for one, other in pairwise(spans):
            assert one.high == other.low
            assert one.low <= one.high


def test_each_level_has_a_rule_that_ends_it(knots):
    explanation = knots.things.explain(0)
    rules = {span.name: span.rule for span in explanation.levels}
    assert rules.pop('mesh') == ''
    assert set(rules.values()) <= {'outline', 'colour', 'blur', 'cost', 'size'}
    assert rules['splat'] == 'size' or rules['splat'] in ('outline', 'colour')
    text = str(explanation)
    assert f'patch {explanation.patch}' in text
    assert all(span.name in text for span in explanation.levels)
    assert explanation.as_dict()['levels'][0]['name'] == 'splat'


def test_rules_other_than_errors_are_named(knots):
    things = knots.things
    things.force_level = 'flat'
    assert {s.rule for s in things.explain(0).levels} == {'forced'}
    assert things.explain(0).level in ('flat', '')
    things.force_level = {'flat': (0.0, 1.0), 'mesh': (1e6, 1e7)}
    assert {things.explain(i).level for i in range(len(things))} <= {'flat', ''}
    things.force_level = None
    planes = _vtk.vtkPlaneCollection()
    planes.AddItem(_vtk.vtkPlane())
    things.set_clipping_planes(planes)
    assert {s.rule for s in things.explain(0).levels} == {'clipped'}
    things.set_clipping_planes(None)


def test_what_is_translucent_or_beyond_memory_says_so(knots, atlases):
    things = knots.things
    things.GetProperty().SetOpacity(0.5)
    knots.pl.render()
    assert {s.rule for s in things.explain(0).levels} == {'translucent'}
    things.GetProperty().SetOpacity(1.0)
    knots.pl.render()
    assert 'translucent' not in {s.rule for s in things.explain(0).levels}
    add = knots.pl.ibr.add_instances
    torus = pv.ParametricTorus(1.1, 0.4, u_res=60, v_res=40)  # whose images no one holds
    small = add(torus, placed(3), bake=True, cache=atlases, gpu_memory=0.01, progress=False)
    assert small.explain(0).levels[-1].rule == 'memory'
    assert 'memory' in small.explain(0).note or small.explain(0).note == 'it is out of view'
    small.remove()


def test_levels_are_told_at_the_quality_of_the_frame(knots):
    things = knots.things
    before = things.explain(0)
    view = things.pipeline.view
    coarse = replace(view(), quality=0.5)
    things.pipeline.view = lambda: coarse
    after = things.explain(0)
    del things.pipeline.view
    spans = {span.name: span for span in before.levels}
    assert after.levels[-1].low == pytest.approx(2 * before.levels[-1].low)
    assert [s.rule for s in after.levels] == [spans[s.name].rule for s in after.levels]


def test_what_is_hidden_or_not_baked_says_so(knots):
    things = knots.things
    things.visible = np.arange(len(things)) != 4
    assert things.explain(4).note == 'it is hidden'
    assert things.explain(4).level == ''
    things.visible = np.ones(len(things), bool)
    pl = pv.Plotter(off_screen=True, window_size=(100, 80))
    cones = pl.ibr.add_instances(pv.Cone(), placed(3, matrices=False), bake=False)
    e = cones.explain(-1)
    assert (e.index, e.levels[-1].name, e.levels[-1].rule) == (2, 'mesh', 'not baked')
    assert 'bake is False' in str(e) or e.note == 'it is out of view'
    cones.remove()
    with pytest.raises(RuntimeError, match='in a plotter'):
        cones.explain(0)
    pl.close()


@pytest.mark.parametrize(
    ('bad', 'error'),
    [
        (60, IndexError),
        (-61, IndexError),
        ('first', IndexError),
        (1.5, IndexError),
        ([1, 2], TypeError),
    ],
)
def test_only_an_instance_can_be_explained(knots, bad, error):
    with pytest.raises(error):
        knots.things.explain(bad)


@slow
def test_each_mesh_of_a_set_has_levels_of_its_own(atlases):
    pl = pv.Plotter(off_screen=True, window_size=(320, 240), shape=(1, 2))
    pl.subplot(0, 1)
    meshes = [pv.Sphere(theta_resolution=60, phi_resolution=60), pv.Cube().triangulate()]
    poses = placed(20)
    things = pl.ibr.add_instances(meshes, poses, bake=True, cache=atlases, progress=False)
    pl.show(auto_close=False)
    triangles = [things.explain(i).levels[-1].triangles for i in range(4)]
    assert triangles == [meshes[0].n_cells, 12] * 2
    pl.close()


def test_the_report_tells_the_error_of_what_was_drawn(knots):
    pl, things = knots.pl, knots.things
    told = things.report()
    assert 'FLIP' in told['error 0']
    assert told['triangles of meshes'] > 0
    (group,), (limits,) = things.groups, things.limits
    frame = Frame.of(pl.renderer)
    flip, displaced, blur = measured_error(group, frame, limits)
    assert 0.3 < flip < 1.5
    assert 0 <= displaced < things.max_error + 1.0
    assert 0 <= blur <= 0.3
    things.max_error = 0.25
    pl.render()
    assert measured_error(group, frame, things.limits[0])[0] < flip + 0.05
    things.force_level = 'mesh'
    pl.render()
    assert 'error 0' not in things.report()  # it is the mesh's
    assert things.report()['triangles of meshes'] % group.levels[0].triangles == 0
