"""Annotations over a picture as vtkSSAAPass draws them: with the samples of the scene below."""

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
# Passes inside vtkSSAAPass that draw annotations with its samples and leave them as they are.
_PLAIN = ('vtkCameraPass', 'vtkSequencePass', 'vtkRenderStepsPass', 'vtkSSAOPass')


class Supersampled:
    """The samples of a scene, taken at the end of its pass, and what is drawn over them."""

    def __init__(self, renderer):
        self.renderer = renderer
        # The end of the pass: a flat prop whose source is asked for data in each frame.
        self._source = _vtk.vtkProgrammableSource()
        self._source.AddObserver('StartEvent', lambda *_: self._take())
        mapper = _vtk.vtkPolyDataMapper2D()
        mapper.SetInputConnection(self._source.GetOutputPort())
        self._marker = _vtk.vtkActor2D()
        self._marker.SetMapper(mapper)
        self._marker.SetObjectName(_NAME)
        self._marker.PickableOff()
        self._targets: dict[str, Any] = {}
        self._made: tuple = ()
        self._size: tuple = ()
        self._quads: dict[str, Quad] = {}
        self._taken = False

    def begin(self, size):
        """Take the samples of the frame that begins, if it has any."""
        self._size, self._taken = tuple(size), False
        passes = passes_of(self.renderer)
        if passes and passes[0].IsA('vtkSSAAPass') and all(_is_plain(p) for p in passes[1:]):
            self._source.Modified()
            self.renderer.GetViewProps().AddItem(self._marker)

    def end(self):
        """Take the marker out of the scene."""
        self.renderer.GetViewProps().RemoveItem(self._marker)

    def _take(self):
        """Copy what is bound: the scene, drawn as large as it has samples."""
        window, place = self.renderer.GetRenderWindow(), [0] * 4
        state = window.GetState()
        state.vtkglGetIntegerv(gl.VIEWPORT, place)
        x, y, width, height = place
        large, size = (width, height), self._size
        if self._made != (large, size):
            self._free()
            self._made = large, size
            self._targets = {
                'scene': Target(window, *large),
                'drawn': Target(window, *large, depth=True),
                'across': Target(window, size[0], height, ('rgba8', 'rgba8')),
                'picture': Target(window, *size, filter='nearest'),
            }
            for name in ('scene', 'drawn', 'across'):
                for color in self._targets[name].colors:  # VTK's repeat, too
                    color.object.SetWrapS(color.object.Repeat)
                    color.object.SetWrapT(color.object.Repeat)
        state.Push()
        state.PushDrawFramebufferBinding()
        self._targets['scene'].object.Bind(gl.DRAW_FRAMEBUFFER)
        state.vtkglScissor(0, 0, *large)
        source = x, y, x + width, y + height
        state.vtkglBlitFramebuffer(*source, 0, 0, *large, gl.COLOR_BUFFER_BIT, gl.NEAREST)
        state.PopDrawFramebufferBinding()
        state.Pop()
        self._taken = True

    def draw(self, draw, origin, size) -> bool:
        """Draw annotations by a function over the window's pixels; False without samples."""
        window = self.renderer.GetRenderWindow()
        if not self._taken or self._made[1] != tuple(size):
            return False
        if not self._quads:
            self._quads = quads_of(window, __file__, 'filtered')
        scene, drawn, across, picture = self._targets.values()
        state, whole = window.GetState(), (0, 0, drawn.width, drawn.height)
        with drawn.drawing((0.0, 0.0, 0.0, 0.0)):
            blit(state, scene.object, drawn.object, gl.COLOR_BUFFER_BIT, whole, whole)
            state.vtkglColorMask(False, False, False, True)
            state.vtkglClearColor(0.0, 0.0, 0.0, 0.0)
            state.vtkglClear(gl.COLOR_BUFFER_BIT)
            state.vtkglColorMask(True, True, True, True)
            draw()
        samples = {'drawn': drawn.colors[0], 'scene': scene.colors[0]}
        across.draw(self._quads['across'], {'width': float(size[0])}, samples)
        place = *origin, origin[0] + size[0], origin[1] + size[1]
        shown = WindowTarget(window)
        blit(state, shown.object, picture.object, gl.COLOR_BUFFER_BIT, place, (0, 0, *size))
        samples = dict(zip(samples, across.colors, strict=True)) | {'picture': picture.colors[0]}
        with shown.drawing():
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
        self._targets, self._made, self._taken = {}, (), False

    def release(self):
        """Free the GPU's memory; the context must be alive."""
        self.end()
        self._free()
        release(*self._quads.values())
        self._quads = {}


def _is_plain(found):
    return any(found.IsA(name) for name in _PLAIN)
