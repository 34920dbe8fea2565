"""The view of another camera as a texture, for monitors, mirrors and insets."""

from __future__ import annotations

from typing import Any

import numpy as np

from pvibr.core import _vtk
from pvibr.core.arguments import checked_numbers
from pvibr.core.effect import Effect
from pvibr.core.params import Param
from pvibr.effects.reflections import through_rectangle
from pvibr.gl import MipTexture, Quad, Target, Texture, nbytes_of, release
from pvibr.gl import enums as gl
from pvibr.gl.drawer import Drawer
from pvibr.gl.mipmaps import copy
from pvibr.maths._checks import size_of
from pvibr.maths.camera_views import view_of
from pvibr.maths.cameras import as_camera
from pvibr.maths.filled_texels import straight
from pvibr.maths.vectors import unit_vectors
from pvibr.maths.views import View, frustum, look_along, may_see
from pvibr.things.casters import Casters, Choice
from pvibr.things.content_key import lights_key
from pvibr.things.draw_order import in_order
from pvibr.things.seen_from import seen_from

_FINE = 2  # supersampling along a side
_NEAR_IS_WHITE = """uniform sampler2D depth; uniform vec2 planes; uniform int parallel;
void main()
{
  float d = texture(depth, uv).r;
  float z = parallel == 1 ? mix(planes.x, planes.y, d)
    : planes.x * planes.y / (planes.y - d * (planes.y - planes.x));
  float white = d < 1.0 ? (planes.y - z) / (planes.y - planes.x) : 0.0;
  gl_FragData[0] = vec4(vec3(white), 1.0);
}
"""


