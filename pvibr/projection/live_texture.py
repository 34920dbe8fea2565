"""A camera's view of the scene as a texture: monitors, mirrors, insets."""

from __future__ import annotations

from contextlib import contextmanager
from typing import Any

import numpy as np

from pvibr.core import _vtk
from pvibr.core.effect import Effect
from pvibr.core.params import Param
from pvibr.gl import MipTexture, Quad, Target, Texture
from pvibr.gl import enums as gl
from pvibr.gl.drawer import Drawer
from pvibr.gl.mipmaps import copy
from pvibr.maths.cameras import as_camera
from pvibr.maths.views import View, look_along
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
    """What another camera sees, as a texture that any mesh can wear, drawn when it changes.

    ``actor.texture = live.texture`` has a mesh wear it; the mesh needs texture coordinates. It is
    also an image for whatever takes one: `Projector`, `ImageOverlay`, `Backdrop`,
    `ShaderEffect`. In its picture other live textures are seen, and itself too, each as it
    is without any. Points and lines are as wide there, in pixels, as in the window. Seen small it
    is smooth: it has mip levels. Volumes and annotations are left out. Effects on pixels are not
    in it. Lights that go with the subplot's camera go with this one instead. Where the
    background's alpha is below 1, whatever wears it is translucent.

    Parameters
    ----------
    camera : pyvista.Camera, Pinhole or Orthographic
        Where from; a ``pyvista.Camera`` may move.
    actors : None, callable or sequence, optional
        Which actors and things are seen: all; those for which it returns true; those in it.
    size : tuple of 2 int, optional
        Width and height in texels.
    **settings
        See the class's Params.

    Attributes
    ----------
    texture : vtkTexture
        For ``actor.texture``.
    draws : int
        How many times it was drawn.

    Raises
    ------
    ValueError
        If the camera is none, or the size is not of two positive integers.

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

    web = 'lost', 'is drawn anew with each frame; what wears it shows its last picture'
    what = Param('color', 'Colours, or depth: white near, black far.', choices=('color', 'depth'))
    background = Param(
        None,
        "Red, green, blue and alpha of its background; by default the subplot's colour.",
        range='[0, 1]',
        kind=tuple,
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
        self._worn: Any = None
        self._gray: Quad | None = None
        self._keys: dict[str, Any] = {}
        self._worn_format = ''

    _flipped = False

    @property
    def shown(self) -> Texture | None:
        """What is worn, for whatever takes an image; None where it is in no subplot."""
        return self._worn

    def image(self) -> np.ndarray:
        """Return what it shows now, as data.

        Returns
        -------
        numpy.ndarray, shape (height, width, 4), uint8
            Top row first.

        Raises
        ------
        RuntimeError
            Where it is in no subplot, or not drawn yet.
        """
        if not self._targets:
            msg = f'{self.name} shows nothing: add it to a subplot and draw a frame'
            raise RuntimeError(msg)
        whole = self._targets['whole']
        whole.window.MakeCurrent()
        return np.ascontiguousarray(whole.colors[0].download()[::-1])

    # -- the life of an effect ----------------------------------------------------------------

    def prepare(self, frame):
        """Draw it where it is stale."""
        self._allocate(frame)
        seen = self._worn_in(frame)
        key = self._base_key(frame), tuple(live._base_key(frame) for live in seen)
        if self._keys.get('whole') == key:
            return
        for live in seen:
            live._draw_plain(frame)
        for live in seen:
            live._wear('plain')
        self._draw(frame)
        self._copy('drawn', 'whole')
        for live in {self, *seen}:
            live._wear('whole')
        # Taken again: things may have made actors for this view.
        key = self._base_key(frame), tuple(live._base_key(frame) for live in seen)
        self._keys['whole'] = key
        self.draws += 1

    def _draw_plain(self, frame):
        """Draw it with no live texture in it, where that is stale."""
        key = self._base_key(frame)
        if self._keys.get('plain') == key:
            return
        worn = self._worn_in(frame)
        for live in worn:
            with live._targets['drawn'].drawing(clear=live._clear_color(frame)):
                pass
            live._wear('drawn')
        self._draw(frame)
        self._copy('drawn', 'plain')
        for live in worn:
            live._wear('whole')
        self._keys['plain'] = self._base_key(frame)

    # -- what is drawn ------------------------------------------------------------------------

    def _casters(self) -> Casters:
        things = [t for t in self.pipeline.things if t.enabled]
        self._surfaces.update(things)
        actors, things = self._surfaces.chosen(self.actors, things)
        return Casters([a for a in actors.values() if a.GetVisibility()], things)

    def _worn_in(self, frame) -> list[LiveTexture]:
        """Return the live textures on what it sees, worn or projected, itself too."""
        worn = [a.GetTexture() for a in self._casters().actors]
        thrown = [live for e in self._scene_effects() for live in e.lives]
        found = [e for e in self.pipeline.effects if isinstance(e, LiveTexture) and e.enabled]
        found = [e for e in found if e in thrown or any(t is e.texture for t in worn)]
        for live in found:
            live._allocate(frame)
        return found

    def _view(self, frame, bounds) -> View | None:
        """Return where it is seen from, None where nothing is in front of it."""
        # So many texels that there is no margin: the picture ends where the camera's does.
        return view_of(as_camera(self.camera, self.size), bounds, 1e12)

    def _base_key(self, frame) -> tuple:
        casters = self._casters()
        view = self._view(frame, casters.bounds())
        lights = tuple(map(_light_key, frame.renderer.GetLights()))
        others = tuple((id(e), e._revision) for e in self._scene_effects())
        seen_from = None if view is None else view.key()
        return casters.key(), seen_from, lights, others, self.what, self._clear_color(frame)

    def _scene_effects(self):
        """Return what is drawn otherwise for each view: shadows, projectors, things."""
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
        """Have lights that go with a camera go with this one."""
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

    def _allocate(self, frame):
        # VTK takes whatever has an alpha channel for translucent, and draws it in another order.
        worn = 'rgba8' if self._clear_color(frame)[3] < 1 else 'rgb8'
        if self._targets and self._worn_format == worn:
            return
        self.release()
        self._worn_format = worn
        window, (width, height) = frame.window, self.size
        fine = _FINE * width, _FINE * height
        self._drawer, self._surfaces = Drawer(frame.renderer), Surfaces(frame.renderer)
        self._targets = {
            'drawn': Target(window, fine[0], fine[1], ('rgba8',), depth=True),
            'gray': Target(window, fine[0], fine[1], ('rgba8',)),
        } | {n: Target(window, width, height, ('rgba8',)) for n in ('plain', 'whole')}
        texels = np.zeros((height, width, 4 if worn == 'rgba8' else 3), np.uint8)
        self._worn = MipTexture(window).upload(texels)
        self.texture.SetTextureObject(self._worn.object)

    def _copy(self, source, target):
        turned = self._flipped and source == 'drawn'
        copy(self._targets[source], self._targets[target], turned=turned)

    def _wear(self, source):
        """Show one of its pictures on whatever wears it."""
        self._worn.take(self._targets[source])

    def release(self):
        """Free what it holds on the GPU; the context is current."""
        self.texture.SetTextureObject(None)
        for target in self._targets.values():
            target.release()
        if self._worn is not None:
            self._worn.release()
        if self._gray is not None:
            self._gray.release()
        if self._drawer is not None:
            self._drawer.release()
        self._targets, self._keys = {}, {}
        self._gray = self._drawer = self._surfaces = self._worn = None

    def report(self) -> dict:
        """Return bytes, and how many times it was drawn."""
        owners = [*self._targets.values(), self._worn]
        held = sum(owner.nbytes for owner in owners if owner is not None)
        return {'bytes': held, 'draws': self.draws}


class Mirror(LiveTexture):
    """What a flat mirror shows to the camera of its subplot, which may go anywhere before it.

    Its rectangle is ``corner + u * right + v * up``; a mesh that wears ``mirror.texture`` there
    has the texture coordinates (u, v). What lies behind it is not seen.

    Parameters
    ----------
    corner, right, up : array_like, shape (3,)
        World units; right and up at a right angle, as seen by who looks into it.
    actors : None, callable or sequence, optional
        Which actors and things are seen: all; those for which it returns true; those in it.
    size : tuple of 2 int, optional
        Width and height in texels.
    **settings
        See the Params of :class:`LiveTexture`.

    Raises
    ------
    ValueError
        If right and up are not at a right angle, or of no length.
    """

    def __init__(self, corner, right, up, actors=None, size=(512, 512), **settings):
        self.corner, self.right, self.up = (np.array(x, float) for x in (corner, right, up))
        lengths = np.linalg.norm(self.right), np.linalg.norm(self.up)
        if min(lengths) == 0 or abs(self.right @ self.up) > 1e-6 * lengths[0] * lengths[1]:
            msg = f'right = {right!r}, up = {up!r}: must be of some length and at a right angle'
            raise ValueError(msg)
        super().__init__(None, actors, size, **settings)

    # Drawn from behind, where left and right change places: u grows along `right` all the same.
    _flipped = True

    def needed(self, frame) -> bool | str:
        """Tell whether the camera is before it."""
        if frame.parallel:
            return 'the projection is parallel'
        normal = np.cross(self.right, self.up)
        before = normal @ (frame.eye - self.corner) > 0
        return bool(before) or 'the camera is behind it'

    def _light(self, frame):
        """Have lights that go with a camera go with that of the subplot."""
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
        clip = _frustum(slopes.min(axis=1), slopes.max(axis=1), near, far)
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


def _frustum(low, high, near, far) -> np.ndarray:
    """Return the projection of what lies between slopes, of x and of y over distance."""
    clip = np.zeros((4, 4))
    clip[[0, 1], [0, 1]] = 2 / (high - low)
    clip[[0, 1], [2, 2]] = (high + low) / (high - low)
    clip[2, 2:] = -(far + near) / (far - near), -2 * far * near / (far - near)
    clip[3, 2] = -1
    return clip


@contextmanager
def _blended(window):
    """Mix translucent props with what is there, in the order in which they were added."""
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
