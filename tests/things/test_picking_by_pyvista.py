"""PyVista's own pickers find items as they find the same scene of plain meshes."""

from __future__ import annotations

import warnings

import numpy as np
import pytest
import pyvista as pv

import pvibr
from pvibr.core import _vtk
from tests.pictures import pixel_of, plotter, shot
from tests.test_every_thing import EVERY, PLACES, SIZE, drawn

pytestmark = pytest.mark.sampled

OF_ITEMS = [name for name in EVERY if not EVERY[name].replaces]
PIXELS = [(x, y) for x in range(4, SIZE[0], 11) for y in range(3, SIZE[1], 9)]
#: The stage is two actors, the things or meshes follow.
_STAGE = 2


def picked(pl, pixel, picker, tolerance=0.0):
    """Return actor, mesh and position that one of VTK's pickers finds."""
    if hasattr(picker, 'SetTolerance'):
        picker.SetTolerance(tolerance)
    picker.Pick(*pixel, 0, pl.renderer)
    mesh = picker.GetDataSet()
    actor = picker.GetProp3D() if hasattr(picker, 'GetProp3D') else picker.GetViewProp()
    return actor, None if mesh is None else pv.wrap(mesh), np.array(picker.GetPickPosition())


def index_in(mesh):
    return [] if mesh is None else list(mesh.field_data.get('index', ()))


def number_of(pl, actor):
    """Return the number of the item that a plain mesh stands for, None for none."""
    return next((k - _STAGE for k, own in enumerate(pl.actors.values()) if own is actor), -9)


@pytest.fixture(params=OF_ITEMS)
def both(request):
    pl, thing = drawn(request.param)
    return pl, thing, drawn(request.param, plain=True)[0]


@pytest.mark.parametrize('kind', ['vtkCellPicker', 'vtkHardwarePicker'])
def test_same_item_cell_and_place(both, kind):
    pl, thing, meshes = both
    before, agree, found, right = shot(pl), [], 0, 0
    for pixel in PIXELS:
        actor, mesh, place = picked(pl, pixel, getattr(_vtk, kind)())
        other, _, truth = picked(meshes, pixel, getattr(_vtk, kind)())
        number = number_of(meshes, other)
        if number < 0:
            agree.append(getattr(thing, 'instance_of', lambda _: None)(actor) is None)
            continue
        found += 1
        index = [number] if hasattr(thing, 'instance_of') else None
        agree.append(index is None or index_in(mesh) == index)
        agree[-1] &= index is None or thing.instance_of(actor) == number
        agree[-1] &= bool(np.linalg.norm(place - truth) < 0.15) or not np.isfinite(truth).all()
        right += agree[-1]
    assert found > 2
    assert right >= 0.9 * found
    # The hardware picker takes what is within five pixels, which differs at outlines.
    assert np.mean(agree) > (0.97 if kind == 'vtkCellPicker' else 0.94)
    np.testing.assert_array_equal(shot(pl), before)


def test_meshes_by_a_click(both):
    """By PyVista's callback, and a click that just misses is a hit as it is with meshes."""
    pl, _, meshes = both
    found = {}
    for scene in (pl, meshes):
        seen = found.setdefault(scene is pl, [])
        scene.enable_mesh_picking(seen.append, show=False, show_message=False)
        for pixel in PIXELS[::3]:
            seen.append(pixel)
            scene.iren.interactor.SetEventInformation(*pixel)
            scene.iren.picker.Pick(*pixel, 0, scene.renderer)
        scene.disable_picking()
    hits = [[isinstance(hit, _vtk.vtkPolyData) for hit in found[key]] for key in (True, False)]
    assert sum(hits[0]) > 3
    assert np.mean(np.equal(*hits)) > 0.9


def rectangle(pl, enable, area):
    """Return what a rectangle selects."""
    found = []
    getattr(pl, enable)(found.append, show=False, show_message=False)
    pl.iren.interactor.SetEventInformation(*area[:2])
    pl.iren.picker.AreaPick(*area, pl.renderer)
    pl.disable_picking()
    blocks = found[0] if found and isinstance(found[0], pv.MultiBlock) else found
    return [block for block in blocks if block is not None]


