"""2D overlays of a subplot: lines, filled boxes, text and a view of a texture."""

from __future__ import annotations

import numpy as np

from pvibr.core import _vtk

_FONT, _SMALLEST_FONT = 14.0, 8.0  # px
_LETTER = 0.62  # width of a letter over the font size
_PITCH = 1.4  # line spacing
_PAD = 6.0
_PANEL = (0, 0, 0, 190)
_PICTURE = 0.34  # side of the texture view, relative to the subplot's shorter side


def edges(low, high) -> np.ndarray:
    """Return the edges of boxes, shape (n, 12, 2, 3)."""
    corners = np.array(list(np.ndindex(2, 2, 2)))
    corner_pairs = np.array([(a, b) for a in range(8) for b in range(a) if (a ^ b) in (1, 2, 4)])
    corner_points = np.where(corners[None] == 1, high[:, None], low[:, None])
    return corner_points[:, corner_pairs]


def projected(frame, ends):
    """Project lines, clipped at the near plane; return those in view and their indices."""
    view = frame.view_from_world
    # Subtract the eye first for precision far from the origin.
    eye_points = (ends - frame.eye) @ view[:3, :3].T
    clip_points = eye_points @ frame.clip_from_view[:, :3].T + frame.clip_from_view[:, 3]
    w = clip_points[..., 3]
    least_w = 1e-3 * frame.near if not frame.parallel else 0.5
    line_ids = np.flatnonzero(w.max(1) > least_w)
    clip_points, w = clip_points[line_ids], w[line_ids]
    line, farther = np.arange(len(w)), w.argmax(1)
    far, near = clip_points[line, farther], clip_points[line, 1 - farther]
    share = (far[:, 3:] - least_w) / np.maximum(far[:, 3:] - near[:, 3:], 1e-300)
    near = np.where(near[:, 3:] < least_w, far + share * (near - far), near)
    ndc_lines = np.stack([c[:, :2] / c[:, 3:] for c in (far, near)], 1)
    in_view = ((ndc_lines.min(1) <= 1) & (ndc_lines.max(1) >= -1)).all(1)
    low, high = np.reshape(frame.tile, (2, 2))
    return low + (ndc_lines[in_view] + 1) / 2 * (high - low), line_ids[in_view]


class Shapes:
    """Lines or quads, one colour each."""

    def __init__(self, corners):
        self.corners = corners
        self.actor = _vtk.vtkActor2D()
        self.mapper = _mapper()
        self.actor.SetMapper(self.mapper)
        self.show(np.zeros((0, corners, 2)), np.zeros((0, 4)))

    def show(self, places, colors):
        """Show these items."""
        places = np.asarray(places, float).reshape(-1, 2)
        mesh = _mesh(places, self.corners)
        color_table = np.ascontiguousarray(colors, np.uint8).reshape(-1, 4)
        mesh.GetCellData().SetScalars(_vtk.numpy_to_vtk(color_table, deep=True))
        self.mapper.SetInputData(mesh)
        self.actor.SetVisibility(len(places) > 0)


class Words:
    """Lines of monospaced text."""

    def __init__(self, count):
        self._scale = 1
        self.actors = [_vtk.vtkTextActor() for _ in range(count)]
        for actor in self.actors:
            actor.GetPositionCoordinate().SetCoordinateSystemToNormalizedViewport()
            text_property = actor.GetTextProperty()
            text_property.SetFontFamilyToCourier()
            text_property.SetColor(1.0, 1.0, 1.0)
            text_property.SetVerticalJustificationToCentered()

    def show(self, lines, font, scale=1):
        """Show these items."""
        scale_changed, self._scale = scale != self._scale, scale
        for k, actor in enumerate(self.actors):
            actor.SetVisibility(k < len(lines))
            if k < len(lines):
                text, x, y = lines[k]
                actor.SetInput(text)
                actor.GetTextProperty().SetFontSize(font)
                actor.SetPosition(x, y)
                if scale_changed:  # VTK caches rendered text regardless of scale
                    actor.GetTextProperty().Modified()


class TexturePicture:
    """A view of a GPU texture."""

    def __init__(self):
        self.actor = _vtk.vtkTexturedActor2D()
        self.mapper = _mapper()
        self.actor.SetMapper(self.mapper)
        self.texture = _vtk.vtkOpenGLTexture()
        self.actor.SetTexture(self.texture)
        self.hide()

    def show(self, texture, part, box):
        """Show a region of a texture."""
        mesh = _mesh(_corners(box), 4)
        places = _corners(np.array([(0.0, 0.0), part])).astype(np.float32)
        mesh.GetPointData().SetTCoords(_vtk.numpy_to_vtk(places, deep=True))
        self.mapper.SetInputData(mesh)
        self.texture.SetTextureObject(texture.object)
        self.actor.VisibilityOn()

    def hide(self):
        """Hide the view and forget the texture."""
        self.texture.SetTextureObject(None)
        self.actor.VisibilityOff()


