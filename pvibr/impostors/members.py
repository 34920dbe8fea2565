"""What may be given to an impostor."""

from __future__ import annotations

from pvibr.core import _vtk
from pvibr.instances.instances import Instances
from pvibr.scene.casters import listed
from pvibr.scene.thing import Thing


def checked(actors) -> list:
    """Return actors and instances as a checked list."""
    found = listed(actors)
    for thing in found:
        if not is_actor(thing) and type(thing) is not Instances:
            raise TypeError(
                f'actors holds a {type(thing).__name__}: each must be an actor, as add_mesh '
                'returns it, or Instances, as add_instances does'
            )
    if not found:
        raise ValueError('actors is empty: give one or more')
    seen: set = set()
    for place, thing in enumerate(found):
        if id(thing) in seen:
            raise ValueError(f'actors[{place}] is there twice: give each of them once')
        seen.add(id(thing))
    return found


def is_actor(thing) -> bool:
    """Return True for an actor of the user, which no thing is."""
    return isinstance(thing, _vtk.vtkActor) and not isinstance(thing, Thing)
