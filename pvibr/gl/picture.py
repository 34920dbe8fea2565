"""The pixels of one subplot: read from the window, changed by effects, written back."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import contextmanager
from typing import Any

from pvibr.gl import enums as gl
from pvibr.gl.fused import Pointwise
from pvibr.gl.quad import Quad, shader_source
from pvibr.gl.scene_pass import like_window
from pvibr.gl.target import Target, WindowColors, blit
from pvibr.gl.texture import Texture, nbytes_of, release


class Picture:
    """Colour and depth of a subplot as textures, and the next colour to draw into."""

    def __init__(self, window, origin, size, fused, needs_hdr=False):
        self.window, self.origin, self.size = window, origin, size
        self.needs_hdr = needs_hdr
        self._own: Target | None = None
        self._source: Any = None
        self._targets: list[Target] = []
        self._drawn: Target | None = None
        self._resolving: tuple[int, Quad] | None = None
        self._fused = fused
        self._pending: list[Pointwise] = []
        self._ends = self._is_apart = self._shares_depth = False
        self._scene: Any = None
        self._depth_taken = False
        self._window_colors: WindowColors | None = None
        self._bytes: Target | None = None
        #: Whether the last effect is drawing.
        self.last = False
        #: Finds the depth of a scene that was drawn without any.
        self.find_depth: Callable[[], Texture] | None = None

    @property
    def color(self) -> Texture:
        """The picture so far."""
        self._draw_pending()
        return (self._source if self._drawn is None else self._drawn).colors[0]

    @property
    def depth(self) -> Texture:
        """Depth of the scene."""
        if self.find_depth is not None:
            return self.find_depth()
        self._take_depth()
        return self._source.depth

    @property
    def nbytes(self) -> int:
        """Bytes on the GPU."""
        return nbytes_of(*self._targets, self._own, self._bytes)

    def take(self, scene, *, on_black=False):
        """Take colours and depth of a target: where that is all of it as it is, else copied."""
        self._drawn, self._pending, self._ends = None, [], False
        self.find_depth = None
        window = self.window.GetRenderFramebuffer()
        self._is_apart = scene.object is not window
        self._shares_depth = scene.depth.object is window.GetDepthAttachmentAsTextureObject()
        self._scene, self._depth_taken = scene, False
        samples = scene.object.GetMultiSamples()
        if samples <= 1 and (scene.width, scene.height) == self.size and self.origin == (0, 0):
            self._source, self._depth_taken = scene, True
            return
        if self._own is None:
            kind = 'rgba32f' if self.needs_hdr else 'rgba8'
            self._own = like_window(self.window, self.size, kind)
        self._source = self._own
        if samples > 1:
            self._resolve(scene, on_black)
        else:
            self._copy(scene.object, gl.COLOR_BUFFER_BIT)

    def _take_depth(self):
        """Copy the depth of the scene, once and only if it is asked for."""
        if not self._depth_taken:
            self._depth_taken = True
            self._copy(self._scene.object, gl.DEPTH_BUFFER_BIT)

    def _copy(self, framebuffer, bits):
        self._blit(framebuffer, self._source.object, bits, self._place(), (0, 0, *self.size))

    def _resolve(self, scene, on_black):
        """Average colours as VTK does in a window."""
        count = scene.object.GetMultiSamples()
        if self._resolving is None or self._resolving[0] != count:
            self._release_resolving()
            text = f'#define COUNT {count}\n{shader_source(__file__, "resolve")}'
            self._resolving = count, Quad(self.window, text, 'resolve')
        uniforms = {'origin': self.origin, 'on_black': int(on_black)}
        self._source.draw(self._resolving[1], uniforms, {'samples': scene.colors[0]})

    def apply(self, point):
        """Apply a pointwise program; consecutive programs are fused."""
        self._pending.append(point)
        self._ends = self.last

    def _draw_pending(self):
        pending, self._pending = self._pending, []
        if pending:
            self._fused.draw(self, pending)

    @contextmanager
    def drawing(self):
        """Draw the new picture; it becomes `color` unless an error is raised."""
        self._draw_pending()
        free = [t for t in self._targets if t is not self._drawn]
        if not free:
            kind = 'rgba32f' if self.needs_hdr else 'rgba16f'
            free = [Target(self.window, self.size[0], self.size[1], (kind,))]
            self._targets += free
        with free[0].drawing():
            yield self
        self._drawn = free[0]

    @contextmanager
    def drawing_over(self):
        """Draw onto the picture so far, which must not be sampled meanwhile."""
        self._draw_pending()
        with self.ground('over').drawing():
            yield self

    def ground(self, blend) -> Any:
        """Return the picture as a target to blend into; None if its format cannot hold the sum."""
        found = self._source if self._drawn is None else self._drawn
        if blend == 'add' and not (found.colors[0].is_float or self._ends):
            return None
        if blend == 'screen' and (found.colors[0].is_float or not self._ends):
            return None
        self._drawn = found
        return found

    def blit_depth(self, framebuffer, place):
        """Copy the depth of the scene to a rectangle of a framebuffer, none if it has none."""
        if self.find_depth is None:
            self._take_depth()
            whole = (0, 0, *self.size)
            self._blit(self._source.object, framebuffer, gl.DEPTH_BUFFER_BIT, whole, place)

    def put_depth(self, framebuffer):
        """Have the window keep the depth of a framebuffer of its size instead of the scene's."""
        whole = (0, 0, *self.size)
        target, place = self.window.GetRenderFramebuffer(), self._place()
        if not self._shares_depth:  # but has it from there in the end
            self._take_depth()
            target, place = self._source.object, whole
        self._blit(framebuffer, target, gl.DEPTH_BUFFER_BIT, whole, place)

    def present(self):
        """Copy the picture to the window if it changed."""
        window = self.window.GetRenderFramebuffer()
        place, whole = self._place(), (0, 0, *self.size)
        if not self._shares_depth:
            self._take_depth()
            self._blit(self._source.object, window, gl.DEPTH_BUFFER_BIT, whole, place)
        if self._draw_last(window, whole, place):
            return
        self._draw_pending()
        drawn = self._drawn or self._source
        if drawn.object is not window and (self._is_apart or self._drawn is not None):
            self._blit(drawn.object, window, gl.COLOR_BUFFER_BIT, whole, place)

    def _draw_last(self, window, whole, place) -> bool:
        """Draw what is left to the window, or as bytes to be copied there; return whether."""
        pending = self._pending
        if not pending or (not self._is_apart and all(point.blend for point in pending)):
            return False  # these are blended with the window in place
        # Not what is read at the same time, and pixels must have the same places.
        direct = self._source.object is not window and self.origin == (0, 0)
        self._pending = []
        target = self._window_target() if direct else self._byte_target()
        drawn = self._fused.draw(self, pending, target)
        if drawn and not direct:
            self._blit(target.object, window, gl.COLOR_BUFFER_BIT, whole, place)
        return drawn

    def _byte_target(self):
        self._bytes = self._bytes or Target(self.window, *self.size)
        return self._bytes

    def _window_target(self):
        target = self._window_colors
        if target is None or not target.is_current():
            release(target)
            target = self._window_colors = WindowColors(self.window)
        target.width, target.height = self.size
        return target

    def _place(self):
        (x, y), (width, height) = self.origin, self.size
        return x, y, x + width, y + height

    def _blit(self, source, target, bits, source_rect, target_rect):
        blit(self.window.GetState(), source, target, bits, source_rect, target_rect)

    def release(self):
        """Free the GPU's memory; the context must be alive."""
        self._release_resolving()
        release(*self._targets, self._own, self._window_colors, self._bytes)
        self._own = self._window_colors = self._bytes = None
        self._targets, self._drawn, self._pending, self._scene = [], None, [], None

    def _release_resolving(self):
        if self._resolving is not None:
            self._resolving[1].release()
        self._resolving = None