class LiveTexture(Effect):
    """Render the view of another camera to a texture, whenever that view changes.

    ``actor.texture = live.texture`` shows it on a mesh with texture coordinates; it is also an
    image for `Projector`, `ImageOverlay`, `Backdrop` and `ShaderEffect`. Live textures in its
    view, itself included, are rendered for it, down to `recursion` levels. Points and lines have
    the same width in pixels as in the window. The texture has mip levels. Volumes, annotations and
    image effects are omitted. Camera lights follow this camera. If the alpha of the background is
    below 1, meshes with the texture are translucent.

    Parameters
    ----------
    camera : pyvista.Camera, Pinhole or Orthographic
        Camera to render from; a ``pyvista.Camera`` may move.
    actors : None, callable or sequence, optional
        Actors and things to render, or a function that returns True for them; by default all.
    size : tuple of 2 int, optional
        Width and height in texels.
    **settings
        Values of the settings.

    Attributes
    ----------
    texture : vtkTexture
        For ``actor.texture``.
    draws : int
        Number of renders so far.

    Raises
    ------
    ValueError
        If the camera is invalid, or the size is not two positive integers.

    Examples
    --------
    >>> import pyvista as pv
    >>> import pvibr
    >>> pl = pv.Plotter(off_screen=True)
    >>> _ = pl.add_mesh(pv.Sphere())
    >>> camera = pv.Camera()
    >>> camera.position, camera.focal_point = (4, 0, 0), (0, 0, 0)
    >>> live = pl.ibr.add(pvibr.LiveTexture(camera, size=(64, 64)))
    >>> monitor = pl.add_mesh(pv.Plane(center=(0, 0, 1)), lighting=False)
    >>> monitor.texture = live.texture
    >>> pl.show(auto_close=False)
    >>> pl.render()
    >>> live.draws > 0
    True
    >>> pl.close()
    """

    web = 'lost', 'is rendered in each frame; a browser shows the last one'
    what = Param(
        'color',
        'Content: colours, or depth as gray, white at the near plane.',
        choices=('color', 'depth'),
    )
    background = Param(
        None,
        "Background colour, RGBA, by default the subplot's; alpha 0 isolates the actors.",
        range='[0, 1]',
        kind=tuple,
    )

    recursion = Param(
        1,
        'Levels of live textures within live textures; each level renders them again.',
        range='[0, 16]',
    )

    actors = Choice()

    def __init__(self, camera, actors=None, size=(512, 512), **settings):
        self.camera, self.actors, self.size = camera, actors, size_of(size)
        super().__init__(**settings)
        if camera is not None:
            as_camera(camera, self.size)
        self.texture = _vtk.vtkOpenGLTexture()
        self.texture.InterpolateOn()
        self.texture.SetInputData(_white())  # until it is rendered
        self.draws = 0
        self._drawer: Any = None
        self._targets: dict[str | int, Target] = {}
        self._texture: Any = None
        self._depth_quad: Quad | None = None
        self._state_key: tuple = ()
        self._channels = 0
        self._shows_other_view = False

    _flipped = False

    FOR_USERS = ('image',)

    @property
    def shown(self) -> Texture | None:
        """The texture of its picture, None if it is in no subplot."""
        return self._texture

    def image(self) -> np.ndarray:
        """Return its current picture.

        Returns
        -------
        numpy.ndarray, shape (height, width, 4), uint8
            Top row first.

        Raises
        ------
        RuntimeError
            If it is in no subplot or not rendered yet.
        """
        if 'whole' not in self._targets:
            raise RuntimeError(f'{self.name} has no picture: add it to a subplot and render')
        whole = self._targets['whole']
        whole.window.MakeCurrent()
        picture = np.ascontiguousarray(whole.colors[0].download()[::-1])
        return picture if self._channels == 3 else straight(picture)

    # -- the life of an effect ----------------------------------------------------------------

    def prepare(self, frame):
        """Render it if it is stale."""
        self.allocate(frame)
        state_key = self._light_key(frame), self.scene_key(frame, self.recursion)
        if self._state_key == state_key:
            return
        self._draw(frame, self.recursion)
        self._copy('drawn', 'whole')
        self._shows_other_view = True
        for live in self._lives():
            live.show_own()
        self.texture.Modified()
        self.draws += 1
        self.pipeline.surfaces.settle()
        # Computed again, as things may have created actors for this view.
        self._state_key = state_key[0], self.scene_key(frame, self.recursion)

    def _light_key(self, frame):
        """Return a value that changes with the lights, camera lights included."""
        return lights_key(frame.renderer)

    def picture(self, frame, depth, lamp) -> Target:
        """Render it for another view; beyond the recursion depth only its background."""
        self.allocate(frame)
        if depth >= 0 and self.needed(frame) is True:
            self._draw(frame, depth, lamp)
            return self._copy('drawn', depth)
        with self._target(depth).drawing(clear=self._clear_color(frame)):
            return self._target(depth)

    # -- rendering ----------------------------------------------------------------------------

    def _casters(self) -> Casters:
        things = [t for t in self.pipeline.things if t.enabled]
        return self.pipeline.surfaces.casters(self.actors, things)

    def _lives(self) -> list[LiveTexture]:
        return [e for e in self.pipeline.effects if isinstance(e, LiveTexture) and e.enabled]

    def _within(self, casters, view) -> list[LiveTexture]:
        """Return the live textures in a view, projected ones and itself included."""
        projected = [live for e in self._scene_effects() for live in e.lives]
        return [
            live
            for live in self._lives()
            if live in projected or may_see(view, casters.wearing(live.texture)).any()
        ]

    def _view(self, frame, bounds) -> View | None:
        """Return its view, None if nothing is in front of it."""
        # With this resolution the margin vanishes: the picture ends where the camera's does.
        return view_of(as_camera(self.camera, self.size), bounds, 1e12)

    def scene_key(self, frame, depth) -> tuple:
        """Return a value that changes with its view of the scene."""
        if depth < 0 or self.needed(frame) is not True:
            return self._clear_color(frame)
        casters = self._casters()
        view = self._view(frame, casters.bounds())
        effects = tuple((id(e), e.content_key()) for e in self._scene_effects())
        own_key = casters.key(), effects, self.revision, self._clear_color(frame)
        if view is None:
            return own_key
        inner_frame, lives = frame.elsewhere(view, self.size), self._within(casters, view)
        return *own_key, view.key(), [live.scene_key(inner_frame, depth - 1) for live in lives]

    def _scene_effects(self):
        """Return the effects that depend on the view: shadows, projectors, user effects."""
        return [
            e
            for e in self.pipeline.effects
            if e.enabled
            and not e.is_image_effect
            and e not in self.pipeline.things
            and not isinstance(e, LiveTexture)
        ]

    def _clear_color(self, frame) -> tuple:
        """Return the background, premultiplied by alpha as all that is blended over it."""
        if self.what == 'depth':
            return 0.0, 0.0, 0.0, 1.0
        *color, alpha = self.background or (*frame.renderer.GetBackground(), 1.0)
        return *(alpha * channel for channel in color), alpha

    def _draw(self, frame, depth, light_view=None):
        """Render it, after the live textures in it, with camera lights at the view `lamp`."""
        casters, clear_color = self._casters(), self._clear_color(frame)
        view = self._view(frame, casters.bounds())
        target = self._target('drawn')
        if view is None:
            with target.drawing(clear=clear_color):
                return
        inner_frame = frame.elsewhere(view, (target.width, target.height))
        light_view = self._lamp(view, light_view)
        lives = self._within(casters, view)
        pictures = [live.picture(inner_frame, depth - 1, light_view) for live in lives]
        for live, picture in zip(lives, pictures, strict=True):
            live.show(picture)
        effects = [e for e in self._scene_effects() if e.needed(inner_frame) is True]
        for effect in effects:
            effect.prepare(inner_frame)
        with seen_from(casters.things, inner_frame), target.drawing(clear=clear_color):
            thing_actors = []
            for item in casters.things:
                ready = item.needed(inner_frame) is True
                thing_actors += item.draws(inner_frame) if ready else item.drawn()
            thing_actors = in_order(thing_actors, casters.things)
            self._drawer.light_from(light_view)
            self._drawer.look(view, (0, 0, *inner_frame.size))
            frame.window.GetState().vtkglBlendFuncSeparate(*gl.OVER)  # of soft edges
            self._drawer.draw([*casters.actors, *thing_actors])
            with self._drawer.blending('over'):
                self._drawer.draw([*casters.translucent, *thing_actors], translucent=True)
        for effect in effects:
            effect.finish(inner_frame)
        self._drawer.done()
        frame.renderer.UpdateLightsGeometryToFollowCamera()
        if self.what == 'depth':
            self._show_depth(frame, view)

    def _lamp(self, view, _lamp) -> View | None:
        """Return the view that camera lights follow, None for the subplot's."""
        return view

    def _show_depth(self, frame, view):
        if self._depth_quad is None:
            self._depth_quad = Quad(frame.window, _NEAR_IS_WHITE, f'{self.name} depth')
        draw_target = self._target('drawn')
        with self._target('gray').drawing():
            uniforms = {'planes': (view.near, view.far), 'parallel': int(view.parallel)}
            self._depth_quad.draw(uniforms, {'depth': draw_target.depth})
        copy(self._target('gray'), draw_target)

    # -- memory ---------------------------------------------------------------------------------

    def allocate(self, frame):
        """Allocate its textures unless they have the right format."""
        # VTK draws textures with an alpha channel in its translucent pass.
        channels = 4 if self._clear_color(frame)[3] < 1 else 3
        if self._texture is not None and self._channels == channels:
            return
        self.release()
        self._channels = channels
        self._drawer = Drawer(frame.renderer)
        width, height = self.size
        texels = np.zeros((height, width, channels), np.uint8)
        self._texture = MipTexture(frame.window).upload(texels)
        self.texture.SetTextureObject(self._texture.object)

    def _target(self, name) -> Target:
        """Return a target: 'drawn', 'gray', 'whole', or by recursion depth."""
        if name not in self._targets:
            scale = _FINE if name in ('drawn', 'gray') else 1
            width, height = (scale * side for side in self.size)
            window, has_depth = self._drawer.window, name == 'drawn'
            self._targets[name] = Target(window, width, height, ('rgba8',), depth=has_depth)
        return self._targets[name]

    def _copy(self, source, target) -> Target:
        copy(self._target(source), self._target(target), turned=self._flipped)
        return self._target(target)

    def show(self, picture):
        """Copy a picture to the texture of its actors."""
        if self._channels == 3:
            self._texture.take(picture)
        else:
            self._texture.dilate(picture.colors[0], keep=True)
        self._shows_other_view = True

    def show_own(self):
        """Restore the picture of the window's view, if there is one."""
        if self._shows_other_view and 'whole' in self._targets:
            self.show(self._targets['whole'])
        self._shows_other_view = False

    def release(self):
        """Free what it holds on the GPU; the context is current."""
        self.texture.SetTextureObject(None)
        release(*self._targets.values(), self._texture, self._depth_quad, self._drawer)
        self._targets, self._state_key = {}, ()
        self._depth_quad = self._drawer = self._texture = None

    def report(self) -> dict:
        """Return bytes and the number of renders."""
        return {'bytes': nbytes_of(*self._targets.values(), self._texture), 'draws': self.draws}


