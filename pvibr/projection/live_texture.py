"""The view of another camera as a texture: monitors, mirrors, insets."""

from __future__ import annotations

from typing import Any

import numpy as np

from pvibr.core import _vtk
from pvibr.core.effect import Effect
from pvibr.core.params import Param
from pvibr.gl import MipTexture, Quad, Target, Texture, nbytes_of, release
from pvibr.gl import enums as gl
from pvibr.gl.drawer import Drawer
from pvibr.gl.mipmaps import copy
from pvibr.maths._checks import size_of
from pvibr.maths.arguments import checked_numbers
from pvibr.maths.cameras import as_camera
from pvibr.maths.reflections import through_rectangle
from pvibr.maths.vectors import unit_vectors
from pvibr.maths.views import View, frustum, look_along, may_see
from pvibr.projection.depth_maps import view_of
from pvibr.scene.casters import Casters, Choice
from pvibr.scene.content_key import lights_key
from pvibr.scene.draw_order import in_order
from pvibr.scene.seen_from import seen_from

_FINE = 2  # pixels drawn for each texel, along a side
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
    """Render the view of another camera to a texture, again whenever the view changes.

    ``actor.texture = live.texture`` shows it on a mesh with texture coordinates. It is also an
    image for `Projector`, `ImageOverlay`, `Backdrop` and `ShaderEffect`. Live textures within its
    view, itself included, are drawn for that view, to a depth of `recursion`. Points and lines
    have the same width in pixels as in the window. The texture has mip levels. Volumes,
    annotations and effects on pixels are left out. Camera lights follow this camera. If the alpha
    of the background is below 1, meshes with the texture are translucent.

    Parameters
    ----------
    camera : pyvista.Camera, Pinhole or Orthographic
        The view; a ``pyvista.Camera`` may move.
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
        Number of times that it was rendered.

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
        'color', 'Colours, or depth, white at the near plane.', choices=('color', 'depth')
    )
    background = Param(
        None, "Background colour, RGBA; the subplot's by default.", range='[0, 1]', kind=tuple
    )

    recursion = Param(
        1,
        'Depth to which live textures show one another: each within a picture is drawn for it.',
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
        self.texture.SetInputData(_white())  # where there is no picture
        self.draws = 0
        self._drawer: Any = None
        self._targets: dict[str | int, Target] = {}
        self._texture: Any = None
        self._gray: Quad | None = None
        self._key: tuple = ()
        self._channels = 0
        self._astray = False  # shows a picture for another view

    _flipped = False

    FOR_USERS = ('image',)

    @property
    def shown(self) -> Texture | None:
        """The texture of its picture; None if it is in no subplot."""
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
            If it is in no subplot, or not rendered yet.
        """
        if 'whole' not in self._targets:
            raise RuntimeError(f'{self.name} shows nothing: add it to a subplot and draw a frame')
        whole = self._targets['whole']
        whole.window.MakeCurrent()
        return np.ascontiguousarray(whole.colors[0].download()[::-1])

    # -- the life of an effect ----------------------------------------------------------------

    def prepare(self, frame):
        """Draw it if it is stale."""
        self.allocate(frame)
        key = self._follow(frame), self.scene_key(frame, self.recursion)
        if self._key == key:
            return
        self._draw(frame, self.recursion)
        self._copy('drawn', 'whole')
        self._astray = True
        for live in self._lives():
            live.show_own()
        self.texture.Modified()
        self.draws += 1
        self.pipeline.surfaces.settle()
        # Taken again: things may have made actors for this view.
        self._key = key[0], self.scene_key(frame, self.recursion)

    def _follow(self, frame):
        """Return what changes with the lights, those included that follow a camera."""
        return lights_key(frame.renderer)

    def picture(self, frame, depth, lamp) -> Target:
        """Return its picture as another view shows it: the background alone beyond the depth."""
        self.allocate(frame)
        if depth >= 0 and self.needed(frame) is True:
            self._draw(frame, depth, lamp)
            return self._copy('drawn', depth)
        with self._target(depth).drawing(clear=self._clear_color(frame)):
            return self._target(depth)

    # -- what is drawn ------------------------------------------------------------------------

    def _casters(self) -> Casters:
        things = [t for t in self.pipeline.things if t.enabled]
        return self.pipeline.surfaces.casters(self.actors, things)

    def _lives(self) -> list[LiveTexture]:
        effects = self.pipeline.effects
        return [e for e in effects if isinstance(e, LiveTexture) and e.enabled]

    def _within(self, casters, view) -> list[LiveTexture]:
        """Return the live textures that are seen in a view, projected ones and itself too."""
        projected = [live for e in self._scene_effects() for live in e.lives]
        return [
            live
            for live in self._lives()
            if live in projected or may_see(view, casters.wearing(live.texture)).any()
        ]

    def _view(self, frame, bounds) -> View | None:
        """Return its view, None if nothing is in front of it."""
        # So many texels that there is no margin: the picture ends where the camera's does.
        return view_of(as_camera(self.camera, self.size), bounds, 1e12)

    def scene_key(self, frame, depth) -> tuple:
        """Return a value that changes whenever its view of the scene does."""
        if depth < 0 or self.needed(frame) is not True:
            return self._clear_color(frame)
        casters = self._casters()
        view = self._view(frame, casters.bounds())
        effects = tuple((id(e), e.content_key()) for e in self._scene_effects())
        own = casters.key(), effects, self.revision, self._clear_color(frame)
        if view is None:
            return own
        seen, within = frame.elsewhere(view, self.size), self._within(casters, view)
        return *own, view.key(), [live.scene_key(seen, depth - 1) for live in within]

    def _scene_effects(self):
        """Return the effects that depend on the view: shadows, projectors, those of users."""
        return [
            e
            for e in self.pipeline.effects
            if e.enabled
            and not e.is_image_effect
            and e not in self.pipeline.things
            and not isinstance(e, LiveTexture)
        ]

    def _clear_color(self, frame) -> tuple:
        if self.what == 'depth':
            return 0.0, 0.0, 0.0, 1.0
        return self.background or (*frame.renderer.GetBackground(), 1.0)

    def _draw(self, frame, depth, lamp=None):
        """Draw it with the live textures in it, the lights that follow a camera as at `lamp`."""
        casters, clear = self._casters(), self._clear_color(frame)
        view = self._view(frame, casters.bounds())
        drawn = self._target('drawn')
        if view is None:
            with drawn.drawing(clear=clear):
                return
        seen, lamp = frame.elsewhere(view, (drawn.width, drawn.height)), self._lamp(view, lamp)
        within = self._within(casters, view)
        pictures = [live.picture(seen, depth - 1, lamp) for live in within]
        for live, picture in zip(within, pictures, strict=True):
            live.show(picture)
        effects = [e for e in self._scene_effects() if e.needed(seen) is True]
        for effect in effects:
            effect.prepare(seen)
        with seen_from(casters.things, seen), drawn.drawing(clear=clear):
            ready = {t for t in casters.things if t.needed(seen) is True}
            found = [(t.draws(seen) if t in ready else t.drawn()) for t in casters.things]
            things = in_order([actor for actors in found for actor in actors], casters.things)
            self._drawer.light_from(lamp)
            self._drawer.look(view, (0, 0, *seen.size))
            frame.window.GetState().vtkglBlendFuncSeparate(*gl.OVER)  # of soft edges
            self._drawer.draw([*casters.actors, *things])
            with self._drawer.blending('over'):
                self._drawer.draw([*casters.translucent, *things], translucent=True)
        for effect in effects:
            effect.finish(seen)
        self._drawer.done()
        frame.renderer.UpdateLightsGeometryToFollowCamera()
        if self.what == 'depth':
            self._show_depth(frame, view)

    def _lamp(self, view, _lamp) -> View | None:
        """Return the view that camera lights follow, None for that of the subplot."""
        return view

    def _show_depth(self, frame, view):
        if self._gray is None:
            self._gray = Quad(frame.window, _NEAR_IS_WHITE, f'{self.name} depth')
        drawn = self._target('drawn')
        with self._target('gray').drawing():
            uniforms = {'planes': (view.near, view.far), 'parallel': int(view.parallel)}
            self._gray.draw(uniforms, {'depth': drawn.depth})
        copy(self._target('gray'), drawn)

    # -- memory ---------------------------------------------------------------------------------

    def allocate(self, frame):
        """Allocate its textures, if there are none of the right format."""
        # VTK takes whatever has an alpha channel for translucent, and draws it in another order.
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
        """Return a target: 'drawn', 'gray', 'whole', or by the depth that it is shown at."""
        if name not in self._targets:
            fine = _FINE if name in ('drawn', 'gray') else 1
            width, height = (fine * side for side in self.size)
            window, deep = self._drawer.window, name == 'drawn'
            self._targets[name] = Target(window, width, height, ('rgba8',), depth=deep)
        return self._targets[name]

    def _copy(self, source, target) -> Target:
        copy(self._target(source), self._target(target), turned=self._flipped)
        return self._target(target)

    def show(self, picture):
        """Copy a picture to the texture that actors have."""
        self._texture.take(picture)
        self._astray = True

    def show_own(self):
        """Show its own picture again, if it was drawn."""
        if self._astray and 'whole' in self._targets:
            self._texture.take(self._targets['whole'])
        self._astray = False

    def release(self):
        """Free what it holds on the GPU; the context is current."""
        self.texture.SetTextureObject(None)
        release(*self._targets.values(), self._texture, self._gray, self._drawer)
        self._targets, self._key = {}, ()
        self._gray = self._drawer = self._texture = None

    def report(self) -> dict:
        """Return bytes, and the number of times that it was rendered."""
        return {'bytes': nbytes_of(*self._targets.values(), self._texture), 'draws': self.draws}


