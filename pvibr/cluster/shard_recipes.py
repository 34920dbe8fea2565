"""Things divided by space, as bytes from which workers make them again."""

from __future__ import annotations

import pickle
from typing import Any

import numpy as np
import pyvista as pv

from pvibr.instances.instances import Instances
from pvibr.maths.kd_boxes import divided
from pvibr.meshes.stored_parts import from_arrays, to_arrays
from pvibr.points.quadrics import Quadrics

#: What sets an equal material, by the names of VTK's methods.
_MATERIAL = (
    *('Color', 'Ambient', 'Diffuse', 'Specular', 'SpecularPower', 'SpecularColor', 'Opacity'),
    *('Lighting', 'Interpolation', 'Metallic', 'Roughness'),
)


def recipes_of(present, chosen, count) -> tuple[list, list[bytes]]:
    """Return the things to send, and what each shard is made of."""
    # Kinds of instances of their own are made of other things than meshes and poses.
    things = [t for t in present if isinstance(t, Quadrics) or type(t) is Instances]
    if chosen is not None:
        refused = [t for t in chosen if t not in present or t not in things]
        if refused:
            raise TypeError(
                f'things must be instances or quadrics of this subplot, got {refused[0]!r:.80}; '
                'make others on the workers, by make_shard'
            )
        things = list(chosen)
    things = [t for t in things if len(t)]
    if not things:
        raise ValueError(
            'things must have instances, spheres, cylinders or ellipsoids, got none: add some '
            'before, or pass make_shard'
        )
    for thing in things:
        if thing.mapper.GetClippingPlanes():
            raise ValueError(
                f'things must have no clipping planes, got {thing!r:.80}; remove them, or pass '
                'make_shard'
            )
        thing.wait()
    centers = [np.asarray(thing.item_spheres()[0]) for thing in things]
    shards = [items for items, _ in divided(np.concatenate(centers), count)]
    starts = np.cumsum([0, *map(len, centers)])
    return things, [_packed(things, starts, items) for items in shards if len(items)]


def _packed(things, starts, items) -> bytes:
    rows = []
    for k, thing in enumerate(things):
        own = items[(items >= starts[k]) & (items < starts[k + 1])] - starts[k]
        if len(own):
            rows.append(_recipe(thing, own))
    return pickle.dumps(rows, protocol=5)


def _recipe(thing, ids) -> dict[str, Any]:
    colors = None if thing.colors is None else np.asarray(thing.colors)[ids]
    recipe = {
        'class': type(thing).__name__,
        'colors': colors,
        'visible': thing.drawn_items()[ids],
        'matrix': None if np.array_equal(thing.matrix, np.eye(4)) else np.array(thing.matrix),
    }
    kind = _instances if isinstance(thing, Instances) else _quadrics
    return recipe | kind(thing, ids)


def _quadrics(thing, ids) -> dict[str, Any]:
    given = {n: _rows(v, ids, len(thing)) for n, v in thing.given().items()}
    opacity = _rows(thing.opacity, ids, len(thing))
    material = {name: getattr(thing.prop, f'Get{name}')() for name in _MATERIAL}
    return {'given': given, 'opacity': opacity, 'material': material}


def _rows(value, ids, count):
    array = np.asarray(getattr(value, 'points', value))
    return array[ids] if array.ndim and len(array) == count else value


def _instances(thing, ids) -> dict[str, Any]:
    index = np.asarray(thing.index)[ids]
    used, index = np.unique(index, return_inverse=True)
    meshes = [to_arrays(thing._models.meshes[k]) for k in used]  # noqa: SLF001
    return {
        'meshes': meshes,
        'index': index,
        'poses': np.asarray(thing.poses)[ids],
        'blend': 'multiply' if thing.multiplies else 'replace',
        'settings': thing.state() | {'force_level': thing.force_level},
    }


def make_recipes(_index, _count, data) -> pv.Plotter:
    """Return the plotter of a shard, on a worker."""
    plotter = pv.Plotter(off_screen=True)
    for recipe in pickle.loads(data):  # noqa: S301, of the user's own process, as all of Dask's
        make = _made_instances if 'meshes' in recipe else _made_quadrics
        thing = make(plotter, recipe)
        thing.visible = recipe['visible']
        if recipe['matrix'] is not None:
            thing.user_matrix = recipe['matrix']
    return plotter


def _made_quadrics(plotter, recipe):
    import pvibr

    make = getattr(pvibr, recipe['class'])
    looks = {'colors': recipe['colors'], 'opacity': recipe['opacity']}
    thing = plotter.ibr.add(make(**recipe['given'], **looks))
    for name, value in recipe['material'].items():
        getattr(thing.prop, f'Set{name}')(value)
    return thing


def _made_instances(plotter, recipe):
    meshes = [from_arrays(*stored) for stored in recipe['meshes']]
    settings = recipe['settings']
    return plotter.ibr.add(
        Instances(
            meshes if len(meshes) > 1 else meshes[0],
            recipe['poses'],
            index=recipe['index'],
            colors=recipe['colors'],
            blend=recipe['blend'],
            max_error=settings['max_error'],
            force_level=settings['force_level'],
        )
    )
