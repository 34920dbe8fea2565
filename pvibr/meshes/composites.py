"""Blocks of composite mappers."""

from __future__ import annotations

import pyvista as pv


def visible_blocks(mapper) -> list:
    """Return the datasets that a composite mapper draws."""
    attributes = mapper.GetCompositeDataDisplayAttributes()
    blocks = pv.wrap(mapper.GetInputDataObject(0, 0))
    return [
        block
        for block in blocks.recursive_iterator(skip_none=True, skip_empty=True)
        if attributes.GetBlockVisibility(block) or not attributes.HasBlockVisibility(block)
    ]


def set_block_look(actor, mapper, block):
    """Give an actor the colour and opacity of a block of a composite mapper."""
    attributes = mapper.GetCompositeDataDisplayAttributes()
    if attributes.HasBlockColor(block):
        color = [0.0, 0.0, 0.0]
        attributes.GetBlockColor(block, color)
        actor.prop.color = color
        actor.mapper.scalar_visibility = False
    if attributes.HasBlockOpacity(block):
        actor.prop.opacity = attributes.GetBlockOpacity(block)
