"""2D lines, markers and a label over the picture, unaffected by effects and shadows."""

from __future__ import annotations

import itertools

import numpy as np
import pyvista as pv

from pvibr.core import _vtk
from pvibr.core.plotters import put_inner
from pvibr_widgets.handles_stage import lines_to_pixels

#: Around what is drawn, so that it is seen before anything.
DARK = (20, 20, 20)
#: What the mouse is over.
HOVERED = (255, 245, 200)
# Corners, where the first of them is as a share of what is between two, and radius.
_SHAPES = {
    'square': (4, 0.5, 1.2),
    'diamond': (4, 0.0, 1.1),
    'triangle': (3, 0.75, 1.2),
    'circle': (24, 0.0, 1.0),
}
_WIDTH = 2  # pixels of a line, with as many around it


class Marks:
    """The 2D graphics of handles."""

    def __init__(self, renderer):
        self._renderer = renderer
        self._under, self._lines, self._marks = (_Flat(renderer) for _ in range(3))
        self._text = _vtk.vtkTextActor()
        self._text.PickableOff()
        style = self._text.GetTextProperty()
        style.SetFontSize(14)
        style.SetColor(1.0, 1.0, 1.0)
        style.SetBackgroundColor(*(c / 255 for c in DARK))
        style.SetBackgroundOpacity(0.8)
        put_inner(renderer, self._text)

    def draw_lines(self, frame, groups):
        """Show lines."""
        pixels = [lines_to_pixels(frame, segments) for segments, _ in groups]
        self._under.actor.GetProperty().SetLineWidth(3 * _WIDTH * frame.scale)
        self._lines.actor.GetProperty().SetLineWidth(_WIDTH * frame.scale)
        colors = [[c] * len(p) for p, (_, c) in zip(pixels, groups, strict=True)]
        flat = np.concatenate([np.zeros((0, 2, 2)), *pixels])
        rows = [color for group in colors for color in group]
        cells = np.arange(2 * len(flat)).reshape(-1, 2)
        self._under.show(flat.reshape(-1, 2), [DARK] * len(flat), lines=cells)
        self._lines.show(flat.reshape(-1, 2), rows, lines=cells)

    def draw_marks(self, marks):
        """Show markers."""
        polygons = []
        for place, shape, color, size in marks:
            for radius, paint in ((size / 2, DARK), (size / 2 - 3, color)):
                polygons.append((place + radius * _corners(shape), paint))
        self.draw_polygons(polygons)

    def draw_polygons(self, polygons):
        """Show polygons instead of markers."""
        ends = np.cumsum([0, *(len(corners) for corners, _ in polygons)])
        cells = [np.arange(a, b) for a, b in itertools.pairwise(ends)]
        corners = np.concatenate([np.zeros((0, 2)), *(c for c, _ in polygons)])
        self._marks.show(corners, [color for _, color in polygons], faces=cells)

    def say(self, text, place=None):
        """Show a label beside a point."""
        self._text.SetInput(f' {text} ' if text else '')
        if place is not None:
            self._text.SetPosition(*(float(x) for x in place))

    def hide(self):
        """Hide everything."""
        for flat in (self._under, self._lines, self._marks):
            flat.show((), ())
        self.say('')

    def remove(self):
        """Remove all actors from the renderer."""
        for prop in (self._under.actor, self._lines.actor, self._marks.actor, self._text):
            self._renderer.RemoveViewProp(prop)


class _Flat:
    """An actor of polygons and lines in pixels of the subplot."""

    def __init__(self, renderer):
        self._mapper = _vtk.vtkPolyDataMapper2D()
        self._mapper.SetScalarModeToUseCellData()
        self.actor = _vtk.vtkActor2D()
        self.actor.SetMapper(self._mapper)
        self.actor.PickableOff()
        self.show((), ())
        put_inner(renderer, self.actor)

    def show(self, pixels, colors, **cells):
        mesh = pv.PolyData()
        if len(pixels):
            points = np.column_stack([pixels, np.zeros(len(pixels))])
            cells = {k: np.concatenate([[len(c), *c] for c in v]) for k, v in cells.items()}
            mesh = pv.PolyData(points.astype(np.float32), **cells)
            mesh.cell_data['colors'] = np.array(colors, np.uint8)
            mesh.set_active_scalars('colors', preference='cell')
        self._mapper.SetInputData(mesh)


def _corners(shape):
    sides, turn, radius = _SHAPES[shape]
    angles = 2 * np.pi * (np.arange(sides) + turn) / sides
    return radius * np.column_stack([np.cos(angles), np.sin(angles)])
