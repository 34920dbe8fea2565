"""Actors as a page draws them: one mesh each."""

from __future__ import annotations

from pvibr.meshes.composites import set_block_look, visible_blocks
from pvibr.meshes.parts import copy_with


def actors_of(prop) -> list:
    """Return an actor by itself, or one for each block that a composite mapper draws."""
    mapper = prop.GetMapper()
    if not mapper.IsA('vtkCompositePolyDataMapper'):
        return [prop]
    actors = []
    for block in visible_blocks(mapper):
        actor = copy_with(prop, mapper, block)
        actor.SetPickable(prop.GetPickable())
        set_block_look(actor, mapper, block)
        actors.append(actor)
    return actors
