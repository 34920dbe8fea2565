"""Arguments of impostors: actors and instances."""

from __future__ import annotations

from pvibr.core import _vtk
from pvibr.instances.instances import Instances
from pvibr.things.casters import listed
from pvibr.things.thing import Thing


def checked_members(actors) -> list:
    """Return actors and instances as a checked list."""
    things = listed(actors)
    for thing in things:
        if not is_actor(thing) and type(thing) is not Instances:
            raise TypeError(
                'actors must be actors (from add_mesh) or Instances (from add_instances), '
                f'got {type(thing).__name__}'
            )
    if not things:
        raise ValueError('actors must have one or more, got none')
    known_ids: set = set()
    for index, thing in enumerate(things):
        if id(thing) in known_ids:
            raise ValueError(f'actors must not repeat, got actors[{index}] twice')
        known_ids.add(id(thing))
    return things


def is_actor(thing) -> bool:
    """Return True for a plain VTK actor, False for one of our things."""
    return isinstance(thing, _vtk.vtkActor) and not isinstance(thing, Thing)
