"""Annotations as vtkSSAAPass draws them: with the samples of the scene below."""

from __future__ import annotations

from typing import Any

from pvibr.core import _vtk
from pvibr.core.passes import passes_of
from pvibr.gl import enums as gl
from pvibr.gl.quad import Quad, quads_of
from pvibr.gl.scene_pass import hidden_name
from pvibr.gl.target import Target, WindowTarget, blit
from pvibr.gl.texture import nbytes_of, release

_NAME = hidden_name('end of the overlay')
# Passes inside vtkSSAAPass that draw annotations with its samples, unmodified.
_PLAIN = ('vtkCameraPass', 'vtkSequencePass', 'vtkRenderStepsPass', 'vtkSSAOPass')


class Supersampled:
    """A scene's samples, taken at the end of its pass, and annotations drawn over them."""

    def __init__(self, renderer):
        self.renderer = renderer
        # Detects the end of the pass: a 2D prop whose source is executed in each frame.
        self._source = _vtk.vtkProgrammableSource()
        self._source.AddObserver('StartEvent', lambda *_: self._take())
        mapper = _vtk.vtkPolyDataMapper2D()
        mapper.SetInputConnection(self._source.GetOutputPort())
        self._marker = _vtk.vtkActor2D()
        self._marker.SetMapper(mapper)
        self._marker.SetObjectName(_NAME)
        self._marker.PickableOff()
        self._targets: dict[str, Any] = {}
        self._sizes: tuple = ()
        self._size: tuple = ()
        self._quads: dict[str, Quad] = {}
        self._has_samples = False

    def begin(self, size):
        """Prepare to take the samples of the frame about to be drawn, if it has any."""
        self._size, self._has_samples = tuple(size), False
        passes = passes_of(self.renderer)
        if passes and passes[0].IsA('vtkSSAAPass') and all(_is_plain(p) for p in passes[1:]):
            self._source.Modified()
            self.renderer.GetViewProps().AddItem(self._marker)

    def end(self):
        """Remove the marker from the scene."""
        self.renderer.GetViewProps().RemoveItem(self._marker)

    def _take(self):
        """Copy the bound framebuffer: the scene in its sampled size."""
        window, viewport = self.renderer.GetRenderWindow(), [0] * 4
        state = window.GetState()
        state.vtkglGetIntegerv(gl.VIEWPORT, viewport)
        x, y, width, height = viewport
        sampled_size, size = (width, height), self._size
        if self._sizes != (sampled_size, size):
            self._free()
            self._sizes = sampled_size, size
            self._targets = {
                'scene': Target(window, *sampled_size),
                'drawn': Target(window, *sampled_size, depth=True),
                'across': Target(window, size[0], height, ('rgba8', 'rgba8')),
                'picture': Target(window, *size, filter='nearest'),
            }
            for name in ('scene', 'drawn', 'across'):
                for color in self._targets[name].colors:  # as VTK's textures do
                    color.object.SetWrapS(color.object.Repeat)
                    color.object.SetWrapT(color.object.Repeat)
        state.Push()
        state.PushDrawFramebufferBinding()
        self._targets['scene'].object.Bind(gl.DRAW_FRAMEBUFFER)
        state.vtkglScissor(0, 0, *sampled_size)
        source = x, y, x + width, y + height
        state.vtkglBlitFramebuffer(*source, 0, 0, *sampled_size, gl.COLOR_BUFFER_BIT, gl.NEAREST)
        state.PopDrawFramebufferBinding()
        state.Pop()
        self._has_samples = True

    def draw(self, draw_annotations, origin, size) -> bool:
        """Draw annotations over the window's pixels; return False without samples."""
        window = self.renderer.GetRenderWindow()
        if not self._has_samples or self._sizes[1] != tuple(size):
            return False
        if not self._quads:
            self._quads = quads_of(window, __file__, 'filtered')
        scene, drawn, across, picture = self._targets.values()
        state, full_rect = window.GetState(), (0, 0, drawn.width, drawn.height)
        with drawn.drawing((0.0, 0.0, 0.0, 0.0)):
            blit(state, scene.object, drawn.object, gl.COLOR_BUFFER_BIT, full_rect, full_rect)
            state.vtkglColorMask(False, False, False, True)
            state.vtkglClearColor(0.0, 0.0, 0.0, 0.0)
            state.vtkglClear(gl.COLOR_BUFFER_BIT)
            state.vtkglColorMask(True, True, True, True)
            draw_annotations()
        samples = {'drawn': drawn.colors[0], 'scene': scene.colors[0]}
        across.draw(self._quads['across'], {'width': float(size[0])}, samples)
        window_rect = *origin, origin[0] + size[0], origin[1] + size[1]
        window_target = WindowTarget(window)
        rects = window_rect, (0, 0, *size)
        blit(state, window_target.object, picture.object, gl.COLOR_BUFFER_BIT, *rects)
        samples = dict(zip(samples, across.colors, strict=True)) | {'picture': picture.colors[0]}
        with window_target.drawing():
            state.vtkglViewport(*origin, *size)
            state.vtkglScissor(*origin, *size)
            self._quads['compose'].draw_alone({}, samples, None)
        return True

    @property
    def nbytes(self) -> int:
        """Bytes on the GPU."""
        return nbytes_of(*self._targets.values())

    def _free(self):
        release(*self._targets.values())
        self._targets, self._sizes, self._has_samples = {}, (), False

    def release(self):
        """Free the GPU's memory; the context must be alive."""
        self.end()
        self._free()
        release(*self._quads.values())
        self._quads = {}


def _is_plain(render_pass):
    return any(render_pass.IsA(name) for name in _PLAIN)
