"""What a picture depends on: of an actor, of a light."""

from __future__ import annotations

from pvibr.core._vtk import address

# Textures that a property has by name: VTK lists none.
_TEXTURES = tuple(
    f'{name}Tex'
    for name in ('albedo', 'material', 'normal', 'emissive', 'coatNormal', 'anisotropy')
)


def textures_of(actor) -> list:
    """Return the textures of an actor and of its material."""
    prop, found = actor.GetProperty(), [actor.GetTexture()]
    if prop.GetNumberOfTextures():
        found += [prop.GetTexture(name) for name in _TEXTURES]
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
