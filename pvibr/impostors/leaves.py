"""All that an impostor stands for: what changed, what is hidden, and where everything is."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from pvibr.core import _vtk


class Leaves:
    """Sources, of which thousands are asked in every frame."""

    def __init__(self, sources, sets=()):
        self.sets = list(sets)
        self.sources = [*sources, *(block for owner in sets for block in owner.blocks)]
        n = len(self.sources)
        self.fits, self.wanted = np.zeros(n, bool), np.zeros(n, bool)
        self.why = np.full(n, '', object)
        self.center, self.half = np.zeros((n, 3)), np.zeros((n, 3, 3))
        self.radius, self.reach = np.zeros(n), np.zeros((n, 3))
        self.corners = np.zeros((n, 80, 3))
        self._dops: dict = {}
        # Attributes of a PyVista actor take their time, so that its methods are looked up once.
        actors = [source.actor for source in sources]
        ends = np.cumsum([len(actors), *(len(owner.blocks) for owner in sets)]).tolist()
        self._ranges = [range(a, b) for a, b in pairwise(ends)]
        self._own = [actor.GetMTime for actor in actors]
        # It tells the latest of all their times at once; it draws nothing.
        self._actors = _vtk.vtkPropAssembly()
        for actor in actors:
            self._actors.AddPart(actor)
        self._off = [actor.VisibilityOff for actor in actors]
        self._on = [actor.VisibilityOn for actor in actors]
        self._pipelines: list = []
        self._clocks: list = []
        self._owners = np.zeros(0, int)
        self.hidden = np.zeros(0, int)
        # All times of VTK are of one clock: what is later than these marks has changed since.
        self._seen, self._shown = _vtk.vtkTimeStamp(), _vtk.vtkTimeStamp()

    def __len__(self):
        return len(self.sources)

    def update(self) -> list[int]:
        """Take over what changed since last asked, and return which did."""
        for pipeline in self._pipelines:
            pipeline.Update()
        mark = max(self._seen.GetMTime(), self._shown.GetMTime())
        late = self._actors.GetMTime() > mark
        own = [i for i, clock in enumerate(self._own) if clock() > mark] if late else []
        rest = np.array([clock() for clock in self._clocks], np.int64)
        changed = sorted({*own, *self._owners[rest > self._seen.GetMTime()].tolist()})
        for i in changed:
            self.sources[i].update(self._dops)
        if changed:
            self._watch()
        self._seen.Modified()
        for owner, rows in zip(self.sets, self._ranges, strict=True):
            if owner.changed():
                owner.update()
                changed += rows
        for i in changed:
            self._take(i)
        return changed

    def _take(self, i):
        source = self.sources[i]
        self.fits[i], self.wanted[i] = not source.why, source.shown
        self.why[i] = source.why if source.shown else 'hidden'
        if source.why:
            return
        self.center[i], self.half[i], self.radius[i] = source.center, source.half, source.radius
        self.corners[i] = source.corners
        self.reach[i] = np.abs(source.corners).max(0)

    def _watch(self):
        sources = self.sources[: len(self._own)]
        if len(self._dops) > 2 * len(sources) + 64:
            self._dops.clear()  # of data that changed since
        counts = [len(source.clocks) for source in sources]
        self._owners = np.repeat(np.arange(len(sources)), counts)
        self._clocks = [clock for source in sources for clock in source.clocks]
        self._pipelines = [source.pipeline for source in sources if source.pipeline is not None]

    def plain(self, meshes, pixels, area, pixel) -> np.ndarray:
        """Return the seconds that each takes where it is no image."""
        out = meshes.copy()
        for owner, rows in zip(self.sets, self._ranges, strict=True):
            out[rows] = owner.plain(meshes[rows], pixels[rows], area[rows], pixel)
        return out

    def hide(self, why) -> list:
        """Hide until :meth:`show` all but what is drawn as it is."""
        imaged = why == ''
        idle = (imaged | (why == 'out of view')) & self.wanted
        self.hidden = np.flatnonzero(idle[: len(self._own)])
        for i in self.hidden.tolist():
            self._off[i]()
        owners = zip(self.sets, self._ranges, strict=True)
        return [owner.thing for owner, rows in owners if owner.hide(imaged[rows])]

    def show(self):
        """Show the actors again that were hidden, which is no change."""
        if len(self.hidden):
            for i in self.hidden.tolist():
                self._on[i]()
            self._shown.Modified()
            self.hidden = np.zeros(0, int)

    def shown(self) -> list:
        """Return the actors that the user has visible."""
        hidden = set(self.hidden.tolist())
        actors = enumerate(self.sources[: len(self._own)])
        return [s.actor for i, s in actors if i in hidden or s.shown]

    def drawn(self) -> list:
        """Return the actors that are visible now."""
        return [s.actor for s in self.sources[: len(self._own)] if s.shown]

    def rest(self):
        """Have everything drawn as it is."""
        self.show()
        for owner in self.sets:
            owner.show()

    def release(self, window):
        """Free the GPU's memory; the context must be alive."""
        self.rest()
        for owner in (*self.sources[: len(self._own)], *self.sets):
            owner.release(window)
        self._seen = _vtk.vtkTimeStamp()  # all is to be made anew
