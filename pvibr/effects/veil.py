"""How much volumes hide of what is behind them."""

from __future__ import annotations

from typing import Any

from pvibr.gl import enums as gl
from pvibr.gl.scene_pass import like_window, volumes_of
from pvibr.gl.texture import Texture, nbytes_of, release


class Veil:
    """The opacity of the volumes in front of the surface in each pixel, drawn separately."""

    def __init__(self, renderer):
        self.renderer = renderer
        self._target: Any = None

    @property
    def nbytes(self) -> int:
        """Bytes on the GPU."""
        return nbytes_of(self._target)

    def draw(self, frame, picture) -> Texture | None:
        """Return a window-sized texture with the opacity as alpha, or None without volumes."""
        volumes = volumes_of(self.renderer)
        if not volumes:
            return None
        window, (x, y), (width, height) = frame.window, frame.origin, frame.size
        subplot_rect = x, y, x + width, y + height
        if self._target is None or self._target.colors[0].size != subplot_rect[2:]:
            release(self._target)
            self._target = like_window(window, subplot_rect[2:], 'rgba8')
        target, state = self._target, window.GetState()
        with target.drawing((0.0, 0.0, 0.0, 0.0)):
            picture.blit_depth(target.object, subplot_rect)
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
