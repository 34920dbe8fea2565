"""The framebuffer of a renderer's scene: the window's, or a separate one, with surfaces."""

from __future__ import annotations

from typing import Any

from pvibr.core import _vtk
from pvibr.core._vtk import method
from pvibr.gl.driver import driver_of
from pvibr.gl.enums import COLOR_BUFFER_BIT
from pvibr.gl.target import Target, WindowTarget
from pvibr.gl.texture import Texture, nbytes_of, release

_MARK = 'pvibr: '  # prefix of the names of props that are not part of a scene
_NAME = f'{_MARK}end of opaque props'
_FIRST, _NONE = 0x8CE0, 0  # GL_COLOR_ATTACHMENT0, GL_NONE
# A depth blit requires the same format on both sides: that of the window.
_DEPTH_FORMATS = {0x81A5: 'Fixed16', 0x81A6: 'Fixed24', 0x81A7: 'Fixed32', 0x8CAC: 'Float32'}


class ScenePass:
    """The framebuffer of one frame's scene, bound before VTK draws and reset afterwards."""

    def __init__(self, window):
        self.window = window
        self.needs_hdr = False
        self._scene_target: Any = None
        self._target_key: tuple = ()
        self._is_apart = False
        self._surfaces: Texture | None = None
        self._marker: _Marker | None = None
        self._attached: Any = None

    @property
    def framebuffer(self):
        """The framebuffer with the frame's colours and depth."""
        return self._scene_target.object if self.is_apart else self.window.GetRenderFramebuffer()

    @property
    def target(self) -> Target:
        """The same as a target."""
        return self._scene_target if self.is_apart else WindowTarget(self.window)

    @property
    def is_apart(self) -> bool:
        """Whether the scene is drawn into a target other than the window."""
        return self._is_apart and self._scene_target is not None

    @property
    def nbytes(self) -> int:
        """Bytes on the GPU."""
        return nbytes_of(self._scene_target, self._surfaces)

    def begin(self, frame, needs_hdr, *, single=False):
        """Prepare for a frame, with the window's samples or a single one."""
        window_samples = self.window.GetRenderFramebuffer().GetMultiSamples()
        self.needs_hdr = needs_hdr
        self._is_apart = needs_hdr or (single and window_samples > 1)
        if not self._is_apart:
            return
        self._allocate(
            _extent(frame), driver_of(self.window).light_format if needs_hdr else 'rgba8', single
        )
        self.window.GetState().PushFramebufferBindings()
        self._scene_target.object.Bind()
        self._scene_target.object.ActivateDrawBuffer(0)

    def _allocate(self, size, format, single):
        """Allocate the target, with the window's depth buffer unless samples differ."""
        window = self.window.GetRenderFramebuffer()
        samples = window.GetMultiSamples()
        window_depth = window.GetDepthAttachmentAsTextureObject()
        target_key = size, format, samples, single, window_depth, window_depth.GetHandle()
        if self._scene_target is not None and self._target_key == target_key:
            return
        old_target, self._scene_target = self._scene_target, None
        release(old_target)
        if single and samples > 1:
            self._scene_target = like_window(self.window, size, format)
        else:  # CPU volumes read the window's depth, and no copy is needed
            shared_depth = Texture.of(self.window, window_depth)
            self._scene_target = Target(
                self.window, size[0], size[1], (format,), depth=shared_depth, samples=samples
            )
        self._target_key = target_key

    def _mark(self, frame):
        self._marker = self._marker or _Marker(frame.renderer, self._detach)
        self._marker.add()

    def attach_surfaces(self, frame) -> Texture:
        """Attach a second colour for opaque props; it is detached after the last one."""
        if self._surfaces is None or self._surfaces.size != _extent(frame):
            release(self._surfaces)
            width, height = _extent(frame)
            self._surfaces = Texture(self.window).allocate(width, height, 'rgba32f')
        self._mark(frame)
        self._attached = framebuffer = self.framebuffer
        framebuffer.AddColorAttachment(1, self._surfaces.object)
        if frame.renderer.GetPreserveColorBuffer():
            self._clear(framebuffer, frame)
        framebuffer.ActivateDrawBuffers(2)
        return self._surfaces

    def _clear(self, framebuffer, frame):
        """Clear what a renderer with a preserved colour buffer does not."""
        state = self.window.GetState()
        state.Push()
        framebuffer.DeactivateDrawBuffers()
        framebuffer.ActivateDrawBuffer(1)
        state.vtkglScissor(*frame.origin, *frame.size)
        state.vtkglColorMask(True, True, True, True)
        state.vtkglClearColor(0.0, 0.0, 0.0, 0.0)
        state.vtkglClear(COLOR_BUFFER_BIT)
        state.Pop()

    def _detach(self):
        # Without multisampling and render passes the framebuffer is still bound.
        if self._attached is not None:
            framebuffer, self._attached = self._attached, None
            framebuffer.DeactivateDrawBuffers()
            framebuffer.ActivateDrawBuffer(0)
            # VTK caches two draw buffers across framebuffers, and would not set them again for its
            # translucent pass.
            self.window.GetState().vtkglDrawBuffers(2, (_FIRST, _NONE))
            framebuffer.RemoveColorAttachment(1)

    def end(self):
        """Restore the bindings after VTK has drawn."""
        self._detach()
        if self.is_apart:
            self.window.GetState().PopFramebufferBindings()

    def release(self):
        """Free the GPU's memory; the context must be alive."""
        self._detach()
        release(self._scene_target, self._surfaces, self._marker)
        self._scene_target = self._surfaces = self._marker = None
        self.needs_hdr = self._is_apart = False


