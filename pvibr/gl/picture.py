"""The pixels of one subplot: read from the window, changed by effects, written back."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import contextmanager
from typing import Any

from pvibr.gl import enums as gl
from pvibr.gl.driver import driver_of
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
        self._copy_target: Target | None = None
        self._source: Any = None
        self._targets: list[Target] = []
        self._latest: Target | None = None
        self._resolving: tuple[int, Quad] | None = None
        self._fused = fused
        self._pending: list[Pointwise] = []
        self._is_last_pending = self._is_separate = self._shares_depth = False
        self._scene: Any = None
        self._has_depth = False
        self._window_colors: WindowColors | None = None
        self._bytes: Target | None = None
        #: Whether the last effect is drawing.
        self.last = False
        #: Returns the depth of a scene that was drawn without depth.
        self.find_depth: Callable[[], Texture] | None = None

    @property
    def color(self) -> Texture:
        """The current picture."""
        self._draw_pending()
        return (self._source if self._latest is None else self._latest).colors[0]

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
        return nbytes_of(*self._targets, self._copy_target, self._bytes)

    def take(self, scene, *, on_black=False):
        """Adopt a target's colours and depth, copied unless it is exactly this subplot."""
        self._latest, self._pending, self._is_last_pending = None, [], False
        self.find_depth = None
        window = self.window.GetRenderFramebuffer()
        self._is_separate = scene.object is not window
        self._shares_depth = scene.depth.object is window.GetDepthAttachmentAsTextureObject()
        self._scene, self._has_depth = scene, False
        samples = scene.object.GetMultiSamples()
        if samples <= 1 and (scene.width, scene.height) == self.size and self.origin == (0, 0):
            self._source, self._has_depth = scene, True
            return
        if self._copy_target is None:
            kind = driver_of(self.window).light_format if self.needs_hdr else 'rgba8'
            self._copy_target = like_window(self.window, self.size, kind)
        self._source = self._copy_target
        if samples > 1:
            self._resolve(scene, on_black)
        else:
            self._copy(scene.object, gl.COLOR_BUFFER_BIT)

    def _take_depth(self):
        """Copy the scene's depth, once and on demand."""
        if not self._has_depth:
            self._has_depth = True
            self._copy(self._scene.object, gl.DEPTH_BUFFER_BIT)

    def _copy(self, framebuffer, bits):
        self._blit(framebuffer, self._source.object, bits, self._place(), (0, 0, *self.size))

    def _resolve(self, scene, on_black):
        """Average samples as VTK does in a window."""
        sample_count = scene.object.GetMultiSamples()
        if self._resolving is None or self._resolving[0] != sample_count:
            self._release_resolving()
            text = f'#define COUNT {sample_count}\n{shader_source(__file__, "resolve")}'
            self._resolving = sample_count, Quad(self.window, text, 'resolve')
        uniforms = {'origin': self.origin, 'on_black': int(on_black)}
        self._source.draw(self._resolving[1], uniforms, {'samples': scene.colors[0]})

    def apply(self, point):
        """Apply a pointwise program; consecutive ones are fused."""
        self._pending.append(point)
        self._is_last_pending = self.last

    def _draw_pending(self):
        pending, self._pending = self._pending, []
        if pending:
            self._fused.draw(self, pending)

    @contextmanager
    def drawing(self):
        """Draw the next picture; it becomes `color` unless an error is raised."""
        self._draw_pending()
        free_targets = [t for t in self._targets if t is not self._latest]
        if not free_targets:
            kind = driver_of(self.window).light_format if self.needs_hdr else 'rgba16f'
            free_targets = [Target(self.window, self.size[0], self.size[1], (kind,))]
            self._targets += free_targets
        with free_targets[0].drawing():
            yield self
        self._latest = free_targets[0]

    @contextmanager
    def drawing_over(self):
        """Draw onto the current picture, which must not be sampled meanwhile."""
        self._draw_pending()
        with self.ground('over').drawing():
            yield self

    def ground(self, blend) -> Any:
        """Return the picture as a target to blend into, or None if it cannot hold the sum."""
        target = self._source if self._latest is None else self._latest
        if blend == 'add' and not (target.colors[0].is_float or self._is_last_pending):
            return None
        if blend == 'screen' and (target.colors[0].is_float or not self._is_last_pending):
            return None
        self._latest = target
        return target

    def blit_depth(self, framebuffer, target_rect):
        """Copy the scene's depth, if it has any, to a rectangle of a framebuffer."""
        if self.find_depth is None:
            self._take_depth()
            source, full_rect = self._source.object, (0, 0, *self.size)
            self._blit(source, framebuffer, gl.DEPTH_BUFFER_BIT, full_rect, target_rect)

    def put_depth(self, framebuffer):
        """Replace the scene's depth in the window by that of a framebuffer of this size."""
        full_rect = (0, 0, *self.size)
        target, target_rect = self.window.GetRenderFramebuffer(), self._place()
        if not self._shares_depth:  # present() copies it to the window
            self._take_depth()
            target, target_rect = self._source.object, full_rect
        self._blit(framebuffer, target, gl.DEPTH_BUFFER_BIT, full_rect, target_rect)

    def present(self):
        """Copy the picture to the window if it changed."""
        window = self.window.GetRenderFramebuffer()
        window_rect, full_rect = self._place(), (0, 0, *self.size)
        if not self._shares_depth:
            self._take_depth()
            self._blit(self._source.object, window, gl.DEPTH_BUFFER_BIT, full_rect, window_rect)
        if self._draw_last(window, full_rect, window_rect):
            return
        self._draw_pending()
        latest = self._latest or self._source
        if latest.object is not window and (self._is_separate or self._latest is not None):
            self._blit(latest.object, window, gl.COLOR_BUFFER_BIT, full_rect, window_rect)

    def _draw_last(self, window, full_rect, window_rect) -> bool:
        """Draw pending programs into the window, directly or via bytes; return whether it did."""
        pending = self._pending
        if not pending or (not self._is_separate and all(point.blend for point in pending)):
            return False  # they are blended with the window in place
        # Not if the window is read meanwhile, or if the subplot has an offset.
        is_direct = self._source.object is not window and self.origin == (0, 0)
        self._pending = []
        target = self._window_target() if is_direct else self._byte_target()
        was_drawn = self._fused.draw(self, pending, target)
        if was_drawn and not is_direct:
            self._blit(target.object, window, gl.COLOR_BUFFER_BIT, full_rect, window_rect)
        return was_drawn

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
        release(*self._targets, self._copy_target, self._window_colors, self._bytes)
        self._copy_target = self._window_colors = self._bytes = None
        self._targets, self._latest, self._pending, self._scene = [], None, [], None

    def _release_resolving(self):
        if self._resolving is not None:
            self._resolving[1].release()
        self._resolving = None