class Mirror(LiveTexture):
    """Render the reflection in a flat mirror, for the camera of its subplot.

    The mirror is the rectangle ``corner + u * right + v * up``; show ``mirror.texture`` on a mesh
    there with texture coordinates (u, v). Actors behind it are not reflected. The camera may be
    perspective or parallel.

    Parameters
    ----------
    corner : actor or array_like of shape (3,)
        World units; or the actor of a flat mesh with texture coordinates, such as `pv.Plane`, in
        place of all three.
    right, up : array_like of shape (3,), optional
        World units, perpendicular, as seen by a viewer in front of it.
    actors : None, callable or sequence, optional
        Actors and things to render, or a function that returns True for them; by default all.
    size : tuple of 2 int, optional
        Width and height in texels.
    **settings
        See the Params of :class:`LiveTexture`.

    Raises
    ------
    ValueError
        If right and up are not perpendicular or one is zero; if the mesh of an actor is not flat
        or has no texture coordinates.
    """

    def __init__(self, corner, right=None, up=None, actors=None, size=(512, 512), **settings):
        if isinstance(corner, _vtk.vtkActor):
            corner, right, up = _sides(corner)
        if right is None or up is None:
            raise TypeError('right and up must be given unless corner is an actor, got None')
        self.corner = checked_numbers('corner', corner, (3,))
        self.right = checked_numbers('right', right, (3,))
        self.up = checked_numbers('up', up, (3,))
        unit_sides = unit_vectors(np.stack([self.right, self.up]))
        if not unit_sides.any(1).all() or abs(unit_sides[0] @ unit_sides[1]) > 1e-6:
            raise ValueError(f'right and up must be perpendicular, got {right!r} and {up!r}')
        super().__init__(None, actors, size, **settings)

    # Rendered from behind, where left and right are swapped; u still grows along `right`.
    _flipped = True

    def needed(self, frame) -> bool | str:
        """Return True if the camera is in front of it, or faces it in parallel projection."""
        normal = np.cross(self.right, self.up)
        toward = frame.view_from_world[2, :3] if frame.parallel else frame.eye - self.corner
        return bool(normal @ toward > 0) or 'the camera is behind it'

    def _light_key(self, frame):
        return lights_key(frame.renderer, frame.view.key())

    def _lamp(self, view, light_view) -> View | None:
        return light_view

    def _view(self, frame, bounds) -> View | None:
        right = self.right / np.linalg.norm(self.right)
        up = self.up / np.linalg.norm(self.up)
        normal = np.cross(right, up)
        if frame.parallel:
            rectangle = self.corner, self.right, self.up
            return through_rectangle(rectangle, -frame.view_from_world[2, :3], bounds)
        eye_distance = float(normal @ (frame.eye - self.corner))
        reflected_eye = frame.eye - 2 * eye_distance * normal
        view_from_world = look_along(reflected_eye, normal, up)
        ends = np.stack([self.corner, self.corner + self.right + self.up]) - reflected_eye
        # Just beyond its plane, else it would see its own back.
        near_plane = 1.001 * eye_distance
        far_plane = 1.001 * max(near_plane, _farthest(view_from_world, bounds))
        slopes = view_from_world[:2, :3] @ ends.T / eye_distance
        clip_from_view = frustum(slopes.min(axis=1), slopes.max(axis=1), near_plane, far_plane)
        return View(view_from_world, clip_from_view, near_plane, far_plane, False)


