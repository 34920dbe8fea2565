"""A plotter's subplots as one tree of numbers, arrays and shader texts that a page draws."""

from __future__ import annotations

from typing import Any

import numpy as np
import pyvista as pv

from pvibr.core import _vtk
from pvibr.core._vtk import address
from pvibr.core.plotters import border_of, names_of, plain_name, renderers_of, seams_of
from pvibr.effects.accumulation import Accumulation
from pvibr.effects.ground import FADES, NEAREST, Ground, fading
from pvibr.figures.animated_actor import AnimatedActor
from pvibr.figures.crowd import Crowd
from pvibr.figures.mesh_actors import transformed_bounds
from pvibr.gl import set_fragment_uniforms
from pvibr.gl.annotations import is_flat
from pvibr.gl.scene_pass import is_end, is_marker
from pvibr.instances.instances import Instances
from pvibr.shadows.shadows import Shadows
from pvibr.things.frame import Frame
from pvibr.things.thing import Thing
from pvibr.web import image_effects, projectors, quadrics, shadows
from pvibr.web.actors import actors_of
from pvibr.web.annotations import annotations_of
from pvibr.web.cube_axes import cube_meshes, is_cube_axes
from pvibr.web.figures import (
    crowd_of,
    figure_of,
    is_played,
    let_follow,
    moves,
    posing_program,
    what_plays,
    why_still,
)
from pvibr.web.instance_sets import instances_of, why_not_drawn
from pvibr.web.programs import Programs
from pvibr.web.projectors import PageProjector
from pvibr.web.shadows import PageShadows
from pvibr.web.surfaces import WebSurface, css_of, table_of, thing_of

#: What a viewer chooses from, beside the colours of the scene.
_COLORMAPS = 'viridis', 'plasma', 'coolwarm', 'turbo', 'gray'
#: Effects of which a page knows the means.
_KINDS = Accumulation, Ground, Shadows
_DRAWN_MAPPERS = ('vtkDataSetMapper', 'vtkPolyDataMapper')


def drawn_of(effects) -> list:
    """Return the effects that a page draws as pvibr does, in their order."""
    enabled = [effect for effect in effects if effect.enabled and not effect.why_neutral]
    drawn = [e for e in enabled if type(e) in _KINDS or _is_an_effect(e)]
    # Other projected images are baked into surfaces, instances included.
    if any(e.web[0] == 'baked' and not isinstance(e, Thing) and e not in drawn for e in enabled):
        return drawn
    return drawn + [e for e in enabled if is_played(e) or _is_set(e) or quadrics.is_drawn(e)]


def _is_an_effect(effect) -> bool:
    return image_effects.is_drawn(effect) or projectors.is_drawn(effect)


def _is_set(effect) -> bool:
    return type(effect) is Instances and why_not_drawn(effect) is None


def what_of(effect) -> str:
    """Return what a page draws of an effect of :func:`drawn_of`."""
    if type(effect) is Shadows:
        return 'shadow maps of one light'
    if type(effect) is Accumulation:
        return 'the mean of pictures, once the view is still'
    if type(effect) is Ground:
        return 'a disc that fades'
    if _is_an_effect(effect):
        return 'by its own programs'
    if quadrics.is_drawn(effect):
        return 'by rays'
    return what_plays(effect) if moves(effect) else 'instances, with their levels of detail'


def why_baked(effect) -> str:
    """Return as what a page has an effect that it bakes, and why."""
    why = why_still(effect) if moves(effect) else None
    return effect.web[1] if why is None else f'{effect.web[1]}: {why}'


def losses_of(drawn) -> list[tuple[str, str]]:
    """Return what a page lacks of effects that it draws: names and why."""
    lost = []
    for effect in drawn:
        lost += (shadows if type(effect) is Shadows else image_effects).lost_of(effect)
    return lost


