"""What changed of actors since they were looked at, and why an image cannot stand for one."""

from __future__ import annotations

from itertools import count

import numpy as np

from pvibr.core import _vtk
from pvibr.core._vtk import address
from pvibr.gl.feature import replacements
from pvibr.things.content_key import parts_of
from pvibr.things.stray_cells import has_strays_only

#: Why an actor is not replaced whose points or matrix are broken.
NOT_FINITE = 'bounds that are not finite'
_VERSIONS = count(1)
_SURFACE, _PBR = 2, 3  # VTK_SURFACE, VTK_PBR
_MAPPERS = ('vtkDataSetMapper', 'vtkOpenGLPolyDataMapper', 'vtkPolyDataMapper')


class ActorWatch:
    """Many actors, hidden and shown again without that being a change.

    All times of VTK are of one clock: what is later than a mark has changed since.
    """

    def __init__(self, actors=(), before=None):
        self.actors = list(actors)
        self.hidden = np.zeros(0, int)
        known = {} if before is None else before.known
        keys = [address(actor) for actor in self.actors]
        pairs = zip(keys, self.actors, strict=True)
        self.known = {key: known.get(key) or _Watched(actor) for key, actor in pairs}
        self._watched = list(self.known.values())
        self._new = [i for i, w in enumerate(self._watched) if not w.version]
        # Attributes of a PyVista actor take their time, so that its methods are looked up once.
        self._times = [actor.GetMTime for actor in self.actors]
        self._off = [actor.VisibilityOff for actor in self.actors]
        self._on = [actor.VisibilityOn for actor in self.actors]
        # It tells the latest of all their times at once; it draws nothing.
        self._all = _vtk.vtkPropAssembly()
        for actor in self.actors:
            self._all.AddPart(actor)
        self.marks = before.marks if before else (_vtk.vtkTimeStamp(), _vtk.vtkTimeStamp())
        self._seen, self._shown = self.marks
        self._list_clocks()

    def __len__(self):
        return len(self.actors)

    @property
    def versions(self) -> list[int]:
        """A number for each actor and state of it that `changed` found."""
        return [watched.version for watched in self._watched]

    def add(self, actor):
        """Watch one more actor, the last of all."""
        self._new.append(len(self))
        watched = _Watched(actor)
        self.known[address(actor)] = watched
        new = actor, watched, actor.GetMTime, actor.VisibilityOff, actor.VisibilityOn
        for column, value in zip(self._columns(), new, strict=True):
            column.append(value)
        self._all.AddPart(actor)

    def drop(self, row):
        """Watch an actor no more; those after it take its row."""
        actor = self.actors[row]
        for column in self._columns():
            del column[row]
        self._new = [i - (i > row) for i in self._new if i != row]
        self._all.RemovePart(actor)
        self.known.pop(address(actor), None)
        self._list_clocks()

    def _columns(self) -> tuple:
        return self.actors, self._watched, self._times, self._off, self._on

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
        others = self._owners[times > self._seen.GetMTime()].tolist()
        found = sorted({*self._new, *own, *others})
        if sum(self._watched[i].update() for i in found):
            self._list_clocks()
        return found

    def _list_clocks(self):
        self._owners = np.repeat(range(len(self)), [len(w.clocks) for w in self._watched])
        self._clocks = [clock for w in self._watched for clock in w.clocks]
        self._pipelines = [w.pipeline for w in self._watched if w.pipeline is not None]

    def settle(self):
        """Take the actors as they are now for unchanged."""
        self._seen.Modified()
        self._new = []

    def forget(self):
        """Take all actors for changed."""
        self._new = list(range(len(self)))

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


class _Watched:
    """What an actor shows whose times are not the actor's, and the pipeline of its data."""

    def __init__(self, actor):
        self._actor, self.version = actor, 0
        self._holders = actor.GetMapper, actor.GetProperty, actor.GetTexture
        self._held: list = []
        self._composites: list = []  # whose blocks may be others
        self.clocks: list = []
        self.pipeline = None

    def update(self) -> bool:
        """Have a new version; return True if its clocks may be others."""
        self.version = next(_VERSIONS)
        holders = *(holder() for holder in self._holders), *self._composites
        held = [(holder, holder.GetMTime()) for holder in holders if holder is not None]
        if held == self._held:
            return False
        self._held = held
        self._list_parts()
        return True

    def _list_parts(self):
        mapper = self._actor.GetMapper()
        producer = None if updated_data(mapper) is None else mapper.GetInputAlgorithm()
        simple = producer is None or producer.IsA('vtkTrivialProducer')
        self.pipeline = None if simple else producer
        parts = parts_of(self._actor)
        self._composites = [part for part in parts if part.IsA('vtkCompositeDataSet')]
        self.clocks = [part.GetMTime for part in parts]


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
    if prop.GetRepresentation() != _SURFACE:
        return 'points or lines'
    if prop.GetEdgeVisibility():
        return 'edges'
    thin = data.IsA('vtkPolyData') and data.GetNumberOfVerts() + data.GetNumberOfLines()
    if thin and not has_strays_only(data):
        return 'points or lines'
    if prop.GetInterpolation() == _PBR or actor.GetBackfaceProperty() is not None:
        return 'a material of another kind'
    return 'shaders of its own' if _has_shaders(actor.GetShaderProperty()) else ''


def _has_shaders(shader) -> bool:
    if shader.HasVertexShaderCode() or shader.HasFragmentShaderCode():
        return True
    texts = replacements(shader).items()
    return any(stage != 'Fragment' or '// pvibr:' not in text for (stage, _), text in texts)
