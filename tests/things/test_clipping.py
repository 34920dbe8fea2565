"""Clipping planes cut what shaders make as they cut the same as meshes."""

from __future__ import annotations

import numpy as np
import pytest
import pyvista as pv

import pvibr
from pvibr.core import _vtk
from tests.figures.makers import bending, worm
from tests.makers import plane
from tests.pictures import uncut

pytestmark = pytest.mark.sampled

SIZE = (150, 110)
RNG = np.random.default_rng(8)
PLACES = RNG.uniform(-1.6, 1.6, (8, 3))
SIZES = RNG.uniform(0.4, 0.7, (8, 3))
BALL = pv.Sphere(radius=1.0, theta_resolution=32, phi_resolution=32)
IMAGE = np.full((8, 8, 3), 180, np.uint8)
LOOK = {'color': 'white', 'reset_camera': False}


PLANES = plane((0.2, 0, 0), (-1, 0.3, 0)), plane((0, 0, -0.9), (0.1, 0, 2))


def rods(capping):
    found = []
    for a, b in zip(PLACES, PLACES[::-1], strict=True):
        how = {'direction': b - a, 'height': np.linalg.norm(b - a), 'capping': capping}
        found.append(pv.Cylinder(center=(a + b) / 2, radius=0.3, resolution=32, **how))
    return pv.merge(found)


def balls(sizes):
    return pv.merge([BALL.scale(s).translate(p) for p, s in zip(PLACES, sizes, strict=True)])


KINDS = {
    'spheres': (
        lambda ibr: ibr.add_spheres(PLACES, SIZES[:, 0], **LOOK),
        lambda: balls(SIZES[:, 0]),
    ),
    'ellipsoids': (lambda ibr: ibr.add_ellipsoids(PLACES, SIZES, **LOOK), lambda: balls(SIZES)),
    'flat': (
        lambda ibr: ibr.add_cylinders(PLACES, PLACES[::-1], 0.3, **LOOK),
        lambda: rods(True),
    ),
    'open': (
        lambda ibr: ibr.add_cylinders(PLACES, PLACES[::-1], 0.3, caps=None, **LOOK),
        lambda: rods(False),
    ),
    'cards': (
        lambda ibr: ibr.add_billboards(
            PLACES, IMAGE, size=1.1, facing='world', reset_camera=False
        ),
        lambda: pv.merge([pv.Plane(center=p, i_size=1.1, j_size=1.1) for p in PLACES]),
    ),
}


def stage(add, away=1.0, **how):
    pl = pv.Plotter(off_screen=True, window_size=SIZE, **how)
    thing = add(pl)
    pl.camera_position = [np.array((5.0, -6.0, 4.0)) * away, (0, 0, 0), (0, 0, 1)]
    return pl, thing


def both(kind, away=1.0):
    add, mesh = KINDS[kind]
    smooth = {} if kind == 'cards' else {'split_sharp_edges': True, 'smooth_shading': True}
    look = {'lighting': False, 'color': (180, 180, 180)} if kind == 'cards' else LOOK
    pl, thing = stage(lambda pl: add(pl.ibr), away)
    other, actor = stage(lambda pl: pl.add_mesh(mesh(), **(look | smooth)), away)
    return pl, thing, other, actor


def unlike(pl, other):
    one, two = uncut(pl), uncut(other)
    return (np.abs(one - two).max(2) > 40).mean()


@pytest.mark.parametrize('away', [1.0, 12.0], ids=['near', 'far'])
@pytest.mark.parametrize('kind', KINDS)
def test_cut_as_meshes_are(kind, away):
    pl, thing, other, actor = both(kind, away)
    before = uncut(pl)
    most = unlike(pl, other) + 0.01
    for cut in PLANES:
        thing.mapper.AddClippingPlane(cut)
        actor.mapper.AddClippingPlane(cut)
        assert unlike(pl, other) < most
    cut = uncut(pl)
    assert (cut != before).any(2).sum() > 3
    thing.user_matrix = actor.user_matrix = pv.Transform().rotate_z(40).scale(1.1).matrix
    assert unlike(pl, other) < most
    thing.user_matrix = np.eye(4)
    np.testing.assert_array_equal(uncut(pl), cut)
    thing.mapper.RemoveAllClippingPlanes()
    np.testing.assert_array_equal(uncut(pl), before)


