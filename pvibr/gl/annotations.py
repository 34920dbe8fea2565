"""Text, scalar bars and other flat props: kept out of a picture, drawn sharp on top."""

from __future__ import annotations

from pvibr.gl.supersampled import Supersampled

_IN_WORLD: dict[type, bool] = {}


class Annotations:
    """The flat props of a renderer, out of its list while a frame is drawn."""

    def __init__(self, renderer):
        self.renderer = renderer
        self._hidden = []
        self._supersampled = Supersampled(renderer)

    @property
    def nbytes(self) -> int:
        """Bytes on the GPU."""
        return self._supersampled.nbytes

    def hide(self, size):
        """Take the flat props out of the list of a frame of some size."""
        props = self.renderer.GetViewProps()
        flat = [p for p in props if p.GetVisibility() and is_flat(p)]
        for prop in flat:
            props.RemoveItem(prop)
        self._hidden = flat
        if flat:
            self._supersampled.begin(size)

    def show(self):
        """Put them back."""
        self._supersampled.end()
        props = self.renderer.GetViewProps()
        for prop in self._hidden:
            props.AddItem(prop)

    def draw(self, origin, size):
        """Draw them over the pixels of the window."""
        if self._hidden and not self._supersampled.draw(self._draw, origin, size):
            state = self.renderer.GetRenderWindow().GetState()
            state.Push()
            # In the first frame of a window nobody has set them yet.
            state.vtkglViewport(*origin, *size)
            state.vtkglScissor(*origin, *size)
            self._draw()
            state.Pop()
        self._hidden = []

    def _draw(self):
        for prop in self._hidden:
            prop.RenderOpaqueGeometry(self.renderer)  # where scalar bars and text lay out
        for prop in self._hidden:
            prop.RenderOverlay(self.renderer)

    def release(self):
        """Free the GPU's memory; the context must be alive."""
        self._supersampled.release()


def is_flat(prop) -> bool:
    """Return whether a prop lies on the screen, as text does: it has no place in the world."""
    kind = type(prop)
    if kind not in _IN_WORLD:
        _IN_WORLD[kind] = prop.IsA('vtkProp3D')
    return not _IN_WORLD[kind] and prop.GetBounds() is None