class Mirror(LiveTexture):
    """Render the reflection in a flat mirror, for the camera of its subplot.

    The mirror is the rectangle ``corner + u * right + v * up``; show ``mirror.texture`` on a mesh
    there with texture coordinates (u, v). Actors behind the mirror are not reflected. The camera's
    projection may be perspective or parallel.

    Parameters
    ----------
    corner : actor or array_like of shape (3,)
        World units; or an actor of a flat mesh with texture coordinates, such as that of a
        `pv.Plane`, in place of all three.
    right, up : array_like of shape (3,), optional
        World units; right and up are perpendicular, as seen by a viewer in front of it.
    actors : None, callable or sequence, optional
        Actors and things to render, or a function that returns True for them; by default all.
    size : tuple of 2 int, optional
        Width and height in texels.
    **settings
        See the Params of :class:`LiveTexture`.

    Raises
    ------
    ValueError
        If right and up are not perpendicular, or one has no length; if the mesh of an actor is
        not flat or has no texture coordinates.
    """

    def __init__(self, corner, right=None, up=None, actors=None, size=(512, 512), **settings):
        if isinstance(corner, _vtk.vtkActor):
            corner, right, up = _sides(corner)
        if right is None or up is None:
            raise TypeError(
                f'right = {right!r}, up = {up!r}: must be given, unless corner is an actor'
            )
        given = {'corner': corner, 'right': right, 'up': up}
        self.corner, self.right, self.up = (checked_numbers(n, x, (3,)) for n, x in given.items())
        directions = unit_vectors(np.stack([self.right, self.up]))
        if not directions.any(1).all() or abs(directions[0] @ directions[1]) > 1e-6:
            raise ValueError(f'right = {right!r}, up = {up!r}: must be perpendicular and not zero')
        super().__init__(None, actors, size, **settings)

    # Drawn from behind, where left and right change places: u grows along `right` all the same.
    _flipped = True

    def needed(self, frame) -> bool | str:
        """Return True if the camera is in front of it, or in parallel projection faces it."""
        normal = np.cross(self.right, self.up)
        toward = frame.view_from_world[2, :3] if frame.parallel else frame.eye - self.corner
        return bool(normal @ toward > 0) or 'the camera is behind it'

    def _follow(self, frame):
        return lights_key(frame.renderer, frame.view.key())

    def _lamp(self, view, lamp) -> View | None:
        return lamp

    def _view(self, frame, bounds) -> View | None:
        right = self.right / np.linalg.norm(self.right)
        up = self.up / np.linalg.norm(self.up)
        back = np.cross(right, up)
        if frame.parallel:
            return through_rectangle(
                (self.corner, self.right, self.up), -frame.view_from_world[2, :3], bounds
            )
        away = float(back @ (frame.eye - self.corner))
        eye = frame.eye - 2 * away * back
        view = look_along(eye, back, up)
        sides = (
            view[:3, :3] @ (np.stack([self.corner, self.corner + self.right + self.up]) - eye).T
        )
        # Beyond its own plane, else it would see its own back.
        near = 1.001 * away
        far = 1.001 * max(near, _farthest(view, bounds))
        slopes = sides[:2] / away
        clip = frustum(slopes.min(axis=1), slopes.max(axis=1), near, far)
        return View(view, clip, near, far, False)


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
    low, high = bounds[:, 0::2].min(axis=0), bounds[:, 1::2].max(axis=0)
    ahead = -view[2, :3]
    return float(np.where(ahead > 0, high, low) @ ahead - view[2, 3])


def _sides(actor):
    """Return corner, right and up of a flat actor, where its texture coordinates are 0 and 1."""
    data = actor.GetMapper().GetInput()
    found = None if data is None else data.GetPointData().GetTCoords()
    if found is not None:
        uv = _vtk.vtk_to_numpy(found)[:, :2].astype(float)
        points = _vtk.vtk_to_numpy(data.GetPoints().GetData()).astype(float)
        ahead = np.column_stack([np.ones(len(uv)), uv])
        sides, _, rank, _ = np.linalg.lstsq(ahead, points, rcond=None)
        size = np.linalg.norm(np.ptp(points, axis=0))
        if rank == 3 and np.abs(ahead @ sides - points).max() <= 1e-4 * size:
            matrix = np.reshape(actor.GetMatrix().GetData(), (4, 4))
            sides = sides @ matrix[:3, :3].T
            return sides[0] + matrix[:3, 3], sides[1], sides[2]
    raise ValueError(
        f'corner = {actor!r:.60}: must be a flat mesh with texture coordinates, as pv.Plane has'
    )
