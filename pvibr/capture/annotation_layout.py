"""Layout of scalar bars and captions, which VTK derives from the frame before."""

from __future__ import annotations

from contextlib import contextmanager


@contextmanager
def kept_layout(window):
    """Lay out bars and captions afterwards as before, whatever is drawn in between."""
    fonts = [text.GetScaledTextProperty() for text in _caption_texts(window)]
    font_sizes = [font.GetFontSize() for font in fonts]
    try:
        yield
    finally:
        # VTK fits a caption's font starting from the last one, and ends elsewhere.
        for font, size in zip(fonts, font_sizes, strict=True):
            font.SetFontSize(size)
        lay_out(window)


def lay_out(window):
    """Lay out scalar bars for the next frame."""
    # VTK measures a bar's title in the font of its last frame, that of another tile scale, and
    # chooses the font only then: so the layout is the right one the second time.
    for renderer in window.GetRenderers():
        for bar in _bars(renderer) if renderer.GetDraw() else ():
            bar.Modified()
            bar.RenderOpaqueGeometry(renderer)
            bar.Modified()


@contextmanager
def scaled_captions(window, scale):
    """Magnify captions by the scale of tiles: VTK does so twice, by their boxes and fonts."""
    texts = list(_caption_texts(window))
    heights = [text.GetMaximumLineHeight() for text in texts]
    try:
        for text, height in zip(texts, heights, strict=True):
            text.SetMaximumLineHeight(height / scale)
        yield
    finally:
        for text, height in zip(texts, heights, strict=True):
            text.SetMaximumLineHeight(height)


def _bars(renderer):
    """Return the visible scalar bars of a renderer, also those of widgets."""
    props = [p for p in renderer.GetViewProps() if p.GetVisibility()]
    bars = [p for p in props if p.IsA('vtkScalarBarActor')]
    return bars + [p.GetScalarBarActor() for p in props if p.IsA('vtkScalarBarRepresentation')]


def _caption_texts(window):
    """Yield the texts of all subplots that are fitted into boxes, such as those of axes."""
    for renderer in window.GetRenderers():
        for prop in renderer.GetViewProps():
            for part in _captions(prop):
                text = part if part.IsA('vtkTextActor') else part.GetTextActor()
                if text.GetTextScaleMode() == text.TEXT_SCALE_MODE_PROP:
                    yield text


def _captions(prop) -> list:
    """Return the captions and texts that a prop consists of."""
    if prop.IsA('vtkAxesActor'):
        return [getattr(prop, f'Get{axis}AxisCaptionActor2D')() for axis in 'XYZ']
    return [prop] if prop.IsA('vtkTextActor') or prop.IsA('vtkCaptionActor2D') else []
