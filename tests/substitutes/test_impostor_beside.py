"""Impostors beside what plotters enable, and where their actors go wrong."""

from types import SimpleNamespace

import numpy as np
import pytest
import pyvista as pv

from pvibr.core import _vtk
from tests.pictures import shown

TORUS = pv.ParametricTorus(u_res=120, v_res=60).compute_normals()
BALL = pv.Sphere(theta_resolution=120, phi_resolution=60)


def make(*, images, size=(240, 180), **settings):
    """Return a plotter with two actors in reach of each other, and their impostor."""
    pl = pv.Plotter(off_screen=True, window_size=size)
    actors = [
        pl.add_mesh(BALL.copy(), color='tomato', smooth_shading=True),
        pl.add_mesh(TORUS.copy(), color='gold', smooth_shading=True),
    ]
    actors[0].position = (0.6, 0.2, 0.2)
    pl.camera_position = [(2, -8, 5), (0, 0, 0), (0, 0, 1)]
    impostor = pl.ibr.add_impostor(actors, only_if_faster=False, **settings) if images else None
    return pl, actors, impostor


def pictures(change=lambda pl, actors: None, **settings):
    """Return pictures of the meshes and of impostors, and the latter's report."""
    found = []
    for images in (False, True):
        pl, actors, impostor = make(images=images, **settings)
        change(pl, actors)
        found.append(shown(pl))
    return *found, impostor.report()


def alike(first, second, most=1.0):
    """Tell whether pictures differ by no more than outlines that are less than a pixel off."""
    away = np.abs(first - second)
    return away.mean() < most and (away.max(-1) > 40).mean() < 0.01


def test_beside_volumes_and_translucent_actors():
    grid = pv.ImageData(dimensions=(12, 12, 12), spacing=(0.2,) * 3, origin=(-1.1, -1.1, -1.1))
    grid['v'] = np.linalg.norm(grid.points, axis=1)

    def change(pl, _):
        pl.add_volume(grid, cmap='Blues', opacity=[0.2, 0.0], show_scalar_bar=False)
        pl.add_mesh(pv.Sphere(radius=1.2), color='blue', opacity=0.3)
        pl.camera_position = [(2, -8, 5), (0, 0, 0), (0, 0, 1)]

    mesh, card, told = pictures(change)
    assert told['shown'] == 2
    assert alike(mesh, card)


@pytest.mark.parametrize('size', [(40, 30), (7, 300), (300, 7)])
def test_windows_of_any_shape(size):
    mesh, card, told = pictures(size=size)
    assert np.isfinite(told['error_px'])
    assert mesh.shape == card.shape
    assert np.abs(mesh - card).mean() < 6


def test_a_window_that_shrinks_to_nothing_and_comes_back():
    pl, actors, impostor = make(images=True)
    before = shown(pl)
    pl.window_size = (1, 1)
    pl.render()
    pl.renderer.SetViewport(0, 0, 0, 0)
    pl.render()
    assert [a.visibility for a in actors] == [True, True]
    pl.renderer.SetViewport(0, 0, 1, 1)
    pl.window_size = (240, 180)
    assert alike(before, shown(pl))
    assert impostor.enabled


def test_points_and_places_that_are_not_finite():
    def change(_, actors):
        points = np.array(actors[0].mapper.dataset.points)
        points[:50] = np.nan
        actors[0].mapper.dataset.points = points
        broken = _vtk.vtkMatrix4x4()
        broken.SetElement(0, 0, np.nan)
        actors[1].SetUserMatrix(broken)

    pl, actors, impostor = make(images=True)
    shown(pl)
    change(pl, actors)
    shown(pl)
    assert impostor.enabled
    assert impostor.report()['meshes'].get('bounds that are not finite')
    actors[1].SetUserMatrix(_vtk.vtkMatrix4x4())
    actors[0].mapper.dataset.copy_from(BALL)
    assert alike(shown(pl), shown(make(images=False)[0]))
    assert impostor.report()['meshes'] == {}


@pytest.mark.parametrize('hierarchical', [False, True])
def test_a_group_of_one_that_is_emptied_filled_and_removed(hierarchical):
    pl = pv.Plotter(off_screen=True, window_size=(100, 100))
    actor = pl.add_mesh(BALL.copy(), color='red')
    blank = pl.add_mesh(pv.Plane(center=(0, 3, 0), direction=(0, 1, 0), i_size=9, j_size=9))
    pl.camera_position = 'xz'
    impostor = pl.ibr.add_impostor([actor], hierarchical=hierarchical, only_if_faster=False)
    full = shown(pl)
    actor.mapper.dataset.copy_from(pv.PolyData())
    empty = shown(pl)
    assert impostor.report()['shown'] == 0
    assert impostor.report()['meshes'] == {'empty': 1}
    assert full[50, 50, 0] > full[50, 50, 2]
    assert empty[50, 50, 0] <= empty[50, 50, 2]  # what is behind
    actor.mapper.dataset.copy_from(BALL)
    assert alike(full, shown(pl))
    pl.remove_actor(actor)
    assert np.array_equal(shown(pl), empty)
    assert pl.ibr.effects == ()
    assert blank.visibility


def test_an_actor_that_comes_again_is_a_mesh():
    pl, actors, impostor = make(images=True)
    before = shown(pl)
    pl.remove_actor(actors[0])
    shown(pl)
    assert len(impostor.props) == 1
    pl.add_actor(actors[0], reset_camera=False)
    assert alike(before, shown(pl))
    assert impostor.report()['shown'] == 1
    assert actors[0].visibility


def test_a_frame_that_may_be_coarser_keeps_images_for_longer():
    pl, _, impostor = make(images=True)
    shown(pl)
    drawn = impostor.rendered
    pace = SimpleNamespace(quality=lambda _: 0.1, why='')
    pl.ibr.pipeline._adaptive_quality = pace
    pl.camera.azimuth = 5.0
    pl.render()
    assert impostor.rendered == drawn
    pace.quality = lambda _: 1.0
    pl.render()
    assert impostor.rendered == drawn + 2
