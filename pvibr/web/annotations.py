"""Text, scalar bars, axes and labels of subplots, as a page lays them out in SVG."""

from __future__ import annotations

import re
import tempfile
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pyvista as pv

from pvibr.core import _vtk
from pvibr.core._vtk import address
from pvibr.core.plotters import border_of, names_of, plain_name
from pvibr.gl.annotations import is_flat
from pvibr.gl.scene_pass import is_marker
from pvibr.web.cube_axes import cube_of, is_cube_axes, is_ruler, ruler_of
from pvibr.web.surfaces import css_of, table_of, text_look

_LEGEND = 'vtkLegendBoxActor'
#: Flat props of which GL2PS knows all text.
_TEXTS = 'vtkCornerAnnotation', 'vtkTextActor', _LEGEND
_LABELS = 'vtkLabelPlacementMapper'
_ROUNDED = 2  # vtkLabelPlacementMapper::ROUNDED_RECT
#: Size of a legend's symbol, and how far below the top of its text it is, in sizes of the font.
_SYMBOL_SIZE, _SYMBOL_DOWN = 0.45, 0.7
#: Room of a square at an end of a bar, in widths of the bar; one below horizontal ones is outside.
_SWATCH = 1.3
_SVG = '{http://www.w3.org/2000/svg}'


def flat_props(renderer) -> list:
    """Return names and visible 2D props of a renderer."""
    names = names_of(renderer)
    props = [p for p in renderer.GetViewProps() if is_flat(p) and not is_marker(p)]
    visible = [p for p in props if p.GetVisibility() and p is not border_of(renderer)]
    return [(plain_name(names.get(address(p), type(p).__name__)), p) for p in visible]


def why_no_annotation(prop) -> str | None:
    """Return why a page does not draw a 2D prop, or None if it does."""
    if _is_bar(prop) or is_ruler(prop) or any(prop.IsA(kind) for kind in _TEXTS):
        return None
    mapper = prop.GetMapper() if prop.IsA('vtkActor2D') else None
    if mapper is not None and mapper.IsA(_LABELS):
        return None
    return f'pages do not draw {type(prop).__name__}'


def widgets_missing(renderer) -> list[str]:
    """Return the names of widgets that a page does not draw."""
    widget = getattr(renderer, 'axes_widget', None)
    if widget is None or not widget.GetEnabled() or _axes_of(widget) is not None:
        return []
    return ['orientation widget']


def annotations_of(renderer, plain_renderer, things, size) -> list[dict]:
    """Return the annotations of a renderer, whose 2D props its plain copy gives away.

    Positions are fractions of the viewport, whose size is in pixels; font sizes are in pixels.
    """
    props = [prop for _, prop in flat_props(plain_renderer) if why_no_annotation(prop) is None]
    labels = [p for p in props if p.IsA('vtkActor2D') and _labels_mapper(p) is not None]
    bars = [prop for prop in props if _is_bar(prop)]
    texts = [prop for prop in props if prop not in (*labels, *bars) and not is_ruler(prop)]
    annotations = [{'kind': 'text', **text} for text in _texts_of(texts, size)]
    annotations[:0] = [_legend(prop, annotations, size) for prop in texts if prop.IsA(_LEGEND)]
    annotations += [_bar(bar, things, size) for bar in bars]
    annotations += [_labels(_labels_mapper(prop)) for prop in labels]
    annotations += [ruler_of(prop) for _, prop in flat_props(renderer) if is_ruler(prop)]
    cubes = [p for p in renderer.GetViewProps() if is_cube_axes(p) and p.GetVisibility()]
    annotations += [cube_of(cube) for cube in cubes]
    widget = getattr(renderer, 'axes_widget', None)
    axes = _axes_of(widget) if widget is not None and widget.GetEnabled() else None
    return annotations if axes is None else [*annotations, _axes(widget, axes)]


def _is_bar(prop) -> bool:
    return prop.IsA('vtkScalarBarActor')


def _labels_mapper(prop):
    mapper = prop.GetMapper() if prop.IsA('vtkActor2D') else None
    return mapper if mapper is not None and mapper.IsA(_LABELS) else None