def scene_of(plotter, plain_plotter, effects_by_subplot, time=0.0) -> dict:
    """Return what a page draws: effects of a plotter at a time, and actors of its plain copy."""
    renderers = renderers_of(plotter)
    cameras = [address(renderer.GetActiveCamera()) for renderer in renderers]
    subplots = []
    for number, renderer in enumerate(renderers_of(plain_plotter)):
        effects = effects_by_subplot.get(number, ())
        frame = Frame.of(renderers[number], time=time)
        subplot = subplot_of(renderer, effects, frame)
        subplot['stage'] = image_effects.stage_of(effects, frame)
        subplot['bounds'] = _bounds([renderers[number].ComputeVisiblePropBounds()])
        boxes = [prop.GetBounds() for _, prop in drawn_props(renderer)]
        boxes += [p.GetBounds() for e in effects if type(e) is Ground for p in e.props]
        boxes += [_moved(figure) for figure in subplot['figures']]
        subplot['reach'] = _bounds([subplot['bounds'], *boxes])
        subplot['camera'] = camera_of(renderers[number].GetActiveCamera())
        subplot['link'] = cameras.index(cameras[number])
        size = renderers[number].GetSize()
        arguments = renderers[number], renderer, subplot['things'], size
        subplot['annotations'] = annotations_of(*arguments) if min(size) > 0 else []
        subplot['border'] = _border(renderers[number])
        subplots.append(subplot)
    colored = any('coloring' in thing for s in subplots for thing in s['things'])
    tables = {name: table_of(pv.LookupTable(name)) for name in _COLORMAPS} if colored else {}
    scene = {'version': 1, 'colormaps': tables, 'subplots': subplots}
    drawn = [e for effects in effects_by_subplot.values() for e in effects]
    counts = [e.samples for e in drawn if type(e) is Accumulation]
    scene['samples'] = int(max(counts, default=1))
    scene['seams'] = [_seam(actor) for actor in seams_of(plotter)]
    if any(s['figures'] or any('plays' in t for t in s['things']) for s in subplots):
        scene |= {'clock': {'time': float(time)}, 'posing': posing_program()}
    return scene


def _moved(figure) -> np.ndarray:
    """Return world bounds of what a figure that plays reaches."""
    return transformed_bounds(np.reshape(figure['matrix'], (4, 4)), np.array(figure['reach']))


def _border(renderer) -> dict | None:
    prop = border_of(renderer)
    return None if prop is None or not prop.GetVisibility() else _stroke(prop)


def _stroke(actor) -> dict:
    """Return the look of flat lines."""
    look = actor.GetProperty()
    return {'color': css_of(look.GetColor()), 'width': look.GetLineWidth()}


def _seam(actor) -> dict:
    """Return lines between subplots, as shares of the whole view from its lower left corner."""
    lines = pv.wrap(actor.GetMapper().GetInput())
    ends = lines.points[lines.lines.reshape(-1, 3)[:, 1:], :2]
    return {'lines': ends.reshape(-1, 4).tolist(), **_stroke(actor)}


def _bounds(parts) -> list:
    """Return the bounds of some bounds, of which some may be None or empty."""
    box = _vtk.vtkBoundingBox()
    for part in parts:
        if part is not None and part[0] <= part[1]:
            box.AddBounds(part)
    bounds = [0.0] * 6
    box.GetBounds(bounds)
    return bounds if box.IsValid() else [-1.0, 1.0] * 3


