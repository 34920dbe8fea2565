"""An inspection tells the truth about a frame, and leaves nothing behind."""

from itertools import pairwise
from types import SimpleNamespace

import numpy as np
import pytest
import pyvista as pv
from vtkmodules.vtkRenderingCore import vtkTextActor

import pvibr
from pvibr.core.errors import ClosedError
from pvibr.inspection.atlas_tiles import FLASH, as_bytes, used_views
from pvibr.inspection.inspection import LEVELS, level_counts
from pvibr.inspection.marks import edges, outlines, projected
from pvibr.instances.cards import FADE
from pvibr.maths.octahedral import view_directions
from tests.pictures import pixel_of
from tests.refusals import refused

SIZE = (320, 240)
ENDS = {'splat': 6.0, 'flat': 12.0, 'parallax': 24.0, 'blended': 48.0, 'fine': 48.0}  # pixels
LEFT = {'levels': False, 'cells': False, 'atlas': False, 'table': False}
TORUS = pv.ParametricTorus(u_res=40, v_res=20).compute_normals()


@pytest.fixture(scope='module')
def atlases(tmp_path_factory):
    return tmp_path_factory.mktemp('atlases')


@pytest.fixture
def empty():
    """Return a function that makes plotters without multisampling."""
    return lambda **kwargs: pv.Plotter(**{'window_size': SIZE} | kwargs)


@pytest.fixture
def row(empty, atlases):
    """Return a function that makes a plotter with cubes in a row, each of another level."""

    def make(pl=None, **kwargs):
        pl = empty() if pl is None else pl
        away = np.array([5.0, 9, 18, 38, 80])
        across = np.array([-0.7, -0.35, 0, 0.35, 0.7]) * np.tan(np.pi / 6) * SIZE[0] / SIZE[1]
        points = np.stack([across * away, np.zeros(5), -away], 1)
        cubes = pl.ibr.add_instances(
            pv.Cube(),
            points,
            cache=atlases,
            bake=True,
            lighting=False,
            **{'color': 'tan'} | kwargs,
        )
        spans = dict(zip(ENDS, pairwise([0.0, *ENDS.values()]), strict=True))
        cubes.force_level = {**spans, 'mesh': (ENDS['blended'], 1e9)}
        pl.camera_position = [(0, 0, 0), (0, 0, -1), (0, 1, 0)]
        pl.camera.view_angle = 60
        pl.camera.clipping_range = (0.1, 200)
        return pl, cubes, points

    return make


def see(pl):
    """Return the pixels of a new frame, top row first."""
    if not pl.render_window.GetNeverRendered():
        pl.render()
    else:
        pl.show(auto_close=False)
        pl.render()
    return pl.screenshot(None, return_img=True).astype(int)


def at(pl, picture, point):
    """Return the colour at a place in the world, 0 to 1."""
    x, y = pixel_of(pl, point)
    return picture[picture.shape[0] - 1 - y, x] / 255


def said(group, cubes, frame_scale):
    """Return the level that a group draws each instance by, from what it chose."""
    out = {}
    for slot, number in enumerate(group.ids.tolist()):
        size = 2 * group.radii[slot] * frame_scale / np.linalg.norm(group.centers([slot])[0])
        # These are the same in all directions.
        ends = {name: layer.ranges[0, :2] for name, layer in group.cards.layers.items()}
        fits = [name for name, (low, high) in ends.items() if FADE * low <= size < high]
        out[number] = 'mesh' if group.near.level_of[slot] >= 0 else fits[0]
    assert len(out) == len(cubes)
    return [out[k] for k in range(len(cubes))]


LOOKS = [
    {},
    {'colors': np.full((5, 3), 90)},
    {'scalars': np.arange(5.0)},
    {'colors': np.full((5, 3), 90), 'blend': 'multiply'},
]


@pytest.mark.parametrize('how', LOOKS, ids=['plain', 'colors', 'scalars', 'multiply'])
def test_instances_have_the_colours_of_their_levels(row, how):
    pl, cubes, points = row(show_scalar_bar=False, **how)
    plain = see(pl)
    view = pl.ibr.inspect(cells=False, atlas=False, table=False)
    picture = see(pl)
    scale = SIZE[1] / 2 / np.tan(np.pi / 6)
    names = said(cubes.groups[0], cubes, scale)
    assert names == ['mesh', 'blended', 'parallax', 'flat', 'splat']
    for name, point in zip(names, points, strict=True):
        # A dot has the share of its pixels that the cube covers.
        assert np.abs(at(pl, picture, point) - LEVELS[name]).max() < (
            0.15 if name == 'splat' else 0.01
        )
    counts = view.report()['levels']
    assert counts == level_counts(cubes.groups)
    assert {n for n, c in counts.items() if c} == set(names)
    view.remove()
    assert np.array_equal(see(pl), plain)


