"""What changed of actors since they were looked at, and why an image cannot stand for one."""

from __future__ import annotations

import numpy as np

from pvibr.core import _vtk
from pvibr.gl.feature import replacements

#: Why an actor is not replaced whose points or matrix are broken.
NOT_FINITE = 'bounds that are not finite'
_SURFACE, _PBR = 2, 3  # VTK_SURFACE, VTK_PBR
_MAPPERS = ('vtkDataSetMapper', 'vtkOpenGLPolyDataMapper', 'vtkPolyDataMapper')


class ActorWatch:
    """Many actors, hidden and shown again without that being a change.

    All times of VTK are of one clock: what is later than a mark has changed since.
    """

    def __init__(self, actors):
        self.actors = list(actors)
        self.hidden = np.zeros(0, int)
        self._inputs = [_Input(actor) for actor in self.actors]
        # Attributes of a PyVista actor take their time, so that its methods are looked up once.
        self._times = [actor.GetMTime for actor in self.actors]
        self._off = [actor.VisibilityOff for actor in self.actors]
        self._on = [actor.VisibilityOn for actor in self.actors]
        # It tells the latest of all their times at once; it draws nothing.
        self._all = _vtk.vtkPropAssembly()
        for actor in self.actors:
            self._all.AddPart(actor)
        self._clocks: list = []
        self._owners = np.zeros(0, int)
        self._pipelines: list = []
        self._seen, self._shown = _vtk.vtkTimeStamp(), _vtk.vtkTimeStamp()

    def __len__(self):
        return len(self.actors)

    def changed(self) -> list[int]:
        """Return which actors changed since :meth:`settle`, their data brought up to date."""
        if len(self.hidden):
            return []  # until they are shown
        for pipeline in self._pipelines:
            pipeline.Update()
        mark = max(self._seen.GetMTime(), self._shown.GetMTime())
        late = self._all.GetMTime() > mark
        own = [i for i, time in enumerate(self._times) if time() > mark] if late else []
        times = np.array([time() for time in self._clocks], np.int64)
        found = sorted({*own, *self._owners[times > self._seen.GetMTime()].tolist()})
        if found:
            self._watch(found)
        return found

    def _watch(self, rows):
        for i in rows:
            self._inputs[i].update()
        self._owners = np.repeat(range(len(self)), [len(i.clocks) for i in self._inputs])
        self._clocks = [clock for i in self._inputs for clock in i.clocks]
        self._pipelines = [i.pipeline for i in self._inputs if i.pipeline is not None]

    def settle(self):
        """Take the actors as they are now for unchanged."""
        self._seen.Modified()

    def forget(self):
        """Take all actors for changed."""
        self._seen, self._shown = _vtk.vtkTimeStamp(), _vtk.vtkTimeStamp()

    def hide(self, rows):
        """Hide some actors until :meth:`show`."""
        self.hidden = np.asarray(rows, int)
        for i in self.hidden.tolist():
            self._off[i]()

    def show(self):
        """Show the hidden actors again."""
        if len(self.hidden):
            for i in self.hidden.tolist():
                self._on[i]()
            self._shown.Modified()
            self.hidden = np.zeros(0, int)


class _Input:
    """Mapper, data and pipeline of an actor, whose times are not the actor's."""

    def __init__(self, actor):
        self._mapper = actor.GetMapper
        self.clocks: list = []
        self.pipeline = None
        self._watched: tuple = ()

    def update(self):
        mapper = self._mapper()
        data, producer = updated_data(mapper), None
        if data is not None:
            producer = mapper.GetInputAlgorithm()
        if (mapper, data, producer) == self._watched:
            return
        self._watched = mapper, data, producer
        self.clocks = [thing.GetMTime for thing in (mapper, data) if thing is not None]
        simple = producer is None or producer.IsA('vtkTrivialProducer')
        self.pipeline = None if simple else producer


def updated_data(mapper):
    """Return the data that a mapper draws, up to date; None without any."""
    ports = 0 if mapper is None else mapper.GetNumberOfInputPorts()
    if not ports or not mapper.GetNumberOfInputConnections(0):
        return None
    mapper.GetInputAlgorithm().Update()
    return mapper.GetInputDataObject(0, 0)


def ineligibility(actor, *, relit=False) -> str:
    """Return why an image cannot stand for an actor, empty if it can.

    An image that is `relit` in each frame has colours and normals of one VTK material only.
    """
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
    return 'translucent' if actor.HasTranslucentPolygonalGeometry() else ''


def _not_relit(actor, data) -> str:
    prop = actor.GetProperty()
    if not data.IsA('vtkDataSet') or not data.GetNumberOfCells():
        return 'empty'
    if prop.GetRepresentation() != _SURFACE or prop.GetEdgeVisibility():
        return 'points or lines'
    if data.IsA('vtkPolyData') and data.GetNumberOfVerts() + data.GetNumberOfLines():
        return 'points or lines'
    if prop.GetInterpolation() == _PBR or actor.GetBackfaceProperty() is not None:
        return 'a material of another kind'
    return 'shaders of its own' if _has_shaders(actor.GetShaderProperty()) else ''


def _has_shaders(shader) -> bool:
    if shader.HasVertexShaderCode() or shader.HasFragmentShaderCode():
        return True
    texts = replacements(shader).items()
    return any(stage != 'Fragment' or '// pvibr:' not in text for (stage, _), text in texts)