def subplot_of(renderer, effects, frame) -> dict:
    """Return what a page draws of a renderer of plain actors, and of effects."""
    cast = [
        PageShadows(e, frame) for e in effects if type(e) is Shadows and e.light_of_page(frame)
    ]
    thrown = [PageProjector(e, frame) for e in effects if projectors.is_drawn(e)]
    lights = [light for light in renderer.GetLights() if light.GetSwitch()]
    programs = Programs(lights, [*cast, *thrown])
    things = [t for s in effects if isinstance(s, Instances) for t in _trees(s, programs)]
    things += [quadrics.quadrics_of(e, programs) for e in effects if quadrics.is_drawn(e)]
    things += [_ground(e, programs) for e in effects if type(e) is Ground]
    actors = [effect for effect in effects if isinstance(effect, AnimatedActor)]
    figures = [figure_of(actor, programs, k) for k, actor in enumerate(actors)]
    things += [mesh for _, meshes in figures for mesh in meshes]
    for name, prop in drawn_props(renderer):
        things += [_mesh(name, actor, programs) for actor in actors_of(prop)]
    for _, prop in props_of(renderer):
        things += cube_meshes(prop, programs) if is_cube_axes(prop) else []
    for k, actor in enumerate(actors):
        let_follow(actor, figures[k][0], k, things)
    background = renderer.GetBackground(), renderer.GetBackground2()
    return {
        'viewport': list(renderer.GetViewport()),
        'background': {
            'bottom': background[0],
            'top': background[1] if renderer.GetGradientBackground() else None,
        },
        'lights': lights_of(renderer),
        'things': things,
        'near': NEAREST if any(type(e) is Ground for e in effects) else 0.001,
        'shadows': next((each.tree() for each in cast), None),
        'projectors': [each.tree() for each in thrown],
        'figures': [figure for figure, _ in figures],
        'programs': programs.read(),
    }


def _trees(instances, programs) -> list[dict]:
    return (crowd_of if isinstance(instances, Crowd) else instances_of)(instances, programs)


def props_of(renderer) -> list:
    """Return names and visible props of a renderer, without annotations and pvibr's markers."""
    names = names_of(renderer)
    props = [p for p in renderer.GetViewProps() if not (is_marker(p) or is_end(p) or is_flat(p))]
    props = [p for p in props if p.GetVisibility()]
    return [(plain_name(names.get(address(p), type(p).__name__)), p) for p in props]


def why_missing(prop) -> str | None:
    """Return why a page does not draw a prop, or None if it does."""
    if prop.IsA('vtkVolume'):
        return 'pages draw no volumes'
    if is_cube_axes(prop):
        return None
    mapper = prop.GetMapper() if prop.IsA('vtkActor') else None
    if mapper is None or not any(mapper.IsA(kind) for kind in _DRAWN_MAPPERS):
        return f'pages do not draw {type(prop if mapper is None else mapper).__name__}'
    return None


def drawn_props(renderer) -> list:
    """Return names and props of a renderer of which a page shows anything."""
    props = [(name, prop) for name, prop in props_of(renderer) if why_missing(prop) is None]
    return [(name, prop) for name, prop in props if prop.GetLength() and not is_cube_axes(prop)]


def _mesh(name, prop, programs, prepare=None) -> dict:
    """Return an actor as a thing; a function prepares the actors that draw it."""
    matrix = pv.array_from_vtkmatrix(prop.GetMatrix())
    surface = WebSurface(prop, _clipped(prop.GetMapper(), matrix))
    return thing_of(surface, name, programs, prepare) | {
        'pickable': bool(prop.GetPickable()),
        'matrix': matrix.ravel().tolist(),
        'casts': bool(prop.GetUseBounds()),
    }


def _ground(effect, programs) -> dict:
    """Return a ground as a thing."""
    uniforms = fading(effect, Frame.of(effect.pipeline.renderer))

    def prepare(actor):
        FADES.attach(actor)
        set_fragment_uniforms([actor], uniforms)

    (actor,) = effect.props
    tree = _mesh(effect.name, actor, programs, prepare)
    tree['material']['uniforms'] |= uniforms
    return tree


def _clipped(mapper, matrix) -> pv.DataSet | None:
    """Return the part of a mapper's mesh within its clipping planes, None without planes."""
    planes = list(mapper.GetClippingPlanes() or ())
    mesh: Any = pv.wrap(mapper.GetInput()) if planes else None
    for plane in planes:
        normal = matrix[:3, :3].T @ plane.GetNormal()
        origin = (np.linalg.inv(matrix) @ [*plane.GetOrigin(), 1])[:3]
        mesh = mesh.clip(normal=normal, origin=origin, invert=False)
    return mesh


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