def test_what_is_hidden_stays_hidden(row):
    pl, cubes, points = row()
    cubes.update([0, 2], visible=False)
    pl.ibr.inspect(cells=False, atlas=False, table=False)
    picture = see(pl)
    background = np.array(pl.background_color.float_rgb)
    for k in (0, 2):
        assert np.abs(at(pl, picture, points[k]) - background).max() < 0.01
    assert np.abs(at(pl, picture, points[1]) - LEVELS['blended']).max() < 0.01


def test_every_switch_is_off_to_the_bit(row):
    pl, *_ = row()
    plain = see(pl)
    view = pl.ibr.inspect(**LEFT)
    assert np.array_equal(see(pl), plain)
    for name in LEFT:
        setattr(view, name, True)
        assert not np.array_equal(see(pl), plain), name
        setattr(view, name, False)
        assert np.array_equal(see(pl), plain), name
    view.levels = view.cells = view.atlas = view.table = True
    view.enabled = False
    assert np.array_equal(see(pl), plain)


def test_it_is_a_switch(row):
    pl, *_ = row()
    props = list(pl.renderer.GetViewProps())
    view = pl.ibr.inspect()
    assert view in pl.ibr.effects
    assert pl.ibr.inspect() is None
    again = pl.ibr.inspect(True, atlas=False)
    assert not again.atlas
    other = pl.ibr.inspect(True, levels=False)
    assert [e for e in pl.ibr.effects if e.name == 'Inspection'] == [other]
    assert pl.ibr.inspect(False) is None
    assert pl.ibr.inspect(False) is None
    other.remove()  # again is fine
    assert {id(p) for p in pl.renderer.GetViewProps()} == {id(p) for p in props}


@pytest.mark.parametrize('how', [{'on': 'yes'}, {'atlas': 'trees'}, {'levels': 3}])
def test_bad_input_changes_nothing(row, how):
    pl, *_ = row()
    view = pl.ibr.inspect()
    refused(next(iter(how)), pl.ibr.inspect, kind=TypeError, **{'on': True} | how)
    assert view in pl.ibr.effects


def test_a_closed_plotter_says_so(row):
    pl, *_ = row()
    pl.ibr.inspect()
    see(pl)
    pl.close()
    refused('closed', pl.ibr.inspect, kind=ClosedError)


@pytest.mark.parametrize('number', [0, 2])
def test_the_instance_under_the_pointer_is_explained(row, number):
    pl, cubes, points = row()
    view = pl.ibr.inspect()
    see(pl)
    x, y = pixel_of(pl, points[number])
    pl.iren.interactor.SetEventInformation(x, y, 0, 0)
    pl.iren.interactor.InvokeEvent('MouseMoveEvent')
    pl.render()
    told = cubes.explain(number)
    words = [actor.GetInput() or '' for actor in view.props if isinstance(actor, vtkTextActor)]
    assert any(text.startswith(f'instance {number} ') for text in words)
    assert any(text.startswith('patch') and text.endswith(str(told.patch)) for text in words)
    assert sum(text.endswith(' forced') for text in words) >= 5
    assert not view.point_at(x, y)  # still the same one
    assert view.point_at(2, 2)
    pl.render()
    assert not any(row[0].startswith('instance') for row in view._text_rows)
    view.remove()
    pl.iren.interactor.InvokeEvent('MouseMoveEvent')


def test_alone_it_leaves_no_observer(empty):
    pl = empty()
    pl.add_mesh(pv.Sphere())
    plain = see(pl)
    view = pl.ibr.inspect()
    assert not np.array_equal(see(pl), plain)
    view.remove()
    assert not pl.renderer.HasObserver('StartEvent')
    assert np.array_equal(see(pl), plain)


def test_cleared_with_the_plotter(row):
    pl, *_ = row()
    pl.ibr.inspect()
    see(pl)
    pl.clear()
    see(pl)
    assert pl.ibr.effects == ()


def test_a_subplot_keeps_to_itself(empty, row):
    pl = empty(shape=(1, 2), window_size=(2 * SIZE[0], SIZE[1]))
    row(pl)
    pl.subplot(0, 1)
    pl.add_mesh(pv.Sphere(), color='red')
    plain = see(pl)
    pl.subplot(0, 0)
    pl.ibr.inspect()
    picture = see(pl)
    middle = picture.shape[1] // 2
    assert np.array_equal(picture[:, middle + 2 :], plain[:, middle + 2 :])
    assert not np.array_equal(picture[:, :middle], plain[:, :middle])