class Marks:
    """The 2D actors of an inspection, in drawing order."""

    def __init__(self):
        self.boxes = Shapes(2)
        self.panels = Shapes(4)
        self.picture = TexturePicture()
        self.tiles = Shapes(2)
        self.words = Words(40)
        flat = (self.boxes, self.panels, self.picture, self.tiles)
        self.actors = [*(shape.actor for shape in flat), *self.words.actors]
        for actor in self.actors:
            actor.PickableOff()

    def hide(self):
        """Hide all items."""
        self.picture.hide()
        for actor in self.actors:
            actor.VisibilityOff()

    def write(self, size, text_rows, picture_title, scale=1):
        """Show text with colour patches, and a frame; return the corners of the texture view."""
        sheet = _Sheet(size)
        sheet.write(text_rows)
        picture_box = None if picture_title is None else sheet.frame(*picture_title)
        self.panels.show(np.array(sheet.quads).reshape(-1, 4, 2) / size, sheet.colors)
        self.words.show(sheet.lines[: len(self.words.actors)], round(sheet.font), scale)
        return None if picture_box is None else picture_box / size

    def release(self, window):
        """Free GPU memory; the context is current."""
        self.picture.hide()
        for actor in self.actors:
            actor.ReleaseGraphicsResources(window)


class _Sheet:
    """The layout of panels, colour patches and text in a subplot, in pixels."""

    def __init__(self, size):
        self.size = np.asarray(size, float)
        self.font = float(np.clip(self.size.min() / 36, _SMALLEST_FONT, _FONT))
        self.quads: list[np.ndarray] = []
        self.colors: list[tuple] = []
        self.lines: list[tuple[str, float, float]] = []

    def write(self, text_rows):
        """Lay out rows in the upper left corner; omit those that do not fit."""
        line_pitch, top = self.font * _PITCH, self.size[1] - _PAD
        text_rows = text_rows[: max(int((top - 2 * _PAD) / line_pitch), 0)]
        if not text_rows:
            return
        width = max(len(text) for text, _ in text_rows) * self.font * _LETTER + 2.5 * self.font
        bottom = top - len(text_rows) * line_pitch - _PAD
        self._quad((_PAD, bottom), (_PAD + width, top), _PANEL)
        for k, (text, color) in enumerate(text_rows):
            x, y = 2 * _PAD, top - (k + 0.5) * line_pitch - _PAD / 2
            if color is not None:
                half = 0.4 * self.font
                patch = *np.rint(np.multiply(color, 255)), 255
                self._quad((x, y - half), (x + 2 * half, y + half), patch)
            self._line(text, x + 1.4 * self.font, y)

    def frame(self, title, ratio):
        """Lay out a panel in the lower right corner and return its corners."""
        longest_side, line_pitch = _PICTURE * self.size.min(), self.font * _PITCH
        picture_size = longest_side * np.array([min(1.0, 1 / ratio), min(1.0, ratio)])
        high_corner = np.array([self.size[0] - 2 * _PAD, 2 * _PAD + picture_size[1]])
        box = np.array([high_corner - picture_size, high_corner])
        letter_count = int(picture_size[0] / (self.font * _LETTER))
        self._quad(box[0] - _PAD, box[1] + (_PAD, line_pitch + _PAD / 2), (0, 0, 0, 255))
        self._line(title[:letter_count], box[0, 0], box[1, 1] + 0.6 * line_pitch)
        return box

    def _quad(self, low, high, color):
        self.quads.append(_corners(np.array([low, high])))
        self.colors.append(color)

    def _line(self, text, x, y):
        self.lines.append((text, x / self.size[0], y / self.size[1]))


def _corners(box):
    """Return the four corners of a box, shape (4, 2)."""
    (x0, y0), (x1, y1) = box
    return np.array([(x0, y0), (x1, y0), (x1, y1), (x0, y1)])


def outlines(low, high) -> np.ndarray:
    """Return the edges of 2D boxes."""
    (x0, y0), (x1, y1) = low.T, high.T
    corners = np.stack([np.stack(c, 1) for c in ((x0, y0), (x1, y0), (x1, y1), (x0, y1))], 1)
    return np.stack([corners, np.roll(corners, -1, 1)], 2).reshape(-1, 2, 2)


def _mapper():
    """Return a mapper in normalized viewport coordinates."""
    mapper = _vtk.vtkPolyDataMapper2D()
    place = _vtk.vtkCoordinate()
    place.SetCoordinateSystemToNormalizedViewport()
    mapper.SetTransformCoordinate(place)
    mapper.TransformCoordinateUseDoubleOn()
    mapper.SetScalarModeToUseCellData()
    return mapper


def _mesh(places, corners):
    """Return lines or quads as polydata."""
    mesh, points, cells = _vtk.vtkPolyData(), _vtk.vtkPoints(), _vtk.vtkCellArray()
    points.SetData(_vtk.numpy_to_vtk(np.c_[places, np.zeros(len(places))], deep=True))
    mesh.SetPoints(points)
    ends = np.arange(0, len(places) + 1, corners), np.arange(len(places))
    cells.SetData(*(_vtk.numpy_to_vtk(a.astype(np.int32), deep=True) for a in ends))
    (mesh.SetLines if corners == 2 else mesh.SetPolys)(cells)
    return mesh
