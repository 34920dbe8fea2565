"""Buffers of a frame besides colour: depth, normals, object ids."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from pvibr.core._vtk import address
from pvibr.core.arguments import check_one_of
from pvibr.core.effect import Effect
from pvibr.gl import Quad, Target, Texture, nbytes_of, release, set_fragment_uniforms
from pvibr.gl.drawer import Drawer
from pvibr.gl.feature import Feature, FeatureSet
from pvibr.gl.scene_pass import is_marker
from pvibr.gl.target import fitting_target
from pvibr.things.actor_watch import updated_data
from pvibr.things.casters import Surfaces
from pvibr.things.content_key import leaves_of
from pvibr.things.draw_order import Stage
from pvibr.things.frame import Frame
from pvibr.things.seen_from import seen_from
from pvibr.things.splats import is_emissive

NAMES = ('depth', 'normal', 'id', 'color')

_SURFACE = 2  # VTK_SURFACE
# A second colour attachment, written in the scene's own pass: x and y of the normal (2 for none)
# and the id, negated where the normal faces away. VTK blends all attachments, so alpha is 1.
# VTK computes normals only where it lights; cards and spheres define IBR_NORMAL.
_WRITE = """#ifdef IBR_NORMAL
#define IBR_BUFFERED normalize(IBR_NORMAL)
#else
#define IBR_BUFFERED {normal}
#endif
  if (ibr_id > 0.5)
    gl_FragData[1] = vec4(IBR_BUFFERED.xy, IBR_BUFFERED.z < 0.0 ? -ibr_id : ibr_id, 1.0);
  else if (ibr_id < -0.5)
    gl_FragData[1] = vec4(0.0);  // blended: nothing
//VTK::DepthPeeling::Impl
"""
_LIT, _UNLIT = (
    Feature(name, fragment={'VTK::DepthPeeling::Impl': _WRITE.replace('{normal}', normal)})
    for name, normal in (('buffer_lit', 'normalVCVSOutput'), ('buffer_unlit', 'vec3(2.0)'))
)
_LINEAR = """uniform sampler2D depth; uniform vec2 planes; uniform int parallel;
void main()
{
  float d = texture(depth, uv).r;
  float z = parallel == 1 ? mix(planes.x, planes.y, d)
    : planes.x * planes.y / (planes.y - d * (planes.y - planes.x));
  gl_FragData[0] = vec4(d < 1.0 ? z : -1.0);
}
"""


class Geometry(NamedTuple):
    """Normals, ids and depth of the opaque surfaces in view, as textures."""

    surface: Texture
    depth: Texture
    numbered: list
    origin: tuple[int, int] = (0, 0)


class _Numbers:
    """Object ids that the actors' programs write as a second colour."""

    def __init__(self, renderer):
        self.renderer = renderer
        self._attached = FeatureSet()
        self._numbered: list = []

    def put(self, numbered_actors):
        """Set ids, given as (actor, id) pairs, until `clear`."""
        light_switches = [light.GetSwitch() for light in self.renderer.GetLights()]
        shader_times = []

        def features_of(actor):
            shader_times.append((actor, actor.GetShaderProperty().GetShaderMTime()))
            return (_LIT if _is_lit(actor, any(light_switches)) else _UNLIT,)

        def version_of(actor):
            return actor.GetMTime(), *_data_time(actor.GetMapper()), light_switches

        numbered_actors = list(numbered_actors)
        self._attached.attach([actor for actor, _ in numbered_actors], features_of, version_of)
        changed_mappers = {
            actor.GetMapper()
            for actor, time in shader_times
            if actor.GetShaderProperty().GetShaderMTime() != time
        }
        # A shared mapper asks only its newest actor whether to rebuild its programs.
        for actor in self._attached.actors() if changed_mappers else ():
            if actor.GetMapper() in changed_mappers:
                actor.GetShaderProperty().Modified()
        for actor, number in numbered_actors:
            set_fragment_uniforms([actor], {'ibr_id': float(number)})
        self._numbered += [actor for actor, _ in numbered_actors]

    def clear(self):
        """Reset the ids: VTK's own passes use second colours, too."""
        set_fragment_uniforms(self._numbered, {'ibr_id': 0.0})
        self._numbered = []

    def release(self):
        self.clear()
        self._attached.clear()


def _data_time(mapper):
    """Return the modification times of a mapper and its data, brought up to date."""
    input_data = updated_data(mapper)
    return mapper.GetMTime(), input_data.GetMTime() if input_data is not None else 0


def _is_lit(actor, any_light) -> bool:
    """Return whether every program of an actor has a normal."""
    prop, mapper = actor.GetProperty(), actor.GetMapper()
    if not prop.GetLighting() or not any_light or mapper.IsA('vtkPointGaussianMapper'):
        return False
    port = int(mapper.IsA('vtkGlyph3DMapper'))  # whose second input is what is drawn
    connections = range(mapper.GetNumberOfInputConnections(port))
    drawn_data = [mapper.GetInputDataObject(port, k) for k in connections]
    blocks = [block for data in drawn_data for block in leaves_of(data) or [data]]
    return all(_has_normals(prop, block) for block in blocks)


