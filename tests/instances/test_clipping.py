"""Clipping planes of a handle's mapper cut its instances as those of a mesh cut this."""

from __future__ import annotations

import numpy as np
import pytest
import pyvista as pv

from pvibr.core import _vtk
from tests.makers import plane

CAMERA = [(14, -12, 9), (2, 2, 2), (0, 0, 1)]


def shot(pl):
    pl.render()
    return pl.screenshot().astype(float)


def scene(add):
    pl = pv.Plotter(off_screen=True, window_size=(150, 120))
    handle = add(pl)
    pl.camera_position = CAMERA
    return pl, handle


@pytest.mark.parametrize('bake', [False, True])
def test_planes_come_move_and_go(bake):
    rng = np.random.default_rng(4)
    mesh, places = pv.Sphere(radius=0.7), pv.PolyData(rng.uniform(0, 4, (9, 3)))
    places['size'] = rng.uniform(0.5, 1.5, 9)
    how = {'scale': 'size', 'orient': False}
    pl, things = scene(
        lambda pl: pl.ibr.add_instances(mesh, places, color='w', bake=bake, cache=False, **how)
    )
    meshes = places.glyph(geom=mesh, **how)
    other, actor = scene(lambda pl: pl.add_mesh(meshes, color='w'))
    before = shot(pl)
    cut, second = plane((2.1, 0, 0), (1, 0, 0)), plane((0, 0, 3), (0, 0.6, -0.8))
    for mapper in (things.mapper, actor.mapper):
        mapper.AddClippingPlane(cut)
    assert np.abs(shot(pl) - shot(other)).max() <= 3
    assert np.abs(shot(pl) - before).mean() > 1
    cut.SetOrigin(1.3, 0, 0)
    for mapper in (things.mapper, actor.mapper):
        mapper.AddClippingPlane(second)
    assert np.abs(shot(pl) - shot(other)).max() <= 3
    things.mapper.RemoveAllClippingPlanes()
    np.testing.assert_array_equal(shot(pl), before)
    pl.close()
    other.close()


def test_pickers_of_pyvista_find_what_is_left():
    pl, things = scene(lambda pl: pl.ibr.add_instances(pv.Cube(), [[2.0, 2.0, 2.0]], bake=False))
    shot(pl)
    picker = _vtk.vtkCellPicker()
    picker.SetTolerance(0.0)
    pl.renderer.SetWorldPoint(2, 2, 2, 1.0)
    pl.renderer.WorldToDisplay()
    x, y, _ = pl.renderer.GetDisplayPoint()
    picker.Pick(x, y, 0, pl.renderer)
    assert things.instance_of(picker.GetActor()) == 0
    before = np.array(picker.GetPickPosition())
    away = np.array(CAMERA[0]) - 2.0
    things.mapper.AddClippingPlane(plane((2, 2, 2), -away))
    shot(pl)
    picker.Pick(x, y, 0, pl.renderer)
    assert things.instance_of(picker.GetActor()) == 0  # its back, from inside
    behind = np.array(picker.GetPickPosition())
    np.testing.assert_allclose(things.pick(x, y).point, behind, atol=1e-4)
    assert away @ (before - 2) > 0.1
    assert away @ (behind - 2) < 1e-6
    things.mapper.AddClippingPlane(plane((2, 2, 0), (0, 0, -1)))
    shot(pl)
    picker.Pick(x, y, 0, pl.renderer)
    assert picker.GetActor() is None
    assert things.pick(x, y) is None


def test_widgets_say_what_to_do():
    pl = pv.Plotter(off_screen=True)
    balls = pl.ibr.add_spheres([[0.0, 0, 0]])
    with pytest.raises(TypeError, match=r'Spheres is not one.*add_plane_widget'):
        pl.add_mesh_clip_plane(balls)
    assert pl.add_mesh_clip_plane(pv.Sphere()) is not None
    pl.close()
