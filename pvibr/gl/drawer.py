"""Props drawn without VTK's render loop, from any view."""

from __future__ import annotations

from contextlib import contextmanager

from pvibr.core import _vtk
from pvibr.gl import enums as gl
from pvibr.gl.doubles import Doubles

# How draws meet the target: an equation, and factors of colours and of alpha.
_BLENDS = {
    'multiply': (gl.FUNC_ADD, (gl.ZERO, gl.SRC_COLOR) * 2),
    'least': (gl.MIN, (gl.ONE, gl.ONE) * 2),
    'over': (gl.FUNC_ADD, gl.OVER),
}


class Drawer:
    """Draws props of a renderer from any view into the bound target."""

    def __init__(self, renderer):
        self.renderer = renderer
        self.window = renderer.GetRenderWindow()
        self.inner = _vtk.vtkOpenGLRenderer()
        self.inner.SetRenderWindow(self.window)
        self.inner.AutomaticLightCreationOff()
        self.doubles = Doubles()
        self._projection = _vtk.vtkMatrix4x4()
        self._lights = -1  # when the renderer's were taken over

    def look(self, view, rect, *, clear=True, within=None):
        """Set the view, and the rectangle of the target to draw in."""
        state = self.window.GetState()
        state.vtkglViewport(*rect)
        state.vtkglScissor(*(within or rect))
        state.SetEnumState(gl.SCISSOR_TEST, True)
        state.SetEnumState(gl.BLEND, False)
        state.SetEnumState(gl.DEPTH_TEST, True)
        state.vtkglDepthMask(True)
        if clear:
            state.vtkglClearDepth(1.0)
            state.vtkglClear(gl.DEPTH_BUFFER_BIT)
        self._aim(view)
        self._take_lights()
        self.inner.UpdateLights()

    def _aim(self, view):
        # An explicit matrix, since otherwise VTK uses the aspect ratio of the window.
        camera = self.inner.GetActiveCamera()
        position, focus, up = view.camera()
        camera.SetPosition(position.tolist())
        camera.SetFocalPoint(focus.tolist())
        camera.SetViewUp(up.tolist())
        camera.SetClippingRange(view.near, view.far)
        camera.SetParallelProjection(view.parallel)
        self._projection.DeepCopy(view.clip_from_view.ravel().tolist())
        camera.SetExplicitProjectionTransformMatrix(self._projection)
        camera.UseExplicitProjectionTransformMatrixOn()
        camera.Modified()  # of a matrix that changes within, it takes no notice

    def light_from(self, view=None):
        """Let the lights that follow a camera do so for a view, by default the renderer's."""
        if view is not None:
            self._aim(view)
        renderer = self.renderer if view is None else self.inner
        self._take_lights()
        renderer.UpdateLightsGeometryToFollowCamera()

    def _take_lights(self):
        theirs = self.renderer.GetLights()
        if theirs.GetMTime() != self._lights:
            self._lights = theirs.GetMTime()
            self.inner.RemoveAllLights()
            for light in theirs:
                self.inner.AddLight(light)

    def have_a_light(self):
        """Add a light if none is on: without one, VTK's programs know no normals."""
        if not any(light.GetSwitch() for light in self.inner.GetLights()):
            self.inner.AddLight(_vtk.vtkLight())
            self.inner.UpdateLights()

    def draw_depth(self, actors, *, faces='both'):
        """Draw the depth of visible opaque actors."""
        self.draw([self.doubles.of(actor, faces) for actor in actors])

    def draw(self, actors, *, translucent=False):
        """Draw actors that are visible."""
        for actor in actors:
            if translucent:
                actor.RenderTranslucentPolygonalGeometry(self.inner)
            else:
                actor.RenderOpaqueGeometry(self.inner)

    def fill(self, color):
        """Clear the colours of the rectangle of :meth:`look`."""
        state = self.window.GetState()
        state.vtkglColorMask(True, True, True, True)
        state.vtkglClearColor(*color)
        state.vtkglClear(gl.COLOR_BUFFER_BIT)

    @contextmanager
    def blending(self, mode):
        """Blend draws: multiply the target, keep the minimum, or cover it by alpha."""
        state = self.window.GetState()
        state.vtkglDepthMask(False)
        state.SetEnumState(gl.BLEND, True)
        equation, factors = _BLENDS[mode]
        state.vtkglBlendEquation(equation)
        state.vtkglBlendFuncSeparate(*factors)
        yield
        state.vtkglBlendEquation(gl.FUNC_ADD)
        state.SetEnumState(gl.BLEND, False)
        state.vtkglDepthMask(True)

    def done(self):
        """Undo what the view changed, before the renderer itself draws."""
        # A program keeps the lights as the last camera saw them until a camera is newer, and
        # subplots share programs.
        for renderer in self.window.GetRenderers():
            renderer.GetActiveCamera().Modified()

    def release(self):
        """Free the GPU's memory; the context must be alive."""
        self.doubles.release(self.window)
        self.inner.RemoveAllLights()
        self.inner.SetRenderWindow(None)
