"""A watch tells what changed of actors, and hiding them is no change."""

import numpy as np
import pytest
import pyvista as pv

from pvibr.things.actor_watch import ActorWatch, ineligibility


@pytest.fixture
def watched():
    actors = [pv.Actor(mapper=pv.DataSetMapper(pv.Cube())) for _ in range(3)]
    watch = ActorWatch(actors)
    assert watch.changed() == [0, 1, 2]
    watch.settle()
    assert watch.changed() == []
    return watch


def paint(actor):
    actor.prop.color = 'red'


def move(actor):
    actor.position = (1, 2, 3)


def replace_data(actor):
    actor.mapper.dataset = pv.Sphere()


def change_points(actor):
    actor.mapper.dataset.points *= 2


def hide(actor):
    actor.visibility = False


@pytest.mark.parametrize('change', [paint, move, replace_data, change_points, hide])
def test_changes_are_told_once(watched, change):
    change(watched.actors[1])
    assert watched.changed() == [1]
    watched.settle()
    assert watched.changed() == []


def test_new_data_are_watched(watched):
    replace_data(watched.actors[2])
    watched.changed()
    watched.settle()
    change_points(watched.actors[2])
    assert watched.changed() == [2]


def test_hiding_is_no_change(watched):
    watched.hide([0, 2])
    assert [a.visibility for a in watched.actors] == [False, True, False]
    assert watched.changed() == []
    watched.show()
    assert all(a.visibility for a in watched.actors)
    assert watched.changed() == []


def test_all_are_changed_once_forgotten(watched):
    watched.forget()
    assert watched.changed() == [0, 1, 2]


def lines(actor):
    actor.prop.style = 'wireframe'


def tubes(actor):
    lines(actor)
    actor.prop.render_lines_as_tubes = True


def translucent(actor):
    actor.prop.opacity = 0.5


def broken(actor):
    actor.mapper.dataset.points[0] = np.inf
    actor.mapper.dataset.Modified()
    actor.mapper.dataset.GetPoints().Modified()


def empty(actor):
    actor.mapper.dataset = pv.PolyData()


@pytest.mark.parametrize(
    ('change', 'any_image', 'relit'),
    [
        (paint, '', ''),
        (lines, '', ''),
        (tubes, '', 'tubes or spheres'),
        (translucent, 'translucent', 'translucent'),
        (empty, 'empty', 'empty'),
        (broken, 'bounds that are not finite', 'bounds that are not finite'),
    ],
)
def test_why_an_actor_is_not_replaced(watched, change, any_image, relit):
    actor = watched.actors[0]
    change(actor)
    assert ineligibility(actor) == any_image
    assert ineligibility(actor, relit=True) == relit
