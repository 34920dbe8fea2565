"""Detects changes of actors, and tells why an image cannot replace one."""

from __future__ import annotations

from itertools import count

import numpy as np

from pvibr.core import _vtk
from pvibr.core._vtk import address
from pvibr.gl.feature import moves_vertices, replacements
from pvibr.things.content_key import parts_of
from pvibr.things.plain_actors import is_composed

#: Reason for an actor whose points or matrix are not finite.
NOT_FINITE = 'bounds that are not finite'
#: Reason for an actor that is not opaque.
TRANSLUCENT = 'translucent'
_VERSIONS = count(1)
_POINTS, _WIREFRAME = 0, 1  # VTK_POINTS, VTK_WIREFRAME
_PBR = 3  # VTK_PBR
# Cells of one dimension or none, among those of unstructured grids.
_THIN_CELLS = {1, 2, 3, 4, 21, 35, 51, 60, 68, 75}
_MAPPERS = ('vtkDataSetMapper', 'vtkOpenGLPolyDataMapper', 'vtkPolyDataMapper')


class ActorWatch:
    """Watches many actors, whose hiding and showing by us is not a change.

    VTK's times share one clock: what is later than a mark has changed since.
    """

    def __init__(self, actors=(), previous=None, parts=parts_of):
        self.actors = list(actors)
        self.hidden = np.zeros(0, int)
        self._own_mappers: list = []  # of actors drawn by others, with these
        self._parts = parts
        old_entries = {} if previous is None else previous.known
        actor_keys = [address(actor) for actor in self.actors]
        pairs = zip(actor_keys, self.actors, strict=True)
        self.known = {key: old_entries.get(key) or _Watched(actor, parts) for key, actor in pairs}
        self._watched = list(self.known.values())
        self._new_rows = [i for i, w in enumerate(self._watched) if not w.version]
        # Attribute access on PyVista actors is slow: look the methods up once.
        self._times = [actor.GetMTime for actor in self.actors]
        self._hide_calls = [actor.VisibilityOff for actor in self.actors]
        self._show_calls = [actor.VisibilityOn for actor in self.actors]
        # An assembly returns the latest time of all its parts at once; it draws nothing.
        self._assembly = _vtk.vtkPropAssembly()
        for actor in self.actors:
            self._assembly.AddPart(actor)
        self.marks = previous.marks if previous else (_vtk.vtkTimeStamp(), _vtk.vtkTimeStamp())
        self._settled_mark, self._shown_mark = self.marks
        self._list_clocks()

    def __len__(self):
        return len(self.actors)

    @property
    def versions(self) -> list[int]:
        """The version of each actor, which `changed` increments."""
        return [watched.version for watched in self._watched]

    def add(self, actor):
        """Append an actor."""
        self._new_rows.append(len(self))
        watched = _Watched(actor, self._parts)
        self.known[address(actor)] = watched
        row_values = actor, watched, actor.GetMTime, actor.VisibilityOff, actor.VisibilityOn
        for column, value in zip(self._columns(), row_values, strict=True):
            column.append(value)
        self._assembly.AddPart(actor)

    def drop(self, row):
        """Stop watching an actor; those after it move up a row."""
        actor = self.actors[row]
        for column in self._columns():
            del column[row]
        self._new_rows = [i - (i > row) for i in self._new_rows if i != row]
        self._assembly.RemovePart(actor)
        self.known.pop(address(actor), None)
        self._list_clocks()

    def _columns(self) -> tuple:
        return self.actors, self._watched, self._times, self._hide_calls, self._show_calls

    def changed(self) -> list[int]:
        """Return the rows of actors that changed since :meth:`settle`, and update their data."""
        if len(self.hidden) or self._own_mappers:
            return []  # wait until they are shown again
        for pipeline in self._pipelines:
            pipeline.Update()
        last_mark = max(self._settled_mark.GetMTime(), self._shown_mark.GetMTime())
        times = self._times if self._assembly.GetMTime() > last_mark else ()
        own_changes = [i for i, time in enumerate(times) if time() > last_mark]
        clock_times = np.array([time() for time in self._clocks], np.int64)
        part_changes = self._owners[clock_times > self._settled_mark.GetMTime()].tolist()
        changed_rows = sorted({*self._new_rows, *own_changes, *part_changes})
        if sum(self._watched[i].update() for i in changed_rows):
            self._list_clocks()
        return changed_rows

    def _list_clocks(self):
        self._owners = np.repeat(range(len(self)), [len(w.clocks) for w in self._watched])
        self._clocks = [clock for w in self._watched for clock in w.clocks]
        self._pipelines = [w.pipeline for w in self._watched if w.pipeline is not None]

    def settle(self):
        """Treat the actors as unchanged."""
        self._settled_mark.Modified()
        self._new_rows = []

    def forget(self):
        """Treat all actors as changed."""
        self._new_rows = list(range(len(self)))

    def hide(self, rows):
        """Hide actors until :meth:`show`."""
        self.hidden = np.asarray(rows, int)
        for i in self.hidden.tolist():
            self._hide_calls[i]()

    def draw_by(self, row, mapper):
        """Draw an actor by another mapper until :meth:`show`."""
        actor = self.actors[row]
        self._own_mappers.append((actor, actor.GetMapper()))
        actor.SetMapper(mapper)

    def show(self):
        """Show the hidden actors again, and draw all by their own mappers."""
        if not len(self.hidden) and not self._own_mappers:
            return
        for i in self.hidden.tolist():
            self._show_calls[i]()
        for actor, mapper in self._own_mappers:
            actor.SetMapper(mapper)
        self._shown_mark.Modified()
        self.hidden, self._own_mappers = np.zeros(0, int), []