def _has_normals(prop, data) -> bool:
    """Return whether every program that draws a dataset with lighting has a normal."""
    if data is None or not data.IsA('vtkDataSet'):
        return data is not None
    if prop.GetInterpolation() and data.GetPointData().GetNormals() is not None:
        return True
    if prop.GetRepresentation() != _SURFACE:
        return False
    return not (data.IsA('vtkPolyData') and data.GetNumberOfVerts() + data.GetNumberOfLines())


def _takes_replacements(actor) -> bool:
    """Return whether replacements reach an actor's program: not if all of its text is given."""
    return not actor.GetShaderProperty().HasFragmentShaderCode()


class Drawn:
    """Geometry of chosen actors, drawn in a separate pass."""

    def __init__(self, renderer, plain_actors):
        self._numbers = _Numbers(renderer)
        self._drawer = Drawer(renderer)
        self._surfaces = Surfaces(renderer, plain_actors)
        self._target: Any = None

    @property
    def nbytes(self) -> int:
        """Bytes on the GPU."""
        return nbytes_of(self._target)

    def draw(self, frame, things=(), choice=None) -> Geometry:
        """Draw a frame."""
        self._surfaces.begin()  # with the levels of detail that VTK has drawn
        actors, chosen_things = self._surfaces.chosen(choice, things)
        numbered, numbers = self._surfaces.numbered(actors.values(), chosen_things)
        casting_frame = replace(frame, casting=True, own=False)
        visible_things = [t for t in chosen_things if t.enabled and t.needed(frame) is True]
        self._target = target = fitting_target(
            self._target, self._drawer.window, frame.size, ('rgba8', 'rgba32f'), depth=True
        )
        with seen_from(visible_things, casting_frame), target.drawing(clear=(0.0, 0.0, 0.0, 0.0)):
            self._drawer.look(frame.view, (0, 0, *frame.size))
            for object_id, actor in zip(numbers, actors.values(), strict=True):
                if (
                    actor.GetVisibility()
                    and _takes_replacements(actor)
                    and not is_emissive(actor.GetMapper())
                ):
                    self._draw([actor], object_id)
            for object_id, thing in enumerate(chosen_things, max(numbers, default=0) + 1):
                if thing in visible_things:
                    self._draw(thing.draws(casting_frame), object_id)
        self._drawer.done()
        return Geometry(target.colors[1], target.depth, numbered)

    def _draw(self, actors, object_id):
        self._numbers.put((actor, object_id) for actor in actors)
        self._drawer.draw(actors)
        self._numbers.clear()

    def release(self):
        """Free the GPU's memory; the context must be alive."""
        release(self._numbers, self._target, self._drawer)
        self._target = None


class _Shared:
    """Geometry written in the scene's own pass, where possible."""

    def __init__(self, renderer, plain_actors):
        self.renderer = renderer
        self._numbers = _Numbers(renderer)
        self._surfaces = Surfaces(renderer, plain_actors)
        self._texture: Any = None
        self._numbered: list = []

    def attach(self, frame, scene, things):
        """Attach it to the scene's pass."""
        self._texture = None
        actors, things = self._surfaces.chosen(None, things)
        if not self._is_free(scene, actors, things):
            return
        self._numbered, numbers = self._surfaces.numbered(actors.values(), things)
        numbered_actors = [
            (actor, -1 if is_emissive(actor.GetMapper()) else object_id)
            for object_id, actor in zip(numbers, actors.values(), strict=True)
            if actor.GetVisibility() and not actor.HasTranslucentPolygonalGeometry()
        ]
        for object_id, thing in enumerate(things, max(numbers, default=0) + 1):
            soft_edges = {address(actor) for key, actor in thing.order if key[0] == Stage.FRINGE}
            numbered_actors += [
                (actor, -1 if address(actor) in soft_edges else object_id)
                for actor in thing.drawn()
                if not actor.HasTranslucentPolygonalGeometry()  # peeling uses the attachment
            ]
        self._numbers.put(numbered_actors)
        self._texture = scene.attach_surfaces(frame)

    def _is_free(self, scene, actors, things) -> bool:
        """Return whether every opaque draw can write the second colour."""
        renderer = self.renderer
        obstacles = (
            renderer.GetPass() is not None,
            renderer.GetUseHiddenLineRemoval(),
            renderer.GetGradientBackground(),
            renderer.GetTexturedBackground(),
            renderer.GetBackgroundAlpha() > 0,
            scene.framebuffer.GetMultiSamples() > 1,
        )
        return not any(obstacles) and not any(self._strangers(actors, things))

    def _strangers(self, actors, things):
        own_addresses = {address(a) for t in things for a in (*t.actors(), *t.props)}
        for prop in self.renderer.GetViewProps():
            if prop.GetVisibility() and not prop.IsA('vtkVolume') and not is_marker(prop):
                prop_address = address(prop)
                writes = prop_address in actors and _takes_replacements(prop)
                yield not writes and prop_address not in own_addresses

    def detach(self):
        """Reset the ids after the scene is drawn."""
        self._numbers.clear()

    def geometry(self, frame, picture) -> Geometry | None:
        """Return the geometry, or None if it was not written."""
        if self._texture is None:
            return None
        return Geometry(self._texture, picture.depth, self._numbered, frame.origin)

    def release(self):
        """Detach everything from the actors."""
        self._numbers.release()
        self._texture = None


