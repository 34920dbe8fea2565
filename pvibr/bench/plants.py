"""Levels of a plant: what each costs, and how far it is from the mesh."""

from __future__ import annotations

import time
from functools import partial

import numpy as np
import pyvista as pv

from pvibr.bench.rows import Row
from pvibr.bench.sprites import frame_ms
from pvibr.instances.foliage_levels import foliage_levels
from pvibr.scenes.trees import tree_parts

_TREE = 40_000  # triangles


def measure(settings, results):
    """Measure every level of a tree."""
    start = time.perf_counter()
    levels = foliage_levels(tree_parts('broadleaf', triangles=_TREE))
    results.rows.append(Row('levels of a tree: made', time.perf_counter() - start, 's'))
    levels.measure(settings.plant_pixels, settings.plant_views)
    ms = _times(levels, settings)
    results.points['plants'] = {}
    for level in levels.levels:
        each = ms[level.name]
        texels = sum(w * h for w, h in level.textures)
        point = {**level.error, 'ms': each, 'triangles': level.triangles, 'texels': texels}
        results.points['plants'][level.name] = point
        results.rows += [
            Row(f'tree as {level.name}: triangles', level.triangles),
            Row(f'tree as {level.name}: texels', texels),
            Row(f'tree as {level.name}: mean FLIP', level.error['flip']),
            Row(f'tree as {level.name}: silhouette IoU', level.error['iou']),
            Row(f'tree as {level.name}: each', each, 'ms'),
        ]


def _times(levels, settings) -> dict:
    """Return milliseconds of one plant, in a frame of several."""
    found = {}
    places = np.stack(np.meshgrid(np.arange(5) - 2.0, np.arange(4) - 1.5), -1).reshape(-1, 2)
    places = np.c_[places * 16, np.zeros(len(places))][: settings.plants]
    for name in ('mesh', 'parts', 'clusters'):
        put = partial(_stand, levels=levels, name=name, places=places)
        found[name] = _ms(put, settings.size)
    for name in ('turntable', 'billboard'):
        cards = getattr(levels, name)
        many = np.repeat(places, settings.copies, 0)
        found[name] = _ms(partial(_turn, points=many, cards=cards), settings.size)
        found[name] /= settings.copies
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


def _ms(put, size) -> float:
    pl = pv.Plotter(off_screen=True, window_size=list(size))
    pl.renderer.disable_anti_aliasing()
    put(pl)
    camera = pl.camera
    camera.focal_point, camera.up = (0, 0, 7), (0, 0, 1)
    found = []
    for k in range(4):
        camera.position = (10.0 * k, -120, 30)
        pl.renderer.ResetCameraClippingRange()
        found.append(frame_ms(pl))
    for actor in list(pl.renderer.GetActors()):
        actor.ReleaseGraphicsResources(pl.render_window)
    pl.close()
    return min(found[1:])