@pytest.mark.parametrize('kind', ['spheres', 'cards'])
def test_planes_that_move_are_followed_and_added_things_stay_cut(kind):
    add = KINDS[kind][0]
    pl, thing = stage(lambda pl: add(pl.ibr))
    other, cut = stage(lambda pl: add(pl.ibr))
    moving = plane((0, 0, 9), (0, 0, -1))
    thing.mapper.AddClippingPlane(moving)
    uncut(pl)
    moving.SetOrigin(0, 0, 0.3)
    cut.mapper.AddClippingPlane(plane((0, 0, 0.3), (0, 0, -1)))
    np.testing.assert_array_equal(uncut(pl), uncut(other))
    wanted = uncut(other)
    pl.ibr.remove(thing)
    pl.ibr.add(thing)
    np.testing.assert_array_equal(uncut(pl), wanted)
    assert thing.mapper.clipping_planes.GetNumberOfItems() == 1
    for actor in thing.picked():
        assert actor.GetMapper().GetClippingPlanes().GetNumberOfItems() == 1


@pytest.mark.parametrize('kind', KINDS)
def test_picked_where_it_is_left(kind):
    pl, thing, other, actor = both(kind)
    for cut in PLANES:
        thing.mapper.AddClippingPlane(cut)
        actor.mapper.AddClippingPlane(cut)
    shown = uncut(other)
    uncut(pl)
    pickers = _vtk.vtkCellPicker(), _vtk.vtkCellPicker()
    found, same = 0, []
    for y, x in np.argwhere((shown != shown[0, 0]).any(2))[::293]:
        x, y = int(x), SIZE[1] - 1 - int(y)
        hit = thing.pick(x, y)
        for picker, scene in zip(pickers, (pl, other), strict=True):
            picker.SetTolerance(0.0)
            picker.Pick(x, y, 0, scene.renderer)
        index = thing.instance_of(pickers[0].GetActor())
        same.append((hit and hit.index) == index)
        if hit is None or pickers[1].GetActor() is None:
            same.append(hit is None and pickers[1].GetActor() is None)
            continue
        found += 1
        same.append(np.abs(np.subtract(hit.point, pickers[1].GetPickPosition())).max() < 0.05)
    assert found > 2
    assert np.mean(same) > 0.9


def test_figures_are_picked_where_they_are_left():
    pl, thing = stage(lambda pl: pl.ibr.add_animated(worm(clips=[bending()])))
    other, actor = stage(lambda pl: pl.add_mesh(thing.mesh()))
    for cut in PLANES[:1]:
        thing.mapper.AddClippingPlane(cut)
        actor.mapper.AddClippingPlane(cut)
    uncut(pl)
    uncut(other)
    picker = _vtk.vtkCellPicker()
    picker.SetTolerance(0.0)
    found = []
    for x, y in np.ndindex(SIZE[0] // 6, SIZE[1] // 6):
        picker.Pick(6 * x, 6 * y, 0, other.renderer)
        hit = thing.pick(6 * x, 6 * y)
        assert (hit is None) == (picker.GetActor() is None)
        if hit is not None:
            found.append(np.abs(np.subtract(hit.point, picker.GetPickPosition())).max())
    assert len(found) > 5
    assert max(found) < 1e-3


def test_shadows_are_of_what_is_left():
    def lit(clips):
        pl = pv.Plotter(off_screen=True, window_size=SIZE, lighting='none')
        pl.add_light(pv.Light(position=(0, 1, 12), light_type='scene light'))
        pl.add_mesh(pv.Plane(i_size=14, j_size=14, center=(0, 0, -3)), color='white')
        pl.ibr.add(pvibr.Shadows(resolution=512))
        pl.camera_position = [(0, -9, -0.5), (0, -1, -3), (0, 0, 1)]
        thing = pl.ibr.add_spheres([[0, 0, 0.0]], 1.5, reset_camera=False)
        before = uncut(pl)
        if clips:
            thing.mapper.AddClippingPlane(plane((0, 0, 0), (1, 0, 0)))
        else:
            pl.remove_actor(thing)
            half = pv.Sphere(radius=1.5, theta_resolution=60, phi_resolution=60)
            pl.add_mesh(half.clip('x', invert=False), reset_camera=False, color='white')
        return before, uncut(pl)

    (before, cut), (_, meshes) = lit(True), lit(False)
    ground = slice(45, None)  # rows below the ball
    assert (np.abs(cut - before)[ground].max(2) > 40).mean() > 0.01
    assert (np.abs(cut - meshes)[ground].max(2) > 40).mean() < 0.01


def test_not_more_planes_than_vtk_has():
    pl = pv.Plotter(off_screen=True)
    thing = pl.ibr.add_spheres(PLACES)
    for k in range(6):
        thing.mapper.AddClippingPlane(plane((0, 0, -k), (0, 0, 1)))
    with pytest.raises(ValueError, match='planes must be at most 6, got 7'):
        thing.mapper.AddClippingPlane(plane((0, 0, -9), (0, 0, 1)))
    assert thing.mapper.clipping_planes.GetNumberOfItems() == 6
