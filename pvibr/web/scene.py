"""A plotter's subplots as one tree of numbers, arrays and shader texts that a page draws."""

from __future__ import annotations

import numpy as np

from pvibr.core.plotters import renderers_of
from pvibr.gl.annotations import is_flat
from pvibr.gl.scene_pass import is_end, is_marker
from pvibr.web.instance_sets import instances_of
from pvibr.web.programs import Programs
from pvibr.web.surfaces import WebSurface, coloring_of

_DRAWN_MAPPERS = ('vtkDataSetMapper', 'vtkPolyDataMapper')


def scene_of(plotter, effects_by_subplot) -> dict:
    """Return what a page draws of a plotter, and in `missing` what it does not, by subplot.

    The pictures of a texture and of views are rows from the bottom up.
    """
    subplots = [
        subplot_of(renderer, effects_by_subplot.get(number, ()))
        for number, renderer in enumerate(renderers_of(plotter))
    ]
    return {'version': 1, 'size': list(plotter.window_size), 'subplots': subplots}


def subplot_of(renderer, effects) -> dict:
    """Return what a page draws of a subplot."""
    programs = Programs([light for light in renderer.GetLights() if light.GetSwitch()])
    things, missing = [], []
    drawn_by_things = {id(actor) for e in effects for actor in _actors_of(e)}
    for effect in effects:
        if _is_instances(effect) and effect.visibility:
            things += instances_of(effect, programs)
        else:
            missing.append(effect.name)
    for name, prop in _props(renderer):
        if id(prop) in drawn_by_things or prop in effects or not prop.GetVisibility():
            continue
        thing = _mesh(name, prop, programs)
        if thing is not None:
            things.append(thing)
        elif prop.IsA('vtkProp3D'):
            missing.append(name)
    background = renderer.GetBackground(), renderer.GetBackground2()
    return {
        'viewport': list(renderer.GetViewport()),
        'background': {
            'bottom': background[0],
            'top': background[1] if renderer.GetGradientBackground() else None,
        },
        'camera': camera_of(renderer.GetActiveCamera()),
        'bounds': [float(b) for b in renderer.ComputeVisiblePropBounds()],
        'lights': lights_of(renderer),
        'things': things,
        'programs': programs.read(),
        'missing': missing,
    }


def _actors_of(effect) -> list:
    return list(effect.actors()) if callable(getattr(effect, 'actors', None)) else []


def _is_instances(effect) -> bool:
    return type(effect).__name__ == 'Instances'


def _props(renderer):
    """Return names and props of a renderer, without pvibr's markers and annotations."""
    names = {id(actor): name for name, actor in getattr(renderer, 'actors', {}).items()}
    props = [p for p in renderer.GetViewProps() if not (is_marker(p) or is_end(p) or is_flat(p))]
    return [(names.get(id(p), type(p).__name__), p) for p in props]


def _mesh(name, prop, programs) -> dict | None:
    """Return an actor as a thing, or None if a page cannot draw it."""
    mapper = prop.GetMapper() if prop.IsA('vtkActor') else None
    if mapper is None or not any(mapper.IsA(kind) for kind in _DRAWN_MAPPERS):
        return None
    if mapper.GetInput() is None or not mapper.GetInput().GetNumberOfPoints():
        return None
    surface = WebSurface(prop)
    matrix = np.eye(4)
    for row in range(4):
        for column in range(4):
            matrix[row, column] = prop.GetMatrix().GetElement(row, column)
    tree = surface.tree() | {
        'kind': 'mesh',
        'name': name,
        'pickable': bool(prop.GetPickable()),
        'matrix': matrix.ravel().tolist(),
        'translucent': bool(prop.HasTranslucentPolygonalGeometry()),
        'program': programs.add(surface.actor_of()),
    }
    if surface.values is not None:
        tree['coloring'] = coloring_of(mapper)
        tree['scalars'] = {tree['coloring']['name']: tree['values']}
    return tree


def camera_of(camera) -> dict:
    """Return a camera as a page holds it."""
    return {
        'position': camera.GetPosition(),
        'focal_point': camera.GetFocalPoint(),
        'up': camera.GetViewUp(),
        'view_angle': camera.GetViewAngle(),
        'parallel_projection': bool(camera.GetParallelProjection()),
        'parallel_scale': camera.GetParallelScale(),
        'clipping_range': camera.GetClippingRange(),
        'window_center': camera.GetWindowCenter(),
    }


def lights_of(renderer) -> list[dict]:
    """Return the lights that are on, in the coordinates of their type."""
    lights = []
    for light in renderer.GetLights():
        if not light.GetSwitch():
            continue
        kind = 'scene'
        if light.LightTypeIsHeadlight():
            kind = 'head'
        elif light.LightTypeIsCameraLight():
            kind = 'camera'
        position, focal_point = light.GetPosition(), light.GetFocalPoint()
        if kind == 'scene':
            position = light.GetTransformedPosition()
            focal_point = light.GetTransformedFocalPoint()
        lights.append(
            {
                'kind': kind,
                'position': position,
                'focal_point': focal_point,
                'color': [light.GetIntensity() * c for c in light.GetDiffuseColor()],
                'positional': int(light.GetPositional()),
                'cone': light.GetConeAngle(),
                'exponent': light.GetExponent(),
                'attenuation': light.GetAttenuationValues(),
            }
        )
    return lights