def test_visible_cells_in_a_rectangle(both):
    pl, thing, meshes = both
    area = 10, 5, SIZE[0] - 10, SIZE[1] - 5
    ours, theirs = (rectangle(p, 'enable_rectangle_visible_picking', area) for p in (pl, meshes))
    assert len(ours) == len(theirs)
    if hasattr(thing, 'instance_of'):
        numbers = [int(b.field_data['index'][0]) for b in ours if 'index' in b.field_data]
        assert sorted(numbers) == [0, 1, 2]


def test_items_in_a_rectangle_through_the_scene(both):
    pl, thing, _ = both
    (own,) = [k for k, actor in enumerate(pl.actors.values()) if actor is thing]
    blocks = rectangle(pl, 'enable_rectangle_through_picking', (0, 0, SIZE[0], SIZE[1]))
    items = blocks[own]
    if hasattr(thing, 'instance_of'):
        assert sorted(items['original_cell_ids']) == [0, 1, 2]
        assert np.ptp(items.points - PLACES, axis=0).max() < 1e-5
    else:
        mesh = thing.mesh() if hasattr(thing, 'mesh') else thing.mapper.dataset
        assert items.n_cells == mesh.n_cells


def test_what_is_hidden_or_not_pickable_is_not_found():
    pl = plotter(SIZE)
    balls = pl.ibr.add_spheres([[0.0, 0, 0], [0.0, 5, 0]], 1.0)
    pl.camera_position = [(0, -9, 0), (0, 0, 0), (0, 0, 1)]
    shot(pl)
    middle = SIZE[0] // 2, SIZE[1] // 2

    def index():
        actor, mesh, _ = picked(pl, middle, _vtk.vtkCellPicker())
        return None if mesh is None else balls.instance_of(actor)

    assert index() == 0
    balls.visible = [False, True]
    shot(pl)
    assert index() == 1
    balls.pickable = False
    shot(pl)
    assert index() is None
    balls.pickable, balls.visibility = True, False
    shot(pl)
    assert index() is None
    balls.visibility = True
    shot(pl)
    assert index() == 1
    balls.remove()
    assert index() is None


def test_each_of_several_sets_is_found_as_a_mesh_of_pyvistas():
    """What one set asks the renderer for is no request of the picker to the others."""
    pl = plotter(SIZE)
    points = np.array([[-3.0, 0, 0], [3.0, 0, 0]])
    sets = [
        pl.ibr.add_instances(pv.Cube(), points),
        pl.ibr.add_spheres(points + np.array((0, 0, 2)), 0.6),
        pl.ibr.add_cylinders(points - np.array((0, 0, 2)), points + np.array((0, 1, -2)), 0.4),
    ]
    pl.camera_position = [(0, -14, 0), (0, 0, 0), (0, 0, 1)]
    shot(pl)
    for _ in range(2):
        for thing, height in zip(sets, (0, 2, -2), strict=True):
            for index, point in enumerate(points + np.array((0, -0.3, height))):
                actor, _, _ = picked(pl, pixel_of(pl, point), picker := _vtk.vtkCellPicker())
                assert thing.instance_of(actor) == index
                assert isinstance(picker.GetDataSet(), pv.PolyData)


@pytest.mark.slow
def test_far_instances_are_found_and_too_many_are_told():
    rng = np.random.default_rng(4)
    places = rng.uniform(-1, 1, (1500, 3)) * (4, 4, 0.1)
    pl = plotter(SIZE)
    things = pl.ibr.add_instances(pv.Cube(x_length=0.5, y_length=0.5), places, bake=False)
    pl.camera_position = [(0, 0, 40), (0, 0, 0), (0, 1, 0)]
    shot(pl)
    for index in (3, 700, 1499):
        pixel = pixel_of(pl, places[index] + (0, 0, 0.5))
        assert things.pick(*pixel) is not None
        actor, _, _ = picked(pl, pixel, _vtk.vtkCellPicker())
        assert things.instance_of(actor) == things.pick(*pixel).index
    area = 0, 0, *SIZE
    with pytest.warns(pvibr.PvibrWarning, match='only the nearest 1024 of the 1500 items'):
        rectangle(pl, 'enable_rectangle_visible_picking', area)
    with warnings.catch_warnings():
        warnings.simplefilter('error')
        rectangle(pl, 'enable_rectangle_visible_picking', area)