class _Watched:
    """The parts of an actor with modification times of their own, and its data pipeline."""

    def __init__(self, actor, parts):
        self._actor, self._parts, self.version = actor, parts, 0
        self._part_getters = actor.GetMapper, actor.GetProperty, actor.GetTexture
        self._part_times: list = []
        self._composite_data: list = []  # whose blocks may be replaced
        self.clocks: list = []
        self.pipeline = None

    def update(self) -> bool:
        """Increment the version; return True if the clocks may have changed."""
        self.version = next(_VERSIONS)
        parts = *(get_part() for get_part in self._part_getters), *self._composite_data
        part_times = [(part, part.GetMTime()) for part in parts if part is not None]
        if part_times == self._part_times:
            return False
        self._part_times = part_times
        self._list_parts()
        return True

    def _list_parts(self):
        mapper = self._actor.GetMapper()
        data_source = None if updated_data(mapper) is None else mapper.GetInputAlgorithm()
        is_static = data_source is None or data_source.IsA('vtkTrivialProducer')
        self.pipeline = None if is_static else data_source
        parts = self._parts(self._actor)
        self._composite_data = [part for part in parts if part.IsA('vtkCompositeDataSet')]
        self.clocks = [part.GetMTime for part in parts]


def updated_data(mapper):
    """Return the data that a mapper draws, brought up to date, or None."""
    port_count = 0 if mapper is None else mapper.GetNumberOfInputPorts()
    if not port_count or not mapper.GetNumberOfInputConnections(0):
        return None
    mapper.GetInputAlgorithm().Update()
    return mapper.GetInputDataObject(0, 0)


def ineligibility(actor, *, relit=False) -> str:
    """Return why an image cannot replace an actor, empty if it can.

    An image that is `relit` in each frame stores colours and normals of a single VTK material.
    """
    if is_composed(actor):
        return 'drawn by another actor'
    mapper = actor.GetMapper()
    if relit and (mapper is None or mapper.GetClassName() not in _MAPPERS):
        return 'a mapper of another kind'
    data = updated_data(mapper)
    if data is None:
        return 'empty'
    if relit and (why := _not_relit(actor, data)):
        return why
    if not np.isfinite(mapper.GetBounds()).all():
        return NOT_FINITE
    bounds = actor.GetBounds()
    if bounds is None or bounds[0] > bounds[1]:
        return 'empty'
    return TRANSLUCENT if actor.HasTranslucentPolygonalGeometry() else ''


