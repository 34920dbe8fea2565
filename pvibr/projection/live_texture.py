"""The view of another camera as a texture: monitors, mirrors, insets."""

from __future__ import annotations

from contextlib import contextmanager
from typing import Any

import numpy as np

from pvibr.core import _vtk
from pvibr.core.effect import Effect
from pvibr.core.params import Param
from pvibr.gl import MipTexture, Quad, Target, Texture, release
from pvibr.gl import enums as gl
from pvibr.gl.drawer import Drawer
from pvibr.gl.mipmaps import copy
from pvibr.maths.cameras import as_camera
from pvibr.maths.views import View, frustum, look_along
from pvibr.projection.depth_maps import view_of
from pvibr.scene.casters import Casters, Surfaces
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
    view, itself included, are drawn there without further recursion. Points and lines have the
    same width in pixels as in the window. The texture has mip levels. Volumes, annotations and
    effects on pixels are left out. Camera lights follow this camera. If the alpha of the
    background is below 1, meshes with the texture are translucent.

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

    def __init__(self, camera, actors=None, size=(512, 512), **settings):
        self.camera, self.actors, self.size = camera, actors, _size(size)
        super().__init__(**settings)
        if camera is not None:
            as_camera(camera, self.size)
        self.texture = _vtk.vtkOpenGLTexture()
        self.texture.InterpolateOn()
        self.texture.SetInputData(_white())  # where there is no picture
        self.draws = 0
        self._drawer: Any = None
        self._surfaces: Any = None
        self._targets: dict[str, Target] = {}
        self._texture: Any = None
        self._gray: Quad | None = None
        self._keys: dict[str, tuple] = {}
        self._format = ''

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
        if not self._targets:
            msg = f'{self.name} shows nothing: add it to a subplot and draw a frame'
            raise RuntimeError(msg)
        whole = self._targets['whole']
        whole.window.MakeCurrent()
        return np.ascontiguousarray(whole.colors[0].download()[::-1])

    # -- the life of an effect ----------------------------------------------------------------

    def prepare(self, frame):
        """Draw it if it is stale."""
        self.allocate(frame)
        seen = self._seen_lives(frame)
        key = self.scene_key(frame), [live.scene_key(frame) for live in seen]
        if self._keys.get('whole') == key:
            return
        for live in seen:
            live.draw_plain(frame)
        for live in seen:
            live.show('plain')
        self._draw(frame)
        self._copy('drawn', 'whole')
        for live in {self, *seen}:
            live.show('whole')
        # Taken again: things may have made actors for this view.
        self._keys['whole'] = self.scene_key(frame), [live.scene_key(frame) for live in seen]
        self.draws += 1

    def draw_plain(self, frame):
        """Draw it without any live texture in it, if that is stale."""
        if self._keys.get('plain') == self.scene_key(frame):
            return
        seen = self._seen_lives(frame)
        for live in seen:
            live.blank(frame)
        self._draw(frame)
        self._copy('drawn', 'plain')
        for live in seen:
            live.show('whole')
        self._keys['plain'] = self.scene_key(frame)

    def blank(self, frame):
        """Show the background alone."""
        with self._targets['drawn'].drawing(clear=self._clear_color(frame)):
            pass
        self.show('drawn')

    # -- what is drawn ------------------------------------------------------------------------

    def _casters(self) -> Casters:
        things = [t for t in self.pipeline.things if t.enabled]
        self._surfaces.update(things)
        return self._surfaces.casters(self.actors, things)

    def _seen_lives(self, frame) -> list[LiveTexture]:
        """Return the live textures on the actors that it sees, projected ones and itself too."""
        textures = [a.GetTexture() for a in self._casters().actors]
        projected = [live for e in self._scene_effects() for live in e.lives]
        found = [e for e in self.pipeline.effects if isinstance(e, LiveTexture) and e.enabled]
        found = [e for e in found if e in projected or any(t is e.texture for t in textures)]
        for live in found:
            live.allocate(frame)
        return found

    def _view(self, frame, bounds) -> View | None:
        """Return its view, None if nothing is in front of it."""
        # So many texels that there is no margin: the picture ends where the camera's does.
        return view_of(as_camera(self.camera, self.size), bounds, 1e12)

    def scene_key(self, frame) -> tuple:
        """Return a value that changes whenever its view of the scene does."""
        casters = self._casters()
        view = self._view(frame, casters.bounds())
        lights = tuple(map(_light_key, frame.renderer.GetLights()))
        others = tuple((id(e), e.revision) for e in self._scene_effects())
        seen_from = None if view is None else view.key()
        return casters.key(), seen_from, lights, others, self.what, self._clear_color(frame)

    def _scene_effects(self):
        """Return the effects that depend on the view: shadows, projectors, things."""
        return [
            e
            for e in self.pipeline.effects
            if e.enabled and not isinstance(e, LiveTexture) and not e.is_image_effect
        ]

    def _clear_color(self, frame) -> tuple:
        if self.what == 'depth':
            return 0.0, 0.0, 0.0, 1.0
        return self.background or (*frame.renderer.GetBackground(), 1.0)

    def _draw(self, frame):
        casters = self._casters()
        view = self._view(frame, casters.bounds())
        drawn = self._targets['drawn']
        if view is None:
            with drawn.drawing(clear=self._clear_color(frame)):
                return
        seen = frame.elsewhere(view, (drawn.width, drawn.height))
        needed = [e for e in self._scene_effects() if e.needed(seen) is True]
        effects = [e for e in needed if e not in self.pipeline.things]
        for effect in effects:
            effect.prepare(seen)
        clear = self._clear_color(frame)
        with seen_from(casters.things, seen), drawn.drawing(clear=clear):
            found = [(t.draws(seen) if t in needed else t.drawn()) for t in casters.things]
            things = [actor for actors in found for actor in actors]
            self._drawer.look(view, (0, 0, *seen.size))
            self._light(frame)
            self._drawer.draw([*casters.actors, *things])
            with _blended(frame.window):
                self._drawer.draw([*casters.translucent(), *things], translucent=True)
        for effect in effects:
            effect.finish(seen)
        self._drawer.done()
        frame.renderer.UpdateLightsGeometryToFollowCamera()
        if self.what == 'depth':
            self._show_depth(frame, view)

    def _light(self, frame):
        """Let camera lights follow this camera."""
        inner = self._drawer.inner
        inner.UpdateLightsGeometryToFollowCamera()
        inner.UpdateLights()

    def _show_depth(self, frame, view):
        if self._gray is None:
            self._gray = Quad(frame.window, _NEAR_IS_WHITE, f'{self.name} depth')
        drawn = self._targets['drawn']
        with self._targets['gray'].drawing():
            uniforms = {'planes': (view.near, view.far), 'parallel': int(view.parallel)}
            self._gray.draw(uniforms, {'depth': drawn.depth})
        self._copy('gray', 'drawn')

    # -- memory ---------------------------------------------------------------------------------

    def allocate(self, frame):
        """Allocate its textures, if there are none of the right format."""
        # VTK takes whatever has an alpha channel for translucent, and draws it in another order.
        format = 'rgba8' if self._clear_color(frame)[3] < 1 else 'rgb8'
        if self._targets and self._format == format:
            return
        self.release()
        self._format = format
        window, (width, height) = frame.window, self.size
        fine = _FINE * width, _FINE * height
        self._drawer, self._surfaces = Drawer(frame.renderer), Surfaces(frame.renderer)
        self._targets = {
            'drawn': Target(window, fine[0], fine[1], ('rgba8',), depth=True),
            'gray': Target(window, fine[0], fine[1], ('rgba8',)),
        } | {n: Target(window, width, height, ('rgba8',)) for n in ('plain', 'whole')}
        texels = np.zeros((height, width, 4 if format == 'rgba8' else 3), np.uint8)
        self._texture = MipTexture(window).upload(texels)
        self.texture.SetTextureObject(self._texture.object)

    def _copy(self, source, target):
        turned = self._flipped and source == 'drawn'
        copy(self._targets[source], self._targets[target], turned=turned)

    def show(self, source):
        """Copy one of its pictures to the texture that actors have."""
        self._texture.take(self._targets[source])

    def release(self):
        """Free what it holds on the GPU; the context is current."""
        self.texture.SetTextureObject(None)
        release(*self._targets.values(), self._texture, self._gray, self._drawer)
        self._targets, self._keys = {}, {}
        self._gray = self._drawer = self._surfaces = self._texture = None

    def report(self) -> dict:
        """Return bytes, and the number of times that it was rendered."""
        owners = [*self._targets.values(), self._texture]
        held = sum(owner.nbytes for owner in owners if owner is not None)
        return {'bytes': held, 'draws': self.draws}


