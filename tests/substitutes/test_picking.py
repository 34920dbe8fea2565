"""Picking what impostors and layers stand for, and what they may not stand for."""

import numpy as np
import pytest
import pyvista as pv

from pvibr.core import _vtk
from tests.pictures import place, plotter, shot
from tests.refusals import refused


def make(seed, add):
    rng = np.random.default_rng(seed)
    pl = plotter((120, 90))
    actors = []
    for center in rng.uniform(-1, 1, (12, 3)):
        ball = pv.Sphere(radius=0.4, theta_resolution=12, phi_resolution=10)
        actors.append(pl.add_mesh(ball, color=rng.uniform(0, 0.9, 3)))
        actors[-1].position, actors[-1].scale = center, rng.uniform(0.5, 1.2, 3)
    place(pl, (1, -6, 2))
    standin = add(pl, actors)
    pl.show(auto_close=False)
    shot(pl)
    return pl, actors, standin


ADD = {
    'impostor': lambda pl, a: pl.ibr.add_impostor(a, only_if_faster=False),
    'hierarchy': lambda pl, a: pl.ibr.add_impostor(a, only_if_faster=False, hierarchical=True),
    'layers': lambda pl, a: pl.ibr.add_image_layers([a], only_if_faster=False),
}


@pytest.mark.parametrize('kind', ADD)
@pytest.mark.parametrize('seed', [3, 4])
def test_the_actor_under_a_pixel_is_the_one_that_rays_meet_first(kind, seed):
    pl, actors, _ = make(seed, ADD[kind])
    actors[0].visibility = False
    actors[1].pickable = False
    shot(pl)
    meshes = [a.mapper.dataset.transform(a.GetMatrix(), inplace=False) for a in actors]
    hits = 0
    for x in range(5, 120, 9):
        for y in range(4, 90, 8):
            ends = []
            for depth in (0.0, 1.0):
                pl.renderer.SetDisplayPoint(x, y, depth)
                pl.renderer.DisplayToWorld()
                ends.append(np.array(pl.renderer.GetWorldPoint()[:3]))
            best, which = np.inf, None
            for actor, mesh in zip(actors[2:], meshes[2:], strict=True):
                points, _ = mesh.ray_trace(*ends)
                for away in np.linalg.norm(points - ends[0], axis=1):
                    if away < best:
                        best, which = away, actor
            found = pl.ibr.pick(x, y)
            assert (found and found.actor) is which
            if which is not None:
                hits += 1
                assert found.distance == pytest.approx(best, rel=1e-3)
    assert hits > 10


def test_the_nearest_of_several_things_is_picked():
    pl, actors, _ = make(5, ADD['impostor'])
    trees = pl.ibr.add_instances(pv.Sphere(radius=0.3), [[0.5, -3, 1]], bake=False)
    shot(pl)
    pl.renderer.SetWorldPoint(0.5, -3, 1, 1)
    pl.renderer.WorldToDisplay()
    x, y, _ = pl.renderer.GetDisplayPoint()
    found = pl.ibr.pick(round(x), round(y))
    assert found.actor is None
    assert found.index == 0
    assert len(trees) == 1
    assert actors[0].visibility


@pytest.mark.parametrize('kind', ADD)
def test_a_mapper_of_two_windows_raises(kind):
    first, actors, _ = make(6, lambda *_: None)
    second = plotter((60, 45))
    twins = [pv.Actor(mapper=actor.mapper) for actor in actors[:2]]
    for twin in twins:
        second.add_actor(twin)
    refused('shares its mapper with an actor of another window', ADD[kind], second, twins)
    assert second.ibr.effects == ()
    ADD[kind](first, actors[2:])
    for twin, actor in zip(twins, actors, strict=False):
        twin.mapper = pv.DataSetMapper(actor.mapper.dataset)
    standin = ADD[kind](second, twins)
    second.show(auto_close=False)
    shot(first)
    shot(second)
    if kind != 'layers':
        late = pv.Actor(mapper=actors[5].mapper)
        second.add_actor(late)
        refused('shares its mapper', standin.add, late)
        second.remove_actor(late)
    assert isinstance(twins[0], _vtk.vtkActor)
