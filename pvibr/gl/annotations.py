"""Text, scalar bars and other flat props: kept out of a picture, drawn sharp on top."""

from __future__ import annotations

_IN_WORLD: dict[type, bool] = {}


class Annotations:
    """The flat props of a renderer, out of its list while a frame is drawn."""

    def __init__(self, renderer):
        self.renderer = renderer
        self._hidden = []

    def hide(self):
        """Take the flat props out of the list."""
        props = self.renderer.GetViewProps()
        flat = [p for p in props if p.GetVisibility() and is_flat(p)]
        for prop in flat:
            props.RemoveItem(prop)
        self._hidden = flat

    def show(self):
        """Put them back."""
        props = self.renderer.GetViewProps()
        for prop in self._hidden:
            props.AddItem(prop)

    def draw(self, origin, size):
        """Draw them over the pixels of the window."""
        renderer = self.renderer
        state = renderer.GetRenderWindow().GetState()
        state.Push()
        # In the first frame of a window nobody has set them yet.
        state.vtkglViewport(*origin, *size)
        state.vtkglScissor(*origin, *size)
        for prop in self._hidden:
            prop.RenderOpaqueGeometry(renderer)  # where scalar bars and text lay themselves out
        for prop in self._hidden:
            prop.RenderOverlay(renderer)
        state.Pop()
        self._hidden = []


def is_flat(prop) -> bool:
    """Return whether a prop lies on the screen, as text does: it has no place in the world."""
    kind = type(prop)
    if kind not in _IN_WORLD:
        _IN_WORLD[kind] = prop.IsA('vtkProp3D')
    return not _IN_WORLD[kind] and prop.GetBounds() is None
