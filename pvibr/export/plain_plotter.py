"""Plotters of plain actors that show the same, for browsers and files."""

from __future__ import annotations

from typing import Any

import numpy as np
import pyvista as pv

from pvibr.core._vtk import address
from pvibr.core.errors import warn
from pvibr.core.frame import Frame
from pvibr.core.plotters import border_of, renderers_of
from pvibr.export.scene import BakedScene, names_of
from pvibr.export.web_report import web_report
from pvibr.maths.arguments import checked_number, checked_whole
from pvibr.scene.thing import Thing

_LIMITS = {'triangles': (1, 10**9), 'texture': (0, 16_384)}


def to_plain_plotter(host, pipelines, *, triangles, texture, detail):
    """Return a plotter of plain actors that shows the same as a host."""
    _check(triangles, texture, detail)
    renderers = renderers_of(host)
    effects = {p.renderer: [e for e in p.effects if e.enabled] for p in pipelines}
    made = _like(host, renderers)
    try:
        cameras: dict = {}
        dropped: dict = {}
        for number, renderer in enumerate(renderers):
            made.renderers.set_active_renderer(*np.atleast_1d(made.renderers.index_to_loc(number)))
            pipeline = next((p for p in pipelines if p.renderer is renderer), None)
            scene = BakedScene(
                Frame.of(renderer, time=0.0 if pipeline is None else pipeline.time),
                triangles=int(triangles),
                detail=float(detail),
                texels=int(texture),
            )
            here = effects.get(renderer, [])
            for effect in here:
                if effect.web[0] == 'baked' and effect.needed(scene.frame) is True:
                    effect.bake_into(scene)
            _copy_view(renderer, made.renderer, cameras)
            _copy_lights(renderer, made.renderer, still=scene.lights_stand)
            scene.add_to(made, _props(renderer, here))
            made.renderer.ResetCameraClippingRange()
            if getattr(renderer, 'axes_enabled', False):
                made.renderer.add_axes()
            dropped |= scene.dropped
    except BaseException:
        made.close()
        raise
    _warn(web_report({renderers.index(r): e for r, e in effects.items()}, 'client'), dropped)
    return made


def _check(triangles, texture, detail):
    for name, value in (('triangles', triangles), ('texture', texture)):
        checked_whole(name, value, *_LIMITS[name])
    checked_number('detail', detail, 1e-5, 1)


def _like(host, renderers) -> pv.Plotter:
    """Return an empty plotter with the same subplots."""
    window = host.renderer.GetRenderWindow()
    options: dict[str, Any] = {
        'window_size': list(window.GetSize()) if window is not None else None
    }
    options['off_screen'] = bool(getattr(host, 'off_screen', True))
    options['theme'] = getattr(host, 'theme', None)
    options['notebook'] = getattr(host, 'notebook', None)
    layout = getattr(host, 'renderers', None)
    if layout is not None:
        shape = layout.shape
        options['shape'] = shape if len(shape) == 2 else f'1|{len(renderers) - 1}'
        groups = [(slice(a, c + 1), slice(b, d + 1)) for a, b, c, d in layout.groups]
        options['groups'] = groups or None
    made = pv.Plotter(lighting='none', **options)
    for old, new in zip(renderers, made.renderers, strict=True):
        new.SetViewport(old.GetViewport())
    return made


def _copy_view(old, new, cameras):
    """Copy camera, background and depth peeling of a renderer; shared cameras stay shared."""
    camera = old.GetActiveCamera()
    key = address(camera)
    if key not in cameras:
        cameras[key] = new.camera
        cameras[key].DeepCopy(camera)
    new.camera = cameras[key]
    new.camera.is_set = bool(getattr(camera, 'is_set', True))
    new.camera.parallel_projection = bool(camera.GetParallelProjection())
    new.SetBackground(old.GetBackground())
    new.SetBackground2(old.GetBackground2())
    new.SetGradientBackground(old.GetGradientBackground())
    new.SetTwoSidedLighting(old.GetTwoSidedLighting())
    new.SetUseDepthPeeling(old.GetUseDepthPeeling())
    new.SetMaximumNumberOfPeels(old.GetMaximumNumberOfPeels())
    new.SetOcclusionRatio(old.GetOcclusionRatio())


def _copy_lights(old, new, *, still):
    """Copy lights; camera lights become scene lights if their shadows are baked."""
    old.UpdateLightsGeometryToFollowCamera()
    for light in old.GetLights():
        copy = pv.Light()
        copy.DeepCopy(light)
        if light.LightTypeIsHeadlight():  # the only one that vtk.js has
            copy.SetLightTypeToCameraLight()
            copy.SetPosition(0, 0, 1)
            copy.SetFocalPoint(0, 0, 0)
        elif still and light.LightTypeIsCameraLight():
            copy.SetLightTypeToSceneLight()
            copy.SetTransformMatrix(None)
            copy.SetPosition(light.GetTransformedPosition())
            copy.SetFocalPoint(light.GetTransformedFocalPoint())
        new.AddLight(copy)


def _props(renderer, effects) -> list:
    """Return the props of a renderer that belong to no baked thing, with their names."""
    hidden = set()
    for thing in effects:
        # What stands for plain actors has them visible between frames, and its own actors not.
        if isinstance(thing, Thing) and thing.web[0] != 'shown':
            hidden |= {address(a) for a in (*thing.actors(), *thing.picked())}
        hidden |= {address(p) for p in thing.props}
    names = names_of(renderer)
    props = [p for p in renderer.GetViewProps() if address(p) not in hidden]
    return [(names.get(address(p)), p) for p in props if p is not border_of(renderer)]


def _warn(report, dropped):
    lost = [f'{r.effect} ({r.what})' for r in report.missing if r.state == 'lost']
    parts = []
    if lost:
        parts.append(f'not in the plain plotter: {", ".join(lost)}')
    for name, count in dropped.items():
        parts.append(
            f'{count} of {name}, the smallest on the screen, are left out: increase triangles'
        )
    if parts:
        warn('; '.join(parts))
