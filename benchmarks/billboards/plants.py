"""Levels of a plant: what each costs, and how far it is from the mesh."""

from __future__ import annotations

from functools import partial

import numpy as np
import pyvista as pv

from benchmarks.common.harness import Row
from benchmarks.common.timing import least_ms, timed
from pvibr.instances.foliage_levels import foliage_levels
from pvibr.scenes.trees import tree_parts

_TREE = 40_000  # triangles
_CAMERAS = [((10.0 * k, -120, 30), (0, 0, 7), (0, 0, 1)) for k in range(4)]


def measure(settings, results):
    """Yield the rows of every level of a tree."""
    levels, made = timed(lambda: foliage_levels(tree_parts('broadleaf', triangles=_TREE)))
    yield Row('levels of a tree: made', made, 's')
    levels.measure(settings.plant_pixels, settings.plant_views)
    ms = _times(levels, settings)
    results.points['plants'] = {}
    for level in levels.levels:
        each = ms[level.name]
        texels = sum(w * h for w, h in level.textures)
        point = {**level.error, 'ms': each, 'triangles': level.triangles, 'texels': texels}
        results.points['plants'][level.name] = point
        yield Row(f'tree as {level.name}: triangles', level.triangles)
        yield Row(f'tree as {level.name}: texels', texels)
        yield Row(f'tree as {level.name}: mean FLIP', level.error['flip'])
        yield Row(f'tree as {level.name}: silhouette IoU', level.error['iou'])
        yield Row(f'tree as {level.name}: each', each, 'ms')


def _times(levels, settings) -> dict:
    """Return milliseconds of one plant, in a frame of several."""
    found = {}
    places = np.stack(np.meshgrid(np.arange(5) - 2.0, np.arange(4) - 1.5), -1).reshape(-1, 2)
    places = np.c_[places * 16, np.zeros(len(places))][: settings.plants]
    for name in ('mesh', 'parts', 'clusters'):
        put = partial(_stand, levels=levels, name=name, places=places)
        found[name] = least_ms(settings.size, put, _CAMERAS)
    for name in ('turntable', 'billboard'):
        cards = getattr(levels, name)
        many = np.repeat(places, settings.copies, 0)
        put = partial(_turn, points=many, cards=cards)
        found[name] = least_ms(settings.size, put, _CAMERAS) / settings.copies
    return {name: ms / len(places) for name, ms in found.items()}


def _stand(pl, levels, name, places):
    first = levels.actors(name)
    for place in places:
        for source in first:
            actor = pv.Actor()
            actor.ShallowCopy(source)
            actor.position = place
            pl.renderer.AddViewProp(actor)


def _turn(pl, points, cards):
    pl.ibr.add_billboards(points, **cards)
