"""The renderer's one place for a render pass, borrowed for a frame."""

from __future__ import annotations

from pvibr import _vtk
from pvibr.gl.texture import Texture


class Slot:
    """The scene as textures of float colours and depth, by a pass around whatever pass is there.

    Floats of 32 bits: rounded to 8 they are what VTK draws without pvibr, to the bit, which
    floats of 16 bits are not.

    Parameters
    ----------
    window : vtkOpenGLRenderWindow
        The window whose context holds the textures.
    """

    def __init__(self, window):
        self.window = window
        self.framebuffer = _vtk.vtkFramebufferPass()
        self.framebuffer.SetColorFormat(_vtk.vtkTextureObject.Float32)
        # The window's own: order-independent translucency copies depth, which wants one format.
        self.framebuffer.SetDepthFormat(_vtk.vtkTextureObject.Fixed32)
        self.colors, self.depth = [Texture(window)], Texture(window)
        self._renderer = self._found = self._plain = self._way = None

    @property
    def nbytes(self) -> int:
        """Bytes on the GPU."""
        width, height = self.colors[0].size
        return width * height * (16 + 4)

    def borrow(self, renderer):
        """Put the pass in before a frame is drawn.

        Parameters
        ----------
        renderer : vtkRenderer
            Whose slot it is.
        """
        self._renderer, self._found = renderer, renderer.GetPass()
        if self._found is None:
            self._make_plain(renderer)
        self.framebuffer.SetDelegatePass(self._found or self._plain)
        renderer.SetPass(self.framebuffer)

    def _make_plain(self, renderer):
        way = (
            renderer.GetUseDepthPeeling(),
            renderer.GetMaximumNumberOfPeels(),
            renderer.GetOcclusionRatio(),
            renderer.GetUseOIT(),
        )
        if self._way != way:
            if self._plain is not None:
                self._plain.ReleaseGraphicsResources(self.window)
            self._plain, self._way = plain_pass(renderer), way

    def give_back(self):
        """Put back what was found; the textures hold the frame."""
        renderer, self._renderer = self._renderer, None
        if renderer is not None and renderer.GetPass() is self.framebuffer:
            renderer.SetPass(self._found)
        self._found = None
        self.framebuffer.SetDelegatePass(None)
        self.colors[0].object = self.framebuffer.GetColorTexture()
        self.depth.object = self.framebuffer.GetDepthTexture()

    def release(self):
        """Free the GPU's memory; the context must be alive."""
        self.give_back()
        for owner in (self.framebuffer, self._plain):
            if owner is not None:
                owner.ReleaseGraphicsResources(self.window)
        self._plain = self._way = None


def plain_pass(renderer):
    """Return a pass that draws what a renderer draws without any.

    Parameters
    ----------
    renderer : vtkRenderer
        Its way with translucent props is kept: peeling, order-independent, or sorted.

    Returns
    -------
    vtkCameraPass
        The chain.
    """
    steps = _vtk.vtkRenderStepsPass()
    steps.SetTranslucentPass(_translucent_pass(renderer))
    camera = _vtk.vtkCameraPass()
    camera.SetDelegatePass(steps)
    return camera


def _translucent_pass(renderer):
    """Return the renderer's own way with translucent props."""
    if renderer.GetUseDepthPeeling():
        outer = _vtk.vtkDualDepthPeelingPass()
        outer.SetMaximumNumberOfPeels(renderer.GetMaximumNumberOfPeels())
        outer.SetOcclusionRatio(renderer.GetOcclusionRatio())
    elif renderer.GetUseOIT():
        outer = _vtk.vtkOrderIndependentTranslucentPass()
    else:
        return _vtk.vtkTranslucentPass()
    outer.SetTranslucentPass(_vtk.vtkTranslucentPass())  # without one, VTK crashes
    return outer
