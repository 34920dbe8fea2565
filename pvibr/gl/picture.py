"""The pixels of one subplot: taken off the window, changed by effects, put back."""

from __future__ import annotations

from contextlib import contextmanager
from typing import Any

from pvibr import _vtk
from pvibr.gl.target import Target
from pvibr.gl.texture import Texture

_COLOR, _DEPTH = 0x4000, 0x0100  # GL_COLOR_BUFFER_BIT, GL_DEPTH_BUFFER_BIT
_NEAREST = 0x2600
_READ, _DRAW = 0x8CA8, 0x8CA9  # GL_READ_FRAMEBUFFER, GL_DRAW_FRAMEBUFFER
# A blit of depth wants the same format on both sides: the window's, whatever it is.
_DEPTH_FORMATS = {0x81A5: 'Fixed16', 0x81A6: 'Fixed24', 0x81A7: 'Fixed32', 0x8CAC: 'Float32'}


class Picture:
    """Colour and depth of a subplot as textures, and the next colour to draw into.

    Parameters
    ----------
    window : vtkOpenGLRenderWindow
        The window whose context holds it.
    origin, size : tuple of 2 int
        The subplot's place in the window, in pixels.
    slot : pvibr.gl.slot.Slot, optional
        Where colours come from in place of the window: they may be above 1.

    Attributes
    ----------
    color : pvibr.gl.Texture
        The picture so far, RGBA; row 0 is the lowest.
    depth : pvibr.gl.Texture
        Depth from 0 (near plane) to 1 (far plane), of the scene as drawn.
    """

    def __init__(self, window, origin, size, slot=None):
        self.window, self.origin, self.size, self.slot = window, origin, size, slot
        self._format = 'rgba16f' if slot is None else 'rgba32f'
        self._source: Any = _source(window, size) if slot is None else slot
        self._targets: list[Target] = []
        self._drawn: Target | None = None

    @property
    def color(self) -> Texture:
        """The picture so far."""
        return (self._source if self._drawn is None else self._drawn).colors[0]

    @property
    def depth(self) -> Texture:
        """Depth of the scene."""
        return self._source.depth

    @property
    def nbytes(self) -> int:
        """Bytes on the GPU."""
        return sum(t.nbytes for t in [*self._targets, self._source])

    def take(self):
        """Take colours and depth off the window; several samples become one."""
        self._drawn = None
        if self.slot is not None:
            return  # the pass in the slot drew into its textures already
        window = self.window.GetRenderFramebuffer()
        # Two blits: where the driver refuses one of depth, colours come all the same.
        for bits in (_COLOR, _DEPTH):
            self._blit(window, self._source.object, bits, self._place(), (0, 0, *self.size))

    @contextmanager
    def drawing(self):
        """Draw the new picture; it becomes `color` afterwards, unless an error ends it."""
        free = [t for t in self._targets if t is not self._drawn]
        if not free:
            free = [Target(self.window, self.size[0], self.size[1], (self._format,))]
            self._targets += free
        with free[0].drawing():
            yield self
        self._drawn = free[0]

    def present(self):
        """Put the picture back where it was taken from; nothing where nothing was drawn."""
        if self._drawn is not None:
            window = self.window.GetRenderFramebuffer()
            self._blit(self._drawn.object, window, _COLOR, (0, 0, *self.size), self._place())

    def _place(self):
        (x, y), (width, height) = self.origin, self.size
        return x, y, x + width, y + height

    def _blit(self, source, target, bits, source_rect, target_rect):
        state = self.window.GetState()
        state.Push()
        state.PushFramebufferBindings()
        source.Bind(_READ)
        source.ActivateReadBuffer(0)
        target.Bind(_DRAW)
        target.ActivateDrawBuffer(0)
        x0, y0, x1, y1 = target_rect
        state.vtkglScissor(x0, y0, x1 - x0, y1 - y0)  # the scissor cuts blits too
        state.vtkglBlitFramebuffer(*source_rect, *target_rect, bits, _NEAREST)
        state.PopFramebufferBindings()
        state.Pop()

    def release(self):
        """Free the GPU's memory; the context must be alive."""
        for target in self._targets:
            target.release()
        if self.slot is None:
            self._source.release()
        self._targets, self._drawn = [], None


def _source(window, size):
    """Return a target of the window's own formats."""
    source = Target(window, size[0], size[1], ('rgba8',))
    depth = Texture(window)
    theirs = window.GetRenderFramebuffer().GetDepthAttachmentAsTextureObject()
    internal = theirs.GetInternalFormat(theirs.GetVTKDataType(), 1, False)
    kind = getattr(_vtk.vtkTextureObject, _DEPTH_FORMATS.get(internal, 'Float32'))
    depth.object.AllocateDepth(*size, kind)
    depth.nbytes = size[0] * size[1] * 4
    source.depth = depth
    with source._bound():
        source.object.AddDepthAttachment(depth.object)
    return source
