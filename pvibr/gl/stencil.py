"""A stencil target that counts surfaces, and masks of non-zero counts."""

from __future__ import annotations

from contextlib import contextmanager

from pvibr.gl import enums as gl
from pvibr.gl.quad import Quad
from pvibr.gl.target import Target
from pvibr.gl.texture import Texture, nbytes_of, release

_DARK = 'void main() { gl_FragData[0] = vec4(min(uv.x, 0.0)); }\n'


class StencilTarget:
    """Depth, an 8-bit stencil, and masks of its counts, four per texture."""

    def __init__(self, window, width, height, masks):
        self.window, self.masks = window, masks
        self._depth = Texture(window)
        if not self._depth.object.AllocateDepthStencil(width, height):
            raise RuntimeError(f'the driver refused depth and stencil of {width} x {height}')
        self._depth.nbytes = width * height * 4
        # One framebuffer each: llvmpipe skips rows when drawing into a second attachment.
        self._targets = [
            Target(window, width, height, depth=self._depth) for _ in range(-(-masks // 4))
        ]
        self.size = width, height
        self._dark = Quad(window, _DARK, 'stencil')

    @property
    def textures(self) -> list[Texture]:
        """The masks: mask k is channel k % 4 of texture k // 4; 1 where the count is 0."""
        return [target.colors[0] for target in self._targets]

    @property
    def nbytes(self) -> int:
        """Bytes on the GPU."""
        return nbytes_of(*self._targets, self._depth)

    @contextmanager
    def drawing(self):
        """Draw depth with all masks set to 1; GL state is restored."""
        state = self.window.GetState()
        for target in self._targets:
            with target.drawing(clear=(1.0, 1.0, 1.0, 1.0)):
                pass
        with self._targets[0].drawing():
            try:
                state.vtkglColorMask(False, False, False, False)
                yield
            finally:
                state.SetEnumState(gl.STENCIL_TEST, False)
                state.SetEnumState(gl.DEPTH_CLAMP, False)  # not in VTK's state stack
                state.vtkglStencilOp(gl.KEEP, gl.KEEP, gl.KEEP)
                state.vtkglStencilFunc(gl.ALWAYS, 0, 0xFF)
                state.vtkglColorMask(True, True, True, True)
                state.vtkglDepthMask(True)
                state.vtkglDepthFunc(gl.LEQUAL)

    @contextmanager
    def counting(self, mask_index):
        """Count draws in the block, then clear a mask where the count is not zero."""
        state = self.window.GetState()
        with self._targets[mask_index // 4].drawing():
            state.vtkglStencilMask(0xFF)
            state.vtkglClear(gl.STENCIL_BUFFER_BIT)
            state.SetEnumState(gl.STENCIL_TEST, True)
            state.vtkglStencilFunc(gl.ALWAYS, 0, 0xFF)
            state.vtkglColorMask(False, False, False, False)
            state.vtkglDepthMask(False)
            state.vtkglDepthFunc(gl.LESS)
            yield
            self._darken(mask_index % 4)

    def _darken(self, channel):
        state = self.window.GetState()
        state.SetEnumState(gl.DEPTH_CLAMP, False)
        state.SetEnumState(gl.DEPTH_TEST, False)
        state.vtkglScissor(0, 0, *self.size)
        state.vtkglStencilOp(gl.KEEP, gl.KEEP, gl.KEEP)
        state.vtkglStencilFunc(gl.NOTEQUAL, 0, 0xFF)
        state.vtkglColorMask(*(channel == k for k in range(4)))
        self.window.GetShaderCache().ReadyShaderProgram(self._dark.program)
        self._dark.helper.Render()

    def count(self, *, behind):
        """Count front faces as 1 and back faces as -1, where depth passes or fails (`behind`)."""
        state = self.window.GetState()
        state.SetEnumState(gl.DEPTH_CLAMP, behind)
        for face, step_op in (
            (gl.FRONT, gl.DECR_WRAP if behind else gl.INCR_WRAP),
            (gl.BACK, gl.INCR_WRAP if behind else gl.DECR_WRAP),
        ):
            on_fail, on_pass = (step_op, gl.KEEP) if behind else (gl.KEEP, step_op)
            state.vtkglStencilOpSeparate(face, gl.KEEP, on_fail, on_pass)

    def release(self):
        """Free the GPU's memory; the context must be alive."""
        release(*self._targets, self._depth, self._dark)
