"""Texture units of a window that draws of things share."""

from __future__ import annotations

from functools import lru_cache

from pvibr.gl import enums as gl
from pvibr.gl.texture import BOUND, SPARE_UNIT

#: VTK hands out units from 0 on, of at least 48 in all; those from here to the spare one are ours.
_FIRST = 32


class Binder:
    """Binds the textures of a draw in their order; what the last one has bound is kept."""

    def __init__(self):
        self._bound: list | None = None

    def bind(self, textures) -> dict[str, int]:
        """Bind textures and return their units, the same dict for the same names."""
        bound = self._bound
        if bound is None and not textures:  # of what has none yet
            return _units_of(())
        if bound is None:
            window = next(iter(textures.values())).window
            bound = self._bound = BOUND.setdefault(window, list(_NOTHING))
        state = None
        for k, texture in enumerate(textures.values()):
            if bound[k] is not texture:
                state = state or texture.window.GetState()
                state.vtkglActiveTexture(gl.TEXTURE0 + _FIRST + k)
                texture.object.Bind()
                bound[k] = texture
        if state is not None:
            state.vtkglActiveTexture(SPARE_UNIT)
        return _units_of(tuple(textures))

    def unbind(self):
        """Forget what is bound, which may change; call it when the renderer has drawn."""
        if self._bound is not None:
            self._bound[:] = _NOTHING
            self._bound = None


_NOTHING = [None] * (SPARE_UNIT - gl.TEXTURE0 - _FIRST)


@lru_cache
def _units_of(names) -> dict[str, int]:
    return {name: _FIRST + k for k, name in enumerate(names)}