def _white():
    image = _vtk.vtkImageData()
    image.SetDimensions(1, 1, 1)
    image.AllocateScalars(_vtk.VTK_UNSIGNED_CHAR, 3)
    for channel in range(3):
        image.SetScalarComponentFromDouble(0, 0, 0, channel, 255)
    return image


def _farthest(view, bounds) -> float:
    if not len(bounds):
        return 0.0
    lower, upper = bounds[:, 0::2].min(axis=0), bounds[:, 1::2].max(axis=0)
    forward = -view[2, :3]
    return float(np.where(forward > 0, upper, lower) @ forward - view[2, 3])


def _sides(actor):
    """Return corner, right and up of a flat actor, where its texture coordinates are 0 and 1."""
    data = actor.GetMapper().GetInput()
    uv_array = None if data is None else data.GetPointData().GetTCoords()
    if uv_array is not None:
        uv = _vtk.vtk_to_numpy(uv_array)[:, :2].astype(float)
        points = _vtk.vtk_to_numpy(data.GetPoints().GetData()).astype(float)
        design_matrix = np.column_stack([np.ones(len(uv)), uv])
        mesh_sides, _, rank, _ = np.linalg.lstsq(design_matrix, points, rcond=None)
        size = np.linalg.norm(np.ptp(points, axis=0))
        if rank == 3 and np.abs(design_matrix @ mesh_sides - points).max() <= 1e-4 * size:
            matrix = np.reshape(actor.GetMatrix().GetData(), (4, 4))
            mesh_sides = mesh_sides @ matrix[:3, :3].T
            return mesh_sides[0] + matrix[:3, 3], mesh_sides[1], mesh_sides[2]
    raise ValueError(
        f'corner must be a flat mesh with texture coordinates, such as pv.Plane, got {actor!r:.60}'
    )