def test_effects_on_pictures_leave_it_alone(row):
    pl, *_ = row()
    plain = see(pl)
    pl.ibr.inspect(levels=False, cells=False, table=False)
    picture = see(pl)
    vignette = pl.ibr.add(pvibr.Vignette())
    corner = (slice(-70, -16), slice(-70, -16))  # of the images, where it is dark
    assert np.array_equal(see(pl)[corner], picture[corner])
    assert not np.array_equal(picture[corner], plain[corner])
    pl.ibr.inspect(False)
    pl.ibr.remove(vignette)
    assert np.array_equal(see(pl), plain)


def test_cells_follow_the_camera(row):
    pl, *_ = row()
    view = pl.ibr.inspect(levels=False, atlas=False, table=False)
    see(pl)
    assert view.report()['cells'] == (1, 1)
    pl.camera.focal_point = (0, 0, 1)
    see(pl)
    assert view.report()['cells'] == (0, 1)


def test_cells_hold_their_instances(empty, atlases):
    rng = np.random.default_rng(2)
    pl = empty()
    cubes = pl.ibr.add_instances(pv.Cube(), rng.uniform(-9, 9, (200, 3)), cache=atlases, bake=True)
    view = pl.ibr.inspect()
    see(pl)
    group = cubes.groups[0]
    low, high, _ = view._cells(group, (0, 0, 0))
    centers = group.centers(np.arange(200))
    for k in range(4):
        mine = centers[64 * k : 64 * k + 64]
        assert (mine >= low[k]).all()
        assert (mine <= high[k]).all()
        # And no more than a sphere's radius around.
        assert np.allclose(mine.min(0) - low[k], group.radii[0], atol=1e-4)
    assert view.report()['cells'][1] == 4


@pytest.mark.parametrize('parallel', [False, True])
@pytest.mark.parametrize('move', [0.0, 1e6])
def test_lines_are_where_vtk_draws(empty, parallel, move):
    pl = empty()
    pl.camera_position = [(move + 3, -7, 5), (move, 0, 0), (0, 0, 1)]
    pl.camera.parallel_projection = parallel
    pl.show(auto_close=False)
    frame = pvibr.things.frame.Frame.of(pl.renderer)
    low = np.array([[move - 1, -1.0, -0.5]])
    lines, kept = projected(frame, edges(low, low + 1).reshape(-1, 2, 3))
    assert len(lines) == len(kept) == 12
    width, height = SIZE
    for line, ends in zip(lines, edges(low, low + 1)[0][kept], strict=True):
        found = []
        for point in ends:
            pl.renderer.SetWorldPoint(*point, 1)
            pl.renderer.WorldToDisplay()
            found.append(np.array(pl.renderer.GetDisplayPoint()[:2]) / (width, height))
        assert min(np.abs(line - found).max(), np.abs(line[::-1] - found).max()) < 1e-3


def test_lines_past_the_eye_are_cut(empty):
    pl = empty()
    pl.camera_position = [(0, 0, 0), (0, 0, -1), (0, 1, 0)]
    pl.show(auto_close=False)
    frame = pvibr.things.frame.Frame.of(pl.renderer)
    through = np.array([[[0.0, -1, 5], [0, -1, -20]], [[0, 0, 3], [0, 0, 9]]])
    lines, kept = projected(frame, through)
    assert kept.tolist() == [0]
    assert np.isfinite(lines).all()
    far = 0.5 - 1 / 20 * frame.clip_from_view[1, 1] / 2
    assert np.abs(lines[0] - (0.5, far)).max(1).min() < 1e-9  # the end that is ahead
    assert lines[0, :, 1].min() < 0  # the other leaves below


def test_outlines_go_around():
    lines = outlines(np.array([[0.0, 1]]), np.array([[2.0, 4]]))
    assert np.allclose(np.linalg.norm(lines[:, 1] - lines[:, 0], axis=1), [2, 3, 2, 3])
    assert np.allclose(lines[:, 1], np.roll(lines[:, 0], -1, 0))


@pytest.mark.parametrize('level', ['blended', 'parallax'])
@pytest.mark.parametrize('turned', [False, True])
def test_tiles_in_use_are_the_nearest_views(empty, atlases, level, turned):
    pl = empty()
    pose = np.eye(4)[None].copy()
    pose[0, :3, :3] = pv.transform.Transform().rotate_z(50).rotate_x(20).matrix[:3, :3]
    cubes = pl.ibr.add_instances(
        pv.Cube(), pose if turned else [[0, 0, 0]], cache=atlases, bake=True
    )
    pl.camera_position = [(3, -9, 7), (0, 0, 0), (0, 0, 1)]
    group = cubes.groups[0]
    cubes.force_level = level
    see(pl)
    found = used_views(group, pvibr.things.frame.Frame.of(pl.renderer))
    toward = (pose[0, :3, :3].T if turned else np.eye(3)) @ np.array([3, -9, 7.0])
    views = group.atlas.views
    match = (view_directions(views, group.atlas.half) @ toward).reshape(views, views)
    best = np.array(np.unravel_index(match.argmax(), match.shape))
    assert len(found) == (3 if level == 'blended' else 1)
    assert (found[:, ::-1] == best).all(1).any()