def _texts_of(props, size) -> list[dict]:
    """Return each text that VTK draws of 2D props, where and how."""
    if not props:
        return []
    plotter = pv.Plotter(off_screen=True, window_size=list(size))
    for prop in props:
        plotter.renderer.AddViewProp(prop)
    plotter.show(auto_close=False)
    exporter = _vtk.vtkGL2PSExporter()
    exporter.SetRenderWindow(plotter.render_window)
    exporter.SetFileFormatToSVG()
    exporter.CompressOff()
    exporter.TextAsPathOff()
    with tempfile.TemporaryDirectory() as folder:
        exporter.SetFilePrefix(str(Path(folder) / 'page'))
        exporter.Write()
        text = (Path(folder) / 'page.svg').read_text(encoding='utf-8', errors='replace')
    for prop in props:
        plotter.renderer.RemoveViewProp(prop)
    plotter.close()
    return [_text(node, size) for node in ElementTree.fromstring(text).iter(f'{_SVG}text')]


def _text(node, size) -> dict:
    """Return a text of an SVG by GL2PS."""
    font = node.get('font-family', '')
    turned = re.match(r'rotate\((-?[\d.]+)', node.get('transform', ''))
    return {
        'text': (node.text or '').rstrip(),
        'x': float(node.get('x')) / size[0],
        'y': float(node.get('y')) / size[1],
        'down': float(node.get('dy', 0)),
        'size': float(node.get('font-size')),
        'color': node.get('fill'),
        'anchor': node.get('text-anchor', 'start'),
        'rotate': float(turned[1]) if turned else 0.0,
        'family': {'Cour': 'courier', 'Time': 'times'}.get(font[:4], 'arial'),
        'bold': 'Bold' in font or node.get('font-weight') == 'bold',
        'italic': 'Italic' in font or 'Oblique' in font or node.get('font-style') == 'italic',
    }


def _legend(legend, texts, size) -> dict:
    """Return the box of a legend, and the symbols beside its texts."""
    left, bottom = legend.GetPosition()
    width, height = legend.GetPosition2()
    symbols = []
    for number in range(legend.GetNumberOfEntries()):
        shape, name = legend.GetEntrySymbol(number), (legend.GetEntryString(number) or '').strip()
        text = next((text for text in texts if text['text'].strip() == name), None)
        if shape is None or text is None or not shape.GetNumberOfPoints():
            continue
        points = np.array(pv.wrap(shape).points)[:, :2]
        points = (points - (points.min(0) + points.max(0)) / 2) / max(
            np.ptp(points, 0).max(), 1e-9
        )
        pixels = [-0.55, 0.0] + _SYMBOL_SIZE * points * [1, -1]
        center = [text['x'] * size[0], text['y'] * size[1] + text['down'] * _SYMBOL_DOWN]
        places = (center + pixels * text['size']) / size
        color = css_of(legend.GetEntryColor(number))
        symbols += [
            {'points': places[cell].ravel().tolist(), 'color': color} for cell in _rings(shape)
        ]
    return {
        'kind': 'legend',
        'rect': [left, bottom, width, height],
        'fill': css_of(legend.GetBackgroundColor()) if legend.GetUseBackground() else None,
        'fill_opacity': legend.GetBackgroundOpacity(),
        'border': css_of(legend.GetProperty().GetColor()) if legend.GetBorder() else None,
        'symbols': symbols,
    }


def _rings(shape) -> list:
    """Return the points of each polygon or strip of a flat mesh."""
    mesh = pv.wrap(shape)
    mesh = mesh.triangulate() if mesh.n_strips else mesh
    return [cell.point_ids for cell in mesh.cell if cell.n_points > 2]


