"""Props drawn outside VTK's render loop, from any view."""

from __future__ import annotations

from contextlib import contextmanager

from pvibr.core import _vtk
from pvibr.gl import enums as gl
from pvibr.gl.doubles import Doubles

# Blend equation, and factors of colours and alpha.
_BLENDS = {
    'multiply': (gl.FUNC_ADD, (gl.ZERO, gl.SRC_COLOR) * 2),
    'least': (gl.MIN, (gl.ONE, gl.ONE) * 2),
    'over': (gl.FUNC_ADD, gl.OVER),
}


class Drawer:
    """Draws a renderer's props from any view into the bound target."""

    def __init__(self, renderer):
        self.renderer = renderer
        self.window = renderer.GetRenderWindow()
        self.inner = _vtk.vtkOpenGLRenderer()
        self.inner.SetRenderWindow(self.window)
        self.inner.AutomaticLightCreationOff()
        self.doubles = Doubles()
        self._projection = _vtk.vtkMatrix4x4()
        self._lights = -1  # modification time of the renderer's when copied

    def look(self, view, rect, *, clear=True, within=None):
        """Set the view and the rectangle of the target."""
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
        # An explicit matrix: VTK would use the window's aspect ratio.
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
        camera.Modified()  # it does not notice changes within the matrix

    def light_from(self, view=None):
        """Update the lights that follow the camera to a view, by default the renderer's."""
        if view is not None:
            self._aim(view)
        renderer = self.renderer if view is None else self.inner
        self._take_lights()
        renderer.UpdateLightsGeometryToFollowCamera()

    def _take_lights(self):
        source_lights = self.renderer.GetLights()
        if source_lights.GetMTime() != self._lights:
            self._lights = source_lights.GetMTime()
            self.inner.RemoveAllLights()
            for light in source_lights:
                self.inner.AddLight(light)

    def have_a_light(self):
        """Add a light if none is on: VTK's programs have no normals without one."""
        if not any(light.GetSwitch() for light in self.inner.GetLights()):
            self.inner.AddLight(_vtk.vtkLight())
            self.inner.UpdateLights()

    def draw_depth(self, actors, *, faces='both'):
        """Draw the depth of visible opaque actors."""
        self.draw([self.doubles.of(actor, faces) for actor in actors])

    def draw(self, actors, *, translucent=False):
        """Draw actors, ignoring their visibility."""
        for actor in actors:
            if translucent:
                actor.RenderTranslucentPolygonalGeometry(self.inner)
            else:
                actor.RenderOpaqueGeometry(self.inner)

    def fill(self, color):
        """Clear the colours of the current rectangle."""
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
        blend_equation, blend_factors = _BLENDS[mode]
        state.vtkglBlendEquation(blend_equation)
        state.vtkglBlendFuncSeparate(*blend_factors)
        yield
        state.vtkglBlendEquation(gl.FUNC_ADD)
        state.SetEnumState(gl.BLEND, False)
        state.vtkglDepthMask(True)

    @contextmanager
    def farthest(self, is_wanted):
        """Keep the farthest fragments in place of the nearest, within a view."""
        state = self.window.GetState()
        if is_wanted:
            state.vtkglClearDepth(0.0)
            state.vtkglClear(gl.DEPTH_BUFFER_BIT)
            state.vtkglDepthFunc(gl.GEQUAL)
        yield
        if is_wanted:
            state.vtkglDepthFunc(gl.LEQUAL)
            state.vtkglClearDepth(1.0)

    def done(self):
        """Undo what the view changed, before the renderer itself draws."""
        # Programs, which subplots share, update their lights only for a camera modified later.
        for renderer in self.window.GetRenderers():
            renderer.GetActiveCamera().Modified()

    def release(self):
        """Free the GPU's memory; the context must be alive."""
        self.doubles.release(self.window)
        self.inner.RemoveAllLights()
        self.inner.SetRenderWindow(None)