class Mirror(LiveTexture):
    """Render the reflection in a flat mirror, for the camera of its subplot.

    The mirror is the rectangle ``corner + u * right + v * up``; show ``mirror.texture`` on a mesh
    there with texture coordinates (u, v). Actors behind the mirror are not reflected.

    Parameters
    ----------
    corner, right, up : array_like, shape (3,)
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
        If right and up are not perpendicular, or one has no length.
    """

    def __init__(self, corner, right, up, actors=None, size=(512, 512), **settings):
        self.corner, self.right, self.up = (np.array(x, float) for x in (corner, right, up))
        lengths = np.linalg.norm(self.right), np.linalg.norm(self.up)
        if min(lengths) == 0 or abs(self.right @ self.up) > 1e-6 * lengths[0] * lengths[1]:
            msg = f'right = {right!r}, up = {up!r}: must be perpendicular and not zero'
            raise ValueError(msg)
        super().__init__(None, actors, size, **settings)

    # Drawn from behind, where left and right change places: u grows along `right` all the same.
    _flipped = True

    def needed(self, frame) -> bool | str:
        """Return True if the camera is in front of it."""
        if frame.parallel:
            return 'the projection is parallel'
        normal = np.cross(self.right, self.up)
        before = normal @ (frame.eye - self.corner) > 0
        return bool(before) or 'the camera is behind it'

    def _light(self, frame):
        """Let camera lights follow the camera of the subplot."""
        frame.renderer.UpdateLightsGeometryToFollowCamera()
        self._drawer.inner.UpdateLights()

    def _view(self, frame, bounds) -> View | None:
        right = self.right / np.linalg.norm(self.right)
        up = self.up / np.linalg.norm(self.up)
        back = np.cross(right, up)
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


def _light_key(light) -> tuple:
    place = light.GetPosition(), light.GetFocalPoint()
    return light.GetSwitch(), light.GetIntensity(), light.GetDiffuseColor(), *place


def _farthest(view, bounds) -> float:
    if not len(bounds):
        return 0.0
    low, high = bounds[:, 0::2].min(axis=0), bounds[:, 1::2].max(axis=0)
    ahead = -view[2, :3]
    return float(np.where(ahead > 0, high, low) @ ahead - view[2, 3])


@contextmanager
def _blended(window):
    """Blend translucent props in the order in which they were added."""
    state = window.GetState()
    state.vtkglDepthMask(False)
    state.SetEnumState(gl.BLEND, True)
    state.vtkglBlendFuncSeparate(*gl.OVER)
    yield
    state.SetEnumState(gl.BLEND, False)
    state.vtkglDepthMask(True)


def _size(size) -> tuple[int, int]:
    found = np.asarray(size)
    if found.shape != (2,) or found.dtype.kind not in 'iu' or found.min() < 1:
        msg = f'size = {size!r}: must be width and height in texels, two positive integers'
        raise ValueError(msg)
    return int(found[0]), int(found[1])
