"""How much of what the camera sees volumes hide."""

from __future__ import annotations

from typing import Any

from pvibr.gl import enums as gl
from pvibr.gl.scene_pass import like_window, volumes_of
from pvibr.gl.texture import Texture, nbytes_of, release


class Veil:
    """The opacity of volumes before the surface in each pixel, drawn once more for itself."""

    def __init__(self, renderer):
        self.renderer = renderer
        self._target: Any = None

    @property
    def nbytes(self) -> int:
        """Bytes on the GPU."""
        return nbytes_of(self._target)

    def draw(self, frame, picture) -> Texture | None:
        """Return a texture as large as the subplot's end, alpha the opacity; None without any."""
        volumes = volumes_of(self.renderer)
        if not volumes:
            return None
        window, (x, y), (width, height) = frame.window, frame.origin, frame.size
        place = x, y, x + width, y + height
        if self._target is None or self._target.colors[0].size != place[2:]:
            release(self._target)
            self._target = like_window(window, place[2:], 'rgba8')
        target, state = self._target, window.GetState()
        with target.drawing((0.0, 0.0, 0.0, 0.0)):
            picture.blit_depth(target.object, place)
            state.vtkglViewport(x, y, width, height)
            state.vtkglScissor(x, y, width, height)
            state.SetEnumState(gl.DEPTH_TEST, True)
            state.SetEnumState(gl.BLEND, True)
            for volume in volumes:
                volume.RenderVolumetricGeometry(self.renderer)
        return target.colors[0]

    def release(self):
        """Free the GPU's memory; the context must be alive."""
        release(self._target)
        self._target = None
