"""Keys that change with what a picture depends on: actors, lights, the background."""

from __future__ import annotations

from pvibr.core._vtk import address
from pvibr.core.passes import passes_of
from pvibr.core.plotters import is_inner
from pvibr.textures.material_textures import PROPERTY_TEXTURES


def textures_of(actor) -> list:
    """Return the textures of an actor and of its material."""
    prop, textures = actor.GetProperty(), [actor.GetTexture()]
    if prop.GetNumberOfTextures():
        textures += [prop.GetTexture(name) for name in PROPERTY_TEXTURES]
    return [texture for texture in textures if texture is not None]


def images_of(actor) -> list:
    """Return the images of the textures of an actor and its material."""
    return [image for texture in textures_of(actor) for image in _inputs(texture)]


def planes_of(actor) -> list:
    """Return the clipping planes of an actor's mapper."""
    mapper = actor.GetMapper()
    return list((mapper and mapper.GetClippingPlanes()) or ())


def parts_of(actor) -> list:
    """Return what an actor's picture depends on beyond the actor's own modification time."""
    return [*unclipped_parts_of(actor), *planes_of(actor)]


def unclipped_parts_of(actor) -> list:
    """Return the same without clipping planes, of which the mapper's time counts their number."""
    mapper, input_data = actor.GetMapper(), []
    if mapper is not None:
        input_data = _inputs(mapper) + [
            leaf for data in _inputs(mapper) for leaf in leaves_of(data)
        ]
    return [part for part in (mapper, *input_data, *images_of(actor)) if part is not None]


def look_key(actor) -> tuple:
    """Return a value that changes with an actor's appearance, but not with its transform."""
    look_objects = actor.GetProperty(), actor.GetBackfaceProperty(), *textures_of(actor)
    all_parts = *look_objects, *parts_of(actor)
    is_visible = bool(actor.GetVisibility())
    return is_visible, *((address(t), t.GetMTime()) for t in all_parts if t is not None)


def light_key(light) -> tuple:
    """Return a value that changes with a light, except by following the camera."""
    placement: tuple = ()
    if not light.LightTypeIsHeadlight():
        placement = light.GetPosition(), light.GetFocalPoint()
    matrix = light.GetTransformMatrix()
    if light.LightTypeIsSceneLight() and matrix is not None:
        placement = *placement, matrix.GetData()
    identity = address(light), light.GetSwitch(), light.GetLightType()
    return *identity, *placement, colors_of(light), shape_of(light)


def shape_of(light) -> tuple:
    """Return a light's cone and attenuation."""
    cone_shape = light.GetPositional(), light.GetConeAngle(), light.GetExponent()
    return *cone_shape, tuple(light.GetAttenuationValues())


def colors_of(light) -> list:
    """Return a light's diffuse, specular and ambient colour, times its intensity."""
    colors = light.GetDiffuseColor(), light.GetSpecularColor(), light.GetAmbientColor()
    return [[light.GetIntensity() * c for c in color] for color in colors]


def lights_key(renderer, camera=None) -> tuple:
    """Return a value that changes with a renderer's lights; `camera` counts if any follows it."""
    lights = list(renderer.GetLights())
    following = any(x.GetSwitch() and not x.LightTypeIsSceneLight() for x in lights)
    return *map(light_key, lights), camera if following else None


def scene_key(pipeline) -> tuple:
    """Return a value that changes with a subplot's content, not with camera, size and time."""
    renderer = pipeline.renderer
    things = [thing for thing in pipeline.things if thing.enabled]
    casters = pipeline.surfaces.casters(None, things)
    own_addresses = {
        *casters.addresses,
        *(address(p) for t in things for p in (*t.actors(), *t.props)),
    }
    props = [p for p in renderer.GetViewProps() if p.GetVisibility() and not is_inner(p)]
    drawn_props = pipeline.surfaces.plain_actors.of_all(props)
    other_props = [p for p in drawn_props if address(p) not in own_addresses]
    return (
        casters.key(),
        [(address(p), p.GetRedrawMTime()) for p in other_props],
        lights_key(renderer),
        background_key(renderer),
        [(address(p), p.GetMTime()) for p in passes_of(renderer)],
        [(id(e), e.enabled, e.content_key()) for e in pipeline.effects if e not in things],
    )


def background_key(renderer) -> tuple:
    """Return a value that changes with a renderer's background and draw settings."""
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
    """Return the input data of an algorithm."""
    ports = range(algorithm.GetNumberOfInputPorts())
    return [algorithm.GetInputDataObject(k, 0) for k in ports if _is_connected(algorithm, k)]


def _is_connected(algorithm, port) -> bool:
    return algorithm.GetNumberOfInputConnections(port) > 0


def leaves_of(data) -> list:
    """Return the blocks of a composite dataset, whose own time ignores theirs; else none."""
    leaves: list = []
    if data is not None and data.IsA('vtkCompositeDataSet'):
        iterator = data.NewIterator()
        while not iterator.IsDoneWithTraversal():
            leaves.append(iterator.GetCurrentDataObject())
            iterator.GoToNextItem()
    return leaves
