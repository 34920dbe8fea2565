"""Plotters of plain actors that show the same as a plotter with pvibr."""

from __future__ import annotations

from typing import Any

import numpy as np
import pyvista as pv

from pvibr.core._vtk import address
from pvibr.core.arguments import checked_number, checked_whole
from pvibr.core.errors import warn
from pvibr.core.plotters import border_of, names_of, renderers_of
from pvibr.export.scene import BakedScene
from pvibr.export.web_report import web_report
from pvibr.things.clipping_range import is_cut, reset_clipping_range
from pvibr.things.frame import Frame
from pvibr.things.thing import Thing

_RENDERER_SETTINGS = (
    *('Background', 'Background2', 'GradientBackground', 'TwoSidedLighting'),
    *('UseDepthPeeling', 'MaximumNumberOfPeels', 'OcclusionRatio'),
)
_LIMITS = {'triangles': (1, 10**9), 'texture': (0, 16_384)}


def to_plain_plotter(host, pipelines, make_cloud, **options):
    """Return a plotter of plain actors that shows the same, and warn of what it lacks."""
    plain_plotter, dropped = plain_copy(host, pipelines, make_cloud, **options)
    renderers = renderers_of(host)
    effects = {renderers.index(p.renderer): p.effects for p in pipelines}
    warn_of_losses(web_report(effects, 'client'), dropped, 'plain plotter')
    return plain_plotter


def plain_copy(host, pipelines, make_cloud, *, triangles, texture, detail, without=()):
    """Return a plotter of plain actors, and how many items of each thing it drops.

    Clouds are by `make_cloud`; things in `without` are left out.
    """
    for name, value in (('triangles', triangles), ('texture', texture)):
        checked_whole(name, value, *_LIMITS[name])
    checked_number('detail', detail, 1e-5, 1)
    renderers = renderers_of(host)
    effects = {p.renderer: [e for e in p.effects if e.enabled] for p in pipelines}
    plain_plotter = _like(host, renderers)
    try:
        cameras: dict = {}
        dropped: dict = {}
        for number, renderer in enumerate(renderers):
            plain_plotter.renderers.set_active_renderer(
                *np.atleast_1d(plain_plotter.renderers.index_to_loc(number))
            )
            pipeline = next((p for p in pipelines if p.renderer is renderer), None)
            scene = BakedScene(
                Frame.of(renderer, time=0.0 if pipeline is None else pipeline.time),
                triangles=int(triangles),
                detail=float(detail),
                texels=int(texture),
                make_cloud=make_cloud,
            )
            subplot_effects = effects.get(renderer, [])
            for effect in subplot_effects:
                if effect in without or effect.web[0] != 'baked':
                    continue
                if effect.needed(scene.frame) is True:
                    effect.bake_into(scene)
            _copy_view(renderer, plain_plotter.renderer, cameras)
            _copy_lights(renderer, plain_plotter.renderer, still=scene.lights_stand)
            scene.add_to(plain_plotter, _props(renderer, subplot_effects, without))
            if getattr(renderer, 'axes_enabled', False):
                plain_plotter.renderer.add_axes()
            dropped |= scene.dropped
        for renderer, plain_renderer in zip(renderers, plain_plotter.renderers, strict=True):
            if not is_cut(renderer):  # baked domes and ground reach farther
                reset_clipping_range(plain_renderer)
    except BaseException:
        plain_plotter.close()
        raise
    return plain_plotter, dropped


def _like(host, renderers) -> pv.Plotter:
    """Return an empty plotter with the same subplots."""
    window = host.renderer.GetRenderWindow()
    plotter_options: dict[str, Any] = {
        'window_size': list(window.GetSize()) if window is not None else None,
        'off_screen': bool(getattr(host, 'off_screen', True)),
        'theme': getattr(host, 'theme', None),
        'notebook': getattr(host, 'notebook', None),
    }
    layout = getattr(host, 'renderers', None)
    if layout is not None:
        grid_shape = layout.shape
        plotter_options['shape'] = (
            grid_shape if len(grid_shape) == 2 else f'1|{len(renderers) - 1}'
        )
        groups = [(slice(a, c + 1), slice(b, d + 1)) for a, b, c, d in layout.groups]
        plotter_options['groups'] = groups or None
    plain_plotter = pv.Plotter(lighting='none', **plotter_options)
    for old_renderer, new_renderer in zip(renderers, plain_plotter.renderers, strict=True):
        new_renderer.SetViewport(old_renderer.GetViewport())
    return plain_plotter


def _copy_view(old, new, cameras):
    """Copy a renderer's camera, background and depth peeling; shared cameras stay shared."""
    camera = old.GetActiveCamera()
    key = address(camera)
    if key not in cameras:
        cameras[key] = new.camera
        cameras[key].DeepCopy(camera)
    new.camera = cameras[key]
    new.camera.is_set = bool(getattr(camera, 'is_set', True))
    new.camera.parallel_projection = bool(camera.GetParallelProjection())
    for name in _RENDERER_SETTINGS:
        getattr(new, f'Set{name}')(getattr(old, f'Get{name}')())


def _copy_lights(old, new, *, still):
    """Copy lights; camera lights become scene lights if shadows are baked."""
    old.UpdateLightsGeometryToFollowCamera()
    for light in old.GetLights():
        light_copy = pv.Light()
        light_copy.DeepCopy(light)
        if light.LightTypeIsHeadlight():  # the only one that vtk.js has
            light_copy.SetLightTypeToCameraLight()
            light_copy.SetPosition(0, 0, 1)
            light_copy.SetFocalPoint(0, 0, 0)
        elif still and light.LightTypeIsCameraLight():
            light_copy.SetLightTypeToSceneLight()
            light_copy.SetTransformMatrix(None)
            light_copy.SetPosition(light.GetTransformedPosition())
            light_copy.SetFocalPoint(light.GetTransformedFocalPoint())
        new.AddLight(light_copy)


def _props(renderer, effects, without) -> list:
    """Return the props of a renderer that belong to no baked thing, with names.

    Those of effects in `without` are left out.
    """
    hidden_addresses = set()
    for effect in effects:
        # Between frames, substitutes hide their own actors and show the plain ones.
        if isinstance(effect, Thing) and effect.web[0] != 'shown':
            hidden_addresses |= {address(a) for a in (*effect.actors(), *effect.picked())}
        if isinstance(effect, Thing) or effect.web[0] != 'shown' or effect in without:
            hidden_addresses |= {address(p) for p in effect.props}
    prop_names = names_of(renderer)
    props = [p for p in renderer.GetViewProps() if address(p) not in hidden_addresses]
    return [(prop_names.get(address(p)), p) for p in props if p is not border_of(renderer)]


def warn_of_losses(report, dropped, target):
    """Warn about effects and items that a plain plotter, or what is made of it, lacks."""
    lost = [f'{r.effect} ({r.what})' for r in report.missing if r.state == 'lost']
    parts = []
    if lost:
        parts.append(f'not in the {target}: {", ".join(lost)}')
    for name, count in dropped.items():
        parts.append(
            f'{count} of {name}, the smallest on the screen, are dropped: increase triangles'
        )
    if parts:
        warn('; '.join(parts))
