"""A framebuffer with its textures: something to draw into."""

from __future__ import annotations

from contextlib import contextmanager
from typing import Any

from pvibr.core import _vtk
from pvibr.gl import enums as gl
from pvibr.gl.texture import Texture, nbytes_of, release


class Target:
    """Colour textures and a depth buffer drawn into together."""

    def __init__(
        self, window, width, height, formats=('rgba8',), *, depth=False, filter='linear', samples=0
    ):
        self.window = window
        self.width, self.height = width, height
        self._state = window.GetState()
        self.colors = [
            Texture(window, filter=filter, samples=samples).allocate(width, height, f)
            for f in formats
        ]
        self._shares_depth = isinstance(depth, Texture)
        self.depth: Any = depth if isinstance(depth, Texture) else None
        if depth is True:
            self.depth = Texture(window).allocate(width, height, 'depth32f')
        self._attach()

    def _attach(self):
        self.object = _vtk.vtkOpenGLFramebufferObject()
        self.object.SetContext(self.window)
        with self._bound():
            for i, color in enumerate(self.colors):
                self.object.AddColorAttachment(i, color.object)
            if self.depth is not None:
                self.object.AddDepthAttachment(self.depth.object)
            self._check()

    def add_depth(self, depth):
        """Attach a depth buffer, released with the target."""
        self.depth = depth
        with self._bound():
            self.object.AddDepthAttachment(depth.object)

    @property
    def nbytes(self) -> int:
        """Bytes on the GPU."""
        return nbytes_of(*self._owned_textures())

    def _owned_textures(self):
        depth = [] if self.depth is None or self._shares_depth else [self.depth]
        return self.colors + depth

    def _check(self):
        self._activate()
        if not self.object.CheckFrameBufferStatus(self.object.GetDrawMode()):
            raise RuntimeError(
                f'the driver cannot draw into {len(self.colors)} targets of these formats'
            )

    def _activate(self):
        if self.colors:
            self.object.ActivateDrawBuffers(len(self.colors))
        else:
            self.object.DeactivateDrawBuffers()
            self.object.DeactivateReadBuffer()

    @contextmanager
    def _bound(self):
        state = self.window.GetState()
        state.PushFramebufferBindings()
        self.object.Bind()
        try:
            yield
        finally:
            state.PopFramebufferBindings()

    def drawing(self, clear=None) -> _Drawing:
        """Draw into it; framebuffer, viewport and all other GL state are restored afterwards."""
        return _Drawing(self, clear)

    def draw(self, quad, uniforms=None, textures=None, *, blend=None, clear=None):
        """Draw a full-screen program into it, as within `drawing`."""
        with _Drawing(self, clear):
            quad.draw_alone(uniforms or {}, textures or {}, blend)

    def begin(self, clear=None):
        """Direct drawing into it until :meth:`end`."""
        state = self._state
        state.Push()
        state.PushFramebufferBindings()
        try:
            self.object.Bind()
            self._activate()
            state.vtkglViewport(0, 0, self.width, self.height)
            state.vtkglScissor(0, 0, self.width, self.height)
            if clear is not None:
                self._clear(state, clear)
        except BaseException:
            self.end()
            raise

    def end(self):
        """Restore framebuffer, viewport and all other GL state."""
        self._state.PopFramebufferBindings()
        self._state.Pop()

    def _clear(self, state, color):
        state.vtkglColorMask(True, True, True, True)
        state.vtkglDepthMask(True)
        state.vtkglClearColor(*color)
        state.vtkglClearDepth(1.0)
        state.vtkglClear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT)

    def release(self):
        """Free the GPU's memory; the context must be alive."""
        self.object.ReleaseGraphicsResources(self.window)
        release(*self._owned_textures())


class WindowTarget(Target):
    """A window's render framebuffer, which VTK frees."""

    def __init__(self, window):
        self.window, self._state = window, window.GetState()
        self.object = window.GetRenderFramebuffer()
        color = self.object.GetColorAttachmentAsTextureObject(0)
        self.colors = [Texture.of(window, color, filter='linear')]
        self.depth = Texture.of(window, self.object.GetDepthAttachmentAsTextureObject())
        self._shares_depth = True
        self.width, self.height = self.colors[0].size


class WindowColors(Target):
    """A window's colours without its depth, which programs drawing into it may then sample."""

    def __init__(self, window):
        self.window, self._state = window, window.GetState()
        color = window.GetRenderFramebuffer().GetColorAttachmentAsTextureObject(0)
        self.colors = [Texture.of(window, color, filter='linear')]
        self.depth, self._shares_depth = None, False
        self.width, self.height = self.colors[0].size
        self._attachment = color, color.GetHandle()
        self._attach()

    def is_current(self) -> bool:
        """Return whether VTK still draws the window into the same texture."""
        color = self.window.GetRenderFramebuffer().GetColorAttachmentAsTextureObject(0)
        return self._attachment == (color, color.GetHandle())

    def _owned_textures(self):
        return []  # VTK frees them


def fitting_target(target, window, size, formats=('rgba8',), **options) -> Target:
    """Return the target if it has the size, else a new one in its place."""
    if target is not None and (target.width, target.height) == tuple(size):
        return target
    release(target)
    return Target(window, size[0], size[1], formats, filter='nearest', **options)


def blit(state, source, target, bits, source_rect, target_rect, filter=gl.NEAREST):
    """Copy a rectangle between framebuffers; samples are resolved."""
    state.Push()
    state.PushFramebufferBindings()
    source.Bind(gl.READ_FRAMEBUFFER)
    target.Bind(gl.DRAW_FRAMEBUFFER)
    if bits & gl.COLOR_BUFFER_BIT:  # others may have no colour
        source.ActivateReadBuffer(0)
        target.ActivateDrawBuffer(0)
    x0, y0, x1, y1 = target_rect
    state.vtkglScissor(x0, y0, x1 - x0, y1 - y0)  # the scissor also clips blits
    state.vtkglBlitFramebuffer(*source_rect, *target_rect, bits, filter)
    state.PopFramebufferBindings()
    state.Pop()


class _Drawing:
    """Context of drawing into a target; faster than a generator, since a frame enters dozens."""

    __slots__ = ('_clear', '_target')

    def __init__(self, target, clear):
        self._target, self._clear = target, clear

    def __enter__(self):
        self._target.begin(self._clear)
        return self._target

    def __exit__(self, *_error):
        self._target.end()