@pytest.fixture
def rings(empty):
    """Return a plotter with heavy actors and their impostor."""
    pl = empty()
    actors = []
    for k in range(4):
        actors.append(pl.add_mesh(TORUS, color='tan'))
        actors[-1].position = (3.5 * k, 0, 0)
    pl.camera_position = [(5, -30, 9), (5, 0, 0), (0, 0, 1)]
    impostor = pl.ibr.add_impostor(actors, only_if_faster=False)
    return SimpleNamespace(pl=pl, impostor=impostor, actors=actors)


def flashes(shapes):
    """Return whether any mark has the colour of new images."""
    table = shapes.mapper.GetInput().GetCellData().GetScalars()
    colors = np.array([table.GetTuple(k) for k in range(table.GetNumberOfTuples())])
    return bool(len(colors)) and bool((colors[:, :3] == as_bytes(FLASH)).all(1).any())


def test_new_images_flash_once(rings):
    view = rings.pl.ibr.inspect()
    rings.pl.show(auto_close=False)
    see(rings.pl)
    again = rings.pl.ibr.inspect(True)
    see(rings.pl)
    assert view.pipeline is None
    view, told = again, again.report()
    assert told['images'] == 4
    assert told['new_images'] == 0
    assert not flashes(view._marks.boxes)
    assert not flashes(view._marks.tiles)
    rings.actors[1].prop.color = 'red'
    see(rings.pl)
    assert view.report()['new_images'] == 1
    assert flashes(view._marks.boxes)
    assert flashes(view._marks.tiles)
    rings.pl.ibr.remove(rings.impostor)
    see(rings.pl)
    assert view.report()['images'] == 0


def test_the_pool_is_shown(rings):
    pl = rings.pl
    pl.background_color = 'white'
    see(pl)
    pl.ibr.inspect(levels=False, cells=False, table=False, atlas=rings.impostor)
    picture = see(pl)
    corner = picture[-80:-10, -80:-10]
    tan = np.array(pv.Color('tan').int_rgb)
    assert (corner == 0).all(2).mean() > 0.3  # what is free
    hues = corner / np.maximum(corner.sum(2, keepdims=True), 1)
    lit = corner.sum(2) > 100
    assert (np.abs(hues - tan / tan.sum()).max(2)[lit] < 0.05).any()


def test_colours_are_not_kept_in_images(empty, atlases):
    """What an impostor takes of instances while they are coloured has their own colours."""
    pictures = []
    for inspected in (False, True):
        pl = empty()
        cubes = pl.ibr.add_instances(
            TORUS,
            3.2 * np.indices((3, 4, 1)).reshape(3, -1).T,
            color='tan',
            cache=atlases,
            bake=True,
        )
        pl.camera_position = [(3, -40, 14), (3, 5, 0), (0, 0, 1)]
        pl.ibr.add_impostor(cubes, hierarchical=True, only_if_faster=False)
        if inspected:
            pl.ibr.inspect()
            see(pl)
            pl.ibr.inspect(False)
        see(pl)
        pictures.append(see(pl))
        pl.close()
    assert np.array_equal(*pictures)


def test_words_in_large_pictures_are_as_large(row):
    pl, *_ = row()
    pl.ibr.inspect(levels=False, cells=False, atlas=False)
    small = see(pl)
    large = pl.ibr.screenshot(scale=2).astype(int)
    panel = (slice(0, 50), slice(0, 150))
    reduced = large.reshape(SIZE[1], 2, SIZE[0], 2, 3).mean((1, 3))
    assert np.abs(reduced[panel] - small[panel]).mean() < 25
    assert (small[panel] > 200).all(2).any()  # there are words
    assert (reduced[panel] > 200).all(2).any()


@pytest.mark.parametrize('size', [(40, 30), (90, 700)])
def test_windows_of_any_size(row, size):
    pl, *_ = row()
    pl.ibr.inspect()
    see(pl)
    pl.window_size = size
    picture = see(pl)
    assert picture.shape[:2] == size[::-1]


def test_milliseconds_are_those_of_the_last_frame(row):
    pl, *_ = row()
    view = pl.ibr.inspect(atlas=False)
    see(pl)
    lines = [actor.GetInput() for actor in view._marks.words.actors if actor.GetVisibility()]
    names = [line.split()[0] for line in lines]
    assert names[-2:] == ['Instances', 'Inspection']
    assert all(float(line.split()[-1]) > 0 for line in lines[-1:])
