"""Axes around a scene, and rulers: their lines as meshes, their labels as SVG."""

from __future__ import annotations

from itertools import product

import numpy as np
import pyvista as pv

from pvibr.web.surfaces import WebSurface, css_of, text_look

#: VTK's modes of where axes and lines of grids are, by number.
_EDGES = 'outer', 'closest', 'furthest', 'origin', 'all'
_GRIDS = 'all', 'closest', 'furthest'
_NAMES = 'XYZ'
_WORLD = 6  # VTK_WORLD
#: Labels of an axis whose actor leaves them to VTK, and how far from even places they may be.
_DEFAULT_LABELS = 5
_UNEVEN = 0.3
#: Pixels of letters, and from which size on they are 3D text, drawn larger and scaled down.
_SIZE, _SCALED = 12, 40


def is_cube_axes(prop) -> bool:
    """Return whether a prop draws axes around a scene."""
    return prop.IsA('vtkCubeAxesActor')


def is_ruler(prop) -> bool:
    """Return whether a prop draws one axis between two points of the world."""
    is_axis = prop.IsA('vtkAxisActor2D')
    return is_axis and prop.GetPositionCoordinate().GetCoordinateSystem() == _WORLD


def cube_of(actor) -> dict:
    """Return axes around a scene as an annotation."""
    bounds = np.array(actor.GetBounds()).reshape(3, 2)
    grid = _GRIDS[actor.GetGridLineLocation()]
    return {
        'kind': 'cube_axes',
        'bounds': bounds.ravel().tolist(),
        'edges': _EDGES[actor.GetFlyMode()],
        'grid': grid if any(_draws_grid(actor, axis) for axis in range(3)) else 'none',
        'axes': [_axis(actor, axis, *bounds[axis]) for axis in range(3)],
    }


def ruler_of(actor) -> dict:
    """Return an axis between two points as an annotation."""
    # Without VTK's rounding of the range, which it draws over the same length.
    first, last = actor.GetRange()
    values = np.linspace(first, last, actor.GetNumberOfLabels())
    text, title = actor.GetLabelTextProperty(), actor.GetTitle() or ''
    return {
        'kind': 'ruler',
        'ends': [
            list(actor.GetPositionCoordinate().GetValue()),
            list(actor.GetPosition2Coordinate().GetValue()),
        ],
        'ticks': np.linspace(0, 1, len(values)).tolist(),
        'labels': [_formatted(actor.GetLabelFormat(), x) for x in values],
        'title': title if actor.GetTitleVisibility() else '',
        'text': text_look(text) | {'size': _SIZE},
        'color': css_of(actor.GetProperty().GetColor()),
    }


def cube_meshes(actor, programs) -> list[dict]:
    """Return the edges and the grids of axes around a scene as things of lines."""
    bounds = np.array(actor.GetBounds()).reshape(3, 2)
    trees = []
    for axis in range(3):
        if not _visible(actor, axis):
            continue
        color = getattr(actor, f'Get{_NAMES[axis]}AxesLinesProperty')()
        for sides in product((0, 1), repeat=2):
            lines = [_edge(bounds, axis, sides)]
            trees.append(_lines(lines, color, {'edge': [axis, *sides]}))
    for axis, side in product(range(3), (0, 1)):
        lines = [
            line
            for other in ((axis + 1) % 3, (axis + 2) % 3)
            if _draws_grid(actor, other)
            for line in _grid_lines(actor, bounds, axis, side, other)
        ]
        if lines:
            color = actor.GetXAxesGridlinesProperty()
            trees.append(_lines(lines, color, {'face': [axis, side]}))
    shared: dict | None = None
    for tree, surface in trees:
        shared = shared or surface.programs(programs)  # all lines are drawn alike
        tree |= {'programs': shared}
    return [tree for tree, _ in trees]


def _edge(bounds, axis, sides):
    """Return the ends of an edge along an axis, at sides of the next two."""
    ends = np.empty((2, 3))
    ends[:, axis] = bounds[axis]
    for other, side in zip(((axis + 1) % 3, (axis + 2) % 3), sides, strict=True):
        ends[:, other] = bounds[other, side]
    return ends


def _grid_lines(actor, bounds, axis, side, other):
    """Return lines on a face, at the ticks of one of its axes."""
    across = 3 - axis - other
    positions, _ = _ticks(actor, other, *bounds[other])
    for position in positions:
        ends = np.empty((2, 3))
        ends[:, axis], ends[:, other], ends[:, across] = (
            bounds[axis, side],
            position,
            bounds[across],
        )
        yield ends


def _lines(segments, prop, cube):
    """Return lines as a thing without programs, and as a surface."""
    points = np.concatenate(segments)
    mesh = pv.PolyData(points, lines=np.insert(np.arange(len(points)).reshape(-1, 2), 0, 2, 1))
    actor = pv.Actor(mapper=pv.DataSetMapper(mesh))
    actor.prop.lighting = False
    actor.prop.color = prop.GetColor()
    actor.prop.line_width = prop.GetLineWidth()
    surface = WebSurface(actor)
    tree = surface.tree() | {
        'kind': 'mesh',
        'name': 'axes',
        'pickable': False,
        'matrix': np.eye(4).ravel().tolist(),
        'translucent': False,
        'casts': False,
        'cube': cube,
    }
    return tree, surface


def _visible(actor, axis) -> bool:
    return bool(getattr(actor, f'Get{_NAMES[axis]}AxisVisibility')())


def _draws_grid(actor, axis) -> bool:
    return bool(getattr(actor, f'GetDraw{_NAMES[axis]}Gridlines')())


def _axis(actor, axis, low, high) -> dict:
    positions, labels = _ticks(actor, axis, low, high)
    has_labels = getattr(actor, f'Get{_NAMES[axis]}AxisLabelVisibility')()
    title = getattr(actor, f'Get{_NAMES[axis]}Title')() or ''
    look = text_look(actor.GetLabelTextProperty(axis))
    return {
        'visible': _visible(actor, axis),
        'ticks': positions.tolist(),
        'labels': labels if has_labels else [''] * len(labels),
        'title': title.strip(),
        'text': look | {'size': look['size'] if look['size'] <= _SCALED else _SIZE},
        'color': css_of(getattr(actor, f'Get{_NAMES[axis]}AxesLinesProperty')().GetColor()),
    }


def _ticks(actor, axis, low, high):
    """Return the places of ticks between bounds, and their labels."""
    first, last = getattr(actor, f'Get{_NAMES[axis]}AxisRange')()
    array = actor.GetAxisLabels(axis)
    if array is None:
        values = np.linspace(first, last, _DEFAULT_LABELS)
        labels = [f'{value:.4g}' for value in values]
    else:
        labels = [array.GetValue(i) for i in range(array.GetNumberOfValues())]
        values = _values_of(labels, first, last)
    share = (values - first) / (last - first or 1)
    return low + np.clip(share, 0, 1) * (high - low), labels


def _values_of(labels, low, high):
    """Return the values of labels, even ones unless their texts say otherwise."""
    even = np.linspace(low, high, len(labels))
    try:
        written = np.array([float(label) for label in labels])
    except ValueError:
        return even
    step = abs(high - low) / max(len(labels) - 1, 1)
    is_even = np.abs(written - even).max(initial=0) <= _UNEVEN * step
    return even if is_even else written


def _formatted(pattern, value) -> str:
    """Return a number by a pattern of C or, from VTK 9.6 on, of std::format."""
    return (pattern.format(value) if '{' in pattern else pattern % value).strip()
