"""Spheres, ellipsoids and cylinders for pages, which draw them by rays with pvibr's shaders."""

from __future__ import annotations

import numpy as np

from pvibr.points.quadric_cards import DOTS, POINTS, QUADS, SMALL, SMALLEST_PX
from pvibr.points.quadrics import Quadrics
from pvibr.web.instance_sets import card_actor, table_of_colors
from pvibr.web.surfaces import material_of

_STEPS = 2.0**16  # within the largest number of a set
_IDENTITY = np.eye(4).ravel().tolist()


def is_drawn(effect) -> bool:
    """Return whether a page draws an effect as quadrics, by rays."""
    return isinstance(effect, Quadrics) and not effect.clips and len(effect) > 0


def quadrics_of(thing, programs) -> dict:
    """Return a set of quadrics as a thing; its items are in the order of their blocks."""
    order, blocks, items, looks = thing.texels()
    tree = {
        'kind': 'quadrics',
        'name': thing.name,
        'pickable': bool(thing.pickable),
        'translucent': bool(thing.blends),
        'material': material_of(thing.prop),
        'ids': order.astype(np.uint32),
        'items': _rounded(items),
        'looks': looks,
        'looks_per_item': thing.shape.looks,
        'middles': blocks.centers,
        'reach': blocks.reach.astype(np.float32),
        'largest': blocks.largest.astype(np.float32),
        'matrix': _IDENTITY,
        'origin': blocks.centers.mean(0).tolist(),
        'modes': [_mode(thing, mode, limit, programs) for mode, limit in _limits(thing.shape)],
    }
    table = table_of_colors(thing)
    if table is not None and np.ndim(thing.scalars) == 1:
        values = np.asarray(thing.scalars, np.float32)[order]
        tree |= {'coloring': table, 'scalars': {table['name']: values}}
    return tree


def _limits(shape) -> list:
    """Return draw modes and the largest sizes in pixels that each draws, smallest first."""
    dot_px, small_px = SMALLEST_PX
    return [(DOTS, dot_px), (SMALL, small_px), (POINTS, shape.largest_sprite_px), (QUADS, 1e9)]


def _mode(thing, mode, limit, programs) -> dict:
    actor = card_actor(mode.feature(thing.shape), thing.prop, mode.corners)
    return {'program': programs.add(actor), 'corners': mode.corners, 'largest': limit}


def _rounded(items) -> np.ndarray:
    """Return texels whose last bits are 0, which deflates to half the size."""
    step = 2.0 ** np.floor(np.log2(max(np.abs(items).max(initial=0.0), 1e-30) / _STEPS))
    return (np.rint(items / step) * step).astype(np.float32)
