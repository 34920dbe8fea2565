"""What a picture depends on: of an actor, of a light."""

from __future__ import annotations

from pvibr.core._vtk import address
from pvibr.core.passes import passes_of
from pvibr.core.plotters import is_inner
from pvibr.meshes.materials import PROPERTY_TEXTURES


def textures_of(actor) -> list:
    """Return the textures of an actor and of its material."""
    prop, found = actor.GetProperty(), [actor.GetTexture()]
    if prop.GetNumberOfTextures():
        found += [prop.GetTexture(name) for name in PROPERTY_TEXTURES]
    return [texture for texture in found if texture is not None]


def images_of(actor) -> list:
    """Return the images of the textures of an actor and of its material."""
    return [image for texture in textures_of(actor) for image in _inputs(texture)]


def parts_of(actor) -> list:
    """Return what a picture of an actor shows beyond the actor's own time."""
    mapper, inputs = actor.GetMapper(), []
    if mapper is not None:
        inputs = _inputs(mapper) + [leaf for data in _inputs(mapper) for leaf in _leaves(data)]
    planes = None if mapper is None else mapper.GetClippingPlanes()
    return [
        thing
        for thing in (mapper, *inputs, *images_of(actor), *(planes or ()))
        if thing is not None
    ]


def look_key(actor) -> tuple:
    """Return what changes with the looks of an actor, its place left out."""
    own = actor.GetProperty(), actor.GetBackfaceProperty(), *textures_of(actor)
    things = *own, *parts_of(actor)
    shown = bool(actor.GetVisibility())
    return shown, *((address(t), t.GetMTime()) for t in things if t is not None)


def light_key(light) -> tuple:
    """Return what changes with a light, but for the place that the camera gives it."""
    place: tuple = ()
    if not light.LightTypeIsHeadlight():
        place = light.GetPosition(), light.GetFocalPoint()
    matrix = light.GetTransformMatrix()
    if light.LightTypeIsSceneLight() and matrix is not None:
        place = *place, matrix.GetData()
    kind = address(light), light.GetSwitch(), light.GetLightType()
    return *kind, *place, colors_of(light), shape_of(light)


def shape_of(light) -> tuple:
    """Return cone and attenuation of a light."""
    cone = light.GetPositional(), light.GetConeAngle(), light.GetExponent()
    return *cone, tuple(light.GetAttenuationValues())


def colors_of(light) -> list:
    """Return the colours of a light times its intensity: diffuse, specular and ambient."""
    colors = light.GetDiffuseColor(), light.GetSpecularColor(), light.GetAmbientColor()
    return [[light.GetIntensity() * c for c in color] for color in colors]


def lights_key(renderer, camera=None) -> tuple:
    """Return what changes with the lights of a renderer, those included that follow a camera."""
    lights = list(renderer.GetLights())
    follow = any(light.GetSwitch() and not light.LightTypeIsSceneLight() for light in lights)
    return *map(light_key, lights), camera if follow else None


def scene_key(pipeline) -> tuple:
    """Return what changes with anything that a subplot shows, camera, size and time left out."""
    renderer = pipeline.renderer
    things = [thing for thing in pipeline.things if thing.enabled]
    casters = pipeline.surfaces.casters(None, things)
    known = {*casters.addresses, *(address(p) for t in things for p in (*t.actors(), *t.props))}
    props = [p for p in renderer.GetViewProps() if p.GetVisibility() and not is_inner(p)]
    others = [p for p in props if p.IsA('vtkProp3D') and address(p) not in known]
    return (
        casters.key(),
        [(address(p), p.GetRedrawMTime()) for p in others],
        lights_key(renderer),
        background_key(renderer),
        [(address(p), p.GetMTime()) for p in passes_of(renderer)],
        [(id(e), e.enabled, e.content_key()) for e in pipeline.effects if e not in things],
    )


def background_key(renderer) -> tuple:
    """Return what changes with the background of a renderer, and with how it draws."""
    textures = renderer.GetBackgroundTexture(), renderer.GetEnvironmentTexture()
    return (
        renderer.GetBackground(),
        renderer.GetBackground2(),
        renderer.GetGradientBackground(),
        renderer.GetTexturedBackground(),
        renderer.GetBackgroundAlpha(),
        renderer.GetAmbient(),
        renderer.GetUseImageBasedLighting(),
        renderer.GetUseDepthPeeling(),
        renderer.GetUseFXAA(),
        renderer.GetUseHiddenLineRemoval(),
        [(address(t), t.GetMTime()) for t in textures if t is not None],
    )


def _inputs(algorithm) -> list:
    """Return the data that come into an algorithm."""
    ports = range(algorithm.GetNumberOfInputPorts())
    return [algorithm.GetInputDataObject(k, 0) for k in ports if _fed(algorithm, k)]


def _fed(algorithm, port) -> bool:
    return algorithm.GetNumberOfInputConnections(port) > 0


def _leaves(data) -> list:
    """Return the blocks of a composite dataset, whose time has not theirs."""
    found: list = []
    if data is not None and data.IsA('vtkCompositeDataSet'):
        blocks = data.NewIterator()
        while not blocks.IsDoneWithTraversal():
            found.append(blocks.GetCurrentDataObject())
            blocks.GoToNextItem()
    return found