def _extent(frame):
    """Return the right and upper edge of a subplot in the window."""
    return frame.origin[0] + frame.size[0], frame.origin[1] + frame.size[1]


def volumes_of(renderer) -> list:
    """Return the visible volumes of a renderer."""
    return [volume for volume in renderer.GetVolumes() if volume.GetVisibility()]


class _Marker:
    """A zero-area prop that calls back in its turn, after every other opaque one."""

    def __init__(self, renderer, call):
        self.renderer = renderer
        self.mapper = _vtk.vtkPolyDataMapper()
        self.mapper.SetInputDataObject(_no_area())
        self.mapper.AddObserver('StartEvent', lambda *_: call())
        self.actor = _vtk.vtkActor()
        self.actor.SetMapper(self.mapper)
        self.actor.SetObjectName(_NAME)
        self.actor.PickableOff()
        self.actor.UseBoundsOff()

    def add(self):
        """Enter the scene, as the last prop; the draw order keeps it there."""
        if not self.renderer.HasViewProp(self.actor):
            self.renderer.GetViewProps().AddItem(self.actor)

    def release(self):
        self.renderer.GetViewProps().RemoveItem(self.actor)
        self.mapper.RemoveAllObservers()


def hidden_name(name) -> str:
    """Return a name that excludes a prop from shadows, buffers, bakes and layers."""
    return _MARK + name


def is_marker(prop) -> bool:
    """Return whether a prop is not part of the scene: a callback or a marker."""
    return method(prop, 'GetObjectName')().startswith(_MARK)


def is_end(prop) -> bool:
    """Return whether a prop is the marker after all opaque ones."""
    return method(prop, 'GetObjectName')() == _NAME


def _no_area():
    """Return a degenerate triangle: VTK calls no mapper without cells."""
    corner_points, triangle = _vtk.vtkPoints(), _vtk.vtkPolyData()
    for _ in range(3):
        corner_points.InsertNextPoint(0.0, 0.0, 0.0)
    triangle.SetPoints(corner_points)
    triangle.Allocate(1)
    triangle.InsertNextCell(_vtk.VTK_TRIANGLE, 3, [0, 1, 2])
    return triangle


def like_window(window, size, format) -> Target:
    """Return a target with a depth buffer in the window's format."""
    target = Target(window, size[0], size[1], (format,))
    depth = Texture(window)
    window_depth = window.GetRenderFramebuffer().GetDepthAttachmentAsTextureObject()
    internal_format = window_depth.GetInternalFormat(window_depth.GetVTKDataType(), 1, False)
    kind = getattr(_vtk.vtkTextureObject, _DEPTH_FORMATS.get(internal_format, 'Float32'))
    depth.object.AllocateDepth(*size, kind)
    depth.nbytes = size[0] * size[1] * 4
    target.add_depth(depth)
    return target