class Buffers:
    """The buffers of one frame, as textures for effects and as arrays."""

    def __init__(self, renderer, plain_actors):
        self.renderer = renderer
        self._plain_actors = plain_actors
        self._shared: _Shared | None = None
        self._drawn: Drawn | None = None
        self._frame: Frame | None = None
        self._geometry: Any = None

    @property
    def nbytes(self) -> int:
        """Bytes on the GPU."""
        return nbytes_of(self._drawn)

    @property
    def numbered(self) -> list:
        """Actors and things that the ids index."""
        return list(self._geometry.numbered) if self._geometry else []

    def attach(self, frame, scene, things):
        """Write normals and ids in the scene's pass, if possible."""
        self._shared = self._shared or _Shared(self.renderer, self._plain_actors)
        self._shared.attach(frame, scene, things)

    def detach(self):
        """Reset the actors after the frame is drawn."""
        if self._shared is not None:
            self._shared.detach()

    def geometry(self, frame, picture, things) -> Geometry:
        """Return a frame's normals and ids, redrawn if the scene's pass wrote none."""
        if self._frame is not frame:
            from_scene = self._shared.geometry(frame, picture) if self._shared else None
            self._geometry = from_scene or self._redrawn(frame, things)
            self._frame = frame
        return self._geometry

    def depth(self, frame, things) -> Texture:
        """Return the depth of a frame whose VTK passes produce none."""
        if self._frame is not frame:
            self._geometry, self._frame = self._redrawn(frame, things), frame
        return self._geometry.depth

    def _redrawn(self, frame, things):
        self._drawn = self._drawn or Drawn(self.renderer, self._plain_actors)
        return self._drawn.draw(frame, things)

    def array(self, name, frame, picture, things) -> np.ndarray:
        """Return a buffer of a frame as an array, top row first."""
        if name == 'color':
            texels = picture.color.download()
            max_value = 255 if texels.dtype == np.uint8 else 1
            return np.ascontiguousarray(texels[::-1].astype(np.float32) / max_value)
        if name == 'depth':
            view_depth = self._linear_depth(frame, picture)[::-1, :, 0]
            return np.where(view_depth < 0, np.float32(np.inf), view_depth)
        geometry = self.geometry(frame, picture, things)
        (x, y), (width, height) = geometry.origin, picture.size
        texels = geometry.surface.download()[y : y + height, x : x + width][::-1]
        texels = np.where(texels[..., 3:] > 0, texels, 0)
        if name == 'id':
            return np.rint(np.abs(texels[..., 2])).astype(np.int32) - 1
        return _normals(texels)

    def _linear_depth(self, frame, picture):
        width, height = picture.size
        quad = Quad(frame.window, _LINEAR, 'linear depth')
        target = Target(frame.window, width, height, ('r32f',), filter='nearest')
        try:
            with target.drawing():
                clip_planes = {'planes': (frame.near, frame.far), 'parallel': int(frame.parallel)}
                quad.draw(clip_planes, {'depth': picture.depth})
            return target.colors[0].download()
        finally:
            release(target, quad)

    def release(self):
        """Free the GPU's memory; the context must be alive."""
        release(self._shared, self._drawn)
        self._shared = self._drawn = self._frame = self._geometry = None


def _normals(texels):
    """Return the normals in texels of `Geometry.surface`, 0 where there is no surface."""
    x, y = texels[..., 0], texels[..., 1]
    z = np.copysign(np.sqrt(np.maximum(1 - x * x - y * y, 0)), texels[..., 2])
    normal = np.stack([x, y, z], -1)
    normal[(texels[..., 3] == 0) | (x > 1.5)] = 0
    return normal


class Tap(Effect):
    """Reads a buffer of the next frame and leaves the picture unchanged."""

    def __init__(self, buffer):
        check_one_of('name', buffer, NAMES)
        super().__init__()
        self.buffer, self.array = buffer, None
        self.numbered: list = []

    @property
    def surfaces(self) -> bool:
        """Whether it reads normals or ids."""
        return self.buffer in ('normal', 'id')

    def render(self, frame, picture):
        """Read the buffer."""
        buffers = self.pipeline.buffers
        self.array = buffers.array(self.buffer, frame, picture, self.pipeline.things)
        self.numbered = buffers.numbered