def _bar(bar, things, size) -> dict:
    """Return a scalar bar, and the name of the thing whose colours it shows."""
    title = bar.GetTitle() or ''
    texts, swatches = _texts_of([bar], size), _ends_of(bar)
    # With squares at its ends, VTK's layout reads what is not set.
    bar.DrawBelowRangeSwatchOff()
    bar.DrawAboveRangeSwatchOff()
    plotter = pv.Plotter(off_screen=True, window_size=list(size))
    plotter.renderer.AddViewProp(bar)
    plotter.show(auto_close=False)
    pixels = [0] * 4
    bar.GetScalarBarRect(pixels, plotter.renderer)
    plotter.renderer.RemoveViewProp(bar)
    plotter.close()
    is_horizontal = bar.GetOrientation() == 0
    rect = np.array(pixels, float)
    along, thickness = (2, rect[3]) if is_horizontal else (3, rect[2])
    count = sum(color is not None for color in swatches[is_horizontal:])
    rect[along] -= _SWATCH * thickness * count
    rect[1] += 0 if is_horizontal or swatches[0] is None else _SWATCH * thickness
    left, bottom, width, height = rect / np.tile(size, 2)
    labels = [text for text in texts if text['text'].strip() != title.strip()]
    for label in labels:
        share = (label['x'] - left) / (width - 1 / size[0])
        up = (1 - label['y'] - bottom + (0.36 * label['size']) / size[1]) / height
        label['at'] = float(share if is_horizontal else np.clip(up, 0, 1))
    names = [t['name'] for t in things if t.get('coloring', {}).get('name') == title.strip()]
    return {
        'kind': 'bar',
        'rect': [float(x) for x in (left, bottom, width, height)],
        'horizontal': is_horizontal,
        'colors': table_of(bar.GetLookupTable()),
        'labels': labels,
        'title': next((text for text in texts if text['text'].strip() == title.strip()), None),
        'swatches': [css_of(color[:3]) if color else None for color in swatches],
        'thing': names[0] if names else None,
    }


def _ends_of(bar) -> list:
    """Return the colours that a bar shows beyond its ends, None where it shows none."""
    table = bar.GetLookupTable()
    return [
        getattr(table, f'Get{end}RangeColor')()
        if getattr(bar, f'GetDraw{end}RangeSwatch')()
        else None
        for end in ('Below', 'Above')
    ]


def _labels(mapper) -> dict:
    """Return labels of points."""
    hierarchy = mapper.GetInputAlgorithm(0, 0)
    hierarchy.Update()
    chooser = hierarchy.GetInputAlgorithm(0, 0)
    chooses = chooser is not None and chooser.IsA('vtkSelectVisiblePoints')
    source = (chooser if chooses else hierarchy).GetInputDataObject(0, 0)
    names = source.GetPointData().GetAbstractArray(hierarchy.GetLabelArrayName())
    prop = hierarchy.GetTextProperty()
    has_box = mapper.GetShape() != 0
    return {
        'kind': 'labels',
        'points': np.array(pv.wrap(source).points, np.float64),
        'texts': [str(names.GetValue(i)) for i in range(names.GetNumberOfValues())],
        'fill': css_of(mapper.GetBackgroundColor()) if has_box else None,
        'fill_opacity': mapper.GetBackgroundOpacity(),
        'margin': mapper.GetMargin(),
        'rounded': mapper.GetMargin() if mapper.GetShape() == _ROUNDED else 0,
        # The depth by which surfaces may be in front; None if they hide no label.
        'tolerance': chooser.GetTolerance() if chooses else None,
        'text': text_look(prop),
    }


def _axes_of(widget):
    marker = widget.GetOrientationMarker()
    return marker if marker is not None and marker.IsA('vtkAxesActor') else None


def _axes(widget, axes) -> dict:
    """Return the arrows that show where the axes point."""
    x0, y0, x1, y1 = widget.GetViewport()
    captions = [getattr(axes, f'Get{c}AxisCaptionActor2D')() for c in 'XYZ']
    prop = captions[0].GetCaptionTextProperty()
    return {
        'kind': 'axes',
        'rect': [x0, y0, x1 - x0, y1 - y0],
        'labels': [getattr(axes, f'Get{c}AxisLabelText')() for c in 'XYZ'],
        'colors': [css_of(getattr(axes, f'Get{c}AxisShaftProperty')().GetColor()) for c in 'XYZ'],
        'text': {'size': 10, 'color': css_of(prop.GetColor()), 'bold': True, 'italic': True},
    }
