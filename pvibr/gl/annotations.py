"""Text, scalar bars and other 2D props: left out of the picture and drawn sharp on top."""

from __future__ import annotations

from pvibr.gl.supersampled import Supersampled

_IN_WORLD: dict[type, bool] = {}


class Annotations:
    """A renderer's 2D props, removed from its list while a frame is drawn."""

    def __init__(self, renderer):
        self.renderer = renderer
        self._removed_props = []
        self._supersampled = Supersampled(renderer)

    @property
    def nbytes(self) -> int:
        """Bytes on the GPU."""
        return self._supersampled.nbytes

    def hide(self, size):
        """Remove the 2D props from the renderer's list for a frame of a given size."""
        props = self.renderer.GetViewProps()
        flat_props = [p for p in props if p.GetVisibility() and is_flat(p)]
        for prop in flat_props:
            props.RemoveItem(prop)
        self._removed_props = flat_props
        if flat_props:
            self._supersampled.begin(size)

    def show(self):
        """Restore them."""
        self._supersampled.end()
        props = self.renderer.GetViewProps()
        for prop in self._removed_props:
            props.AddItem(prop)

    def draw(self, origin, size):
        """Draw them over the window's pixels."""
        if self._removed_props and not self._supersampled.draw(self._draw, origin, size):
            state = self.renderer.GetRenderWindow().GetState()
            state.Push()
            # In a window's first frame these are unset.
            state.vtkglViewport(*origin, *size)
            state.vtkglScissor(*origin, *size)
            self._draw()
            state.Pop()
        self._removed_props = []

    def _draw(self):
        for prop in self._removed_props:
            prop.RenderOpaqueGeometry(self.renderer)  # scalar bars and text lay out here
        for prop in self._removed_props:
            prop.RenderOverlay(self.renderer)

    def release(self):
        """Free the GPU's memory; the context must be alive."""
        self._supersampled.release()


def is_flat(prop) -> bool:
    """Return whether a prop is 2D, such as text: it has no position in the world."""
    prop_type = type(prop)
    if prop_type not in _IN_WORLD:
        _IN_WORLD[prop_type] = prop.IsA('vtkProp3D')
    if _IN_WORLD[prop_type]:
        return False
    if prop.IsA('vtkPropAssembly'):  # whose bounds leave parts out
        return all(map(is_flat, prop.GetParts()))
    return prop.GetBounds() is None