def _not_relit(actor, data) -> str:
    prop = actor.GetProperty()
    if not data.IsA('vtkDataSet') or not data.GetNumberOfCells():
        return 'empty'
    if prop.GetRenderLinesAsTubes() or prop.GetRenderPointsAsSpheres():
        return 'tubes or spheres'
    if prop.GetInterpolation() == _PBR or actor.GetBackfaceProperty() is not None:
        return 'a material of another kind'
    return 'shaders of its own' if _has_shaders(actor.GetShaderProperty()) else ''


def is_evenly_clear(actor) -> bool:
    """Return whether an actor is translucent by its own opacity alone."""
    texture = actor.GetTexture()
    has_own = actor.GetMapper().HasTranslucentPolygonalGeometry() or (
        texture is not None and texture.IsTranslucent()
    )
    return actor.GetProperty().GetOpacity() < 1.0 and not has_own


def stroke_width(actor, data) -> float:
    """Return the width in pixels of the widest edges, lines and points of an actor, 0 if none."""
    prop = actor.GetProperty()
    representation, is_thin = prop.GetRepresentation(), has_thin_cells(data)
    has_points = representation == _POINTS or prop.GetVertexVisibility() or is_thin
    has_lines = representation == _WIREFRAME or prop.GetEdgeVisibility() or is_thin
    line_width = prop.GetLineWidth()
    if not prop.GetUseLineWidthForEdgeThickness():
        line_width = max(line_width, prop.GetEdgeWidth())
    return max(has_points * prop.GetPointSize(), has_lines * line_width)


def has_thin_cells(data) -> bool:
    """Return whether a dataset has lines or points other than on edges of its polygons."""
    if data.IsA('vtkPolyData'):
        has_any = data.GetNumberOfVerts() + data.GetNumberOfLines() > 0
        return has_any and not has_strays_only(data)
    if not data.IsA('vtkUnstructuredGrid'):
        return False
    cell_types = _vtk.vtk_to_numpy(data.GetDistinctCellTypesArray())
    return not _THIN_CELLS.isdisjoint(cell_types.tolist())


def _has_shaders(shader) -> bool:
    if shader.HasFragmentShaderCode() or moves_vertices(shader):
        return True
    return any('// pvibr:' not in text for text in replacements(shader).values())


def has_strays_only(data) -> bool:
    """Return True if all lines and points of polydata lie on edges of its polygons."""
    polygons, lines = data.GetPolys(), data.GetLines()
    if not data.GetNumberOfPolys() or data.GetNumberOfStrips():
        return False
    point_count = data.GetNumberOfPoints()
    corners = _vtk.vtk_to_numpy(polygons.GetConnectivityArray())
    loose_points = _vtk.vtk_to_numpy(data.GetVerts().GetConnectivityArray())
    polygon_edges = _sorted_edges(polygons, point_count, closed=True)
    line_edges = _sorted_edges(lines, point_count)
    on_corners, on_edges = np.isin(loose_points, corners), np.isin(line_edges, polygon_edges)
    return bool(on_corners.all() and on_edges.all())


def _sorted_edges(cells, count, *, closed=False):
    """Return a number for each undirected edge of cells."""
    corners = _vtk.vtk_to_numpy(cells.GetConnectivityArray()).astype(np.int64)
    ends = _vtk.vtk_to_numpy(cells.GetOffsetsArray())
    next_corners = np.roll(corners, -1)
    cell_ends = ends[1:][np.diff(ends) > 0] - 1
    if closed:
        next_corners[cell_ends] = corners[ends[:-1][np.diff(ends) > 0]]
    else:
        corners, next_corners = np.delete(corners, cell_ends), np.delete(next_corners, cell_ends)
    return np.minimum(corners, next_corners) * count + np.maximum(corners, next_corners)
