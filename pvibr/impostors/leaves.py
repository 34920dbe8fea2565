"""The leaves of an impostor: state, visibility and bounding boxes."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np

from pvibr.scene.actor_watch import ActorWatch

_COLUMNS = 'fits', 'wanted', 'center', 'half', 'radius', 'reach', 'corners', 'cells', 'seconds'


class Leaves:
    """Actors and blocks of instances, by the thousand; there may be places for more of them."""

    def __init__(self, sources, sets=()):
        self.sets = list(sets)
        self.sources: list[Any] = []
        self.fits = self.wanted = np.zeros(0, bool)
        self.why = np.zeros(0, object)
        self.center, self.half = np.zeros((0, 3)), np.zeros((0, 3, 3))
        self.radius, self.reach = np.zeros(0), np.zeros((0, 3))
        self.cells, self.seconds = np.zeros(0, int), np.zeros(0)
        self.corners = np.zeros((0, 80, 3))
        counts = [len(sources), *(len(owner.blocks) for owner in sets)]
        self.grow(sum(counts))
        self.sources = [*sources, *(block for owner in sets for block in owner.blocks)]
        self._dops: dict = {}
        self.watch = ActorWatch([source.actor for source in sources])
        self._places = np.arange(len(sources))  # of the watched actors
        self._ranges = [range(a, b) for a, b in pairwise(np.cumsum(counts).tolist())]

    def __len__(self):
        """Return how many there are places for."""
        return len(self.sources)

    @property
    def present(self) -> list[int]:
        """The places that are taken."""
        return [i for i, source in enumerate(self.sources) if source is not None]

    def grow(self, more):
        """Have places for more of them."""
        self.sources += [None] * more
        for name in _COLUMNS:
            old = getattr(self, name)
            new = np.zeros((more, *old.shape[1:]), old.dtype)
            setattr(self, name, np.concatenate([old, new]))
        self.why = np.append(self.why, np.full(more, 'hidden', object))

    def add(self, source):
        """Put an actor where there is a place."""
        place = self.sources.index(None)
        self.sources[place] = source
        self._places = np.append(self._places, place)
        self.watch.add(source.actor)

    def remove(self, actor, window) -> int:
        """Take an actor out, and return its place; the context is current."""
        row = self.watch.actors.index(actor)
        place = int(self._places[row])
        self.sources[place].release(window)
        self.sources[place] = None
        self.fits[place] = self.wanted[place] = False
        self.why[place] = 'hidden'
        self._places = np.delete(self._places, row)
        self.watch.drop(row)
        return place

    def update(self) -> list[int]:
        """Update the changed leaves, and return them."""
        changed = [int(self._places[row]) for row in self.watch.changed()]
        if changed and len(self._dops) > 2 * len(self.watch) + 64:
            self._dops.clear()  # of data that changed since
        for i in changed:
            self.sources[i].update(self._dops)
        self.watch.settle()
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
        self.cells[i], self.seconds[i] = source.cells, source.seconds
        if source.why:
            return
        self.center[i], self.half[i], self.radius[i] = source.center, source.half, source.radius
        self.corners[i] = source.corners
        self.reach[i] = np.abs(source.corners).max(0)

    def plain(self, meshes, pixels, area, pixel) -> np.ndarray:
        """Return the seconds of each leaf drawn without an image."""
        out = meshes.copy()
        for owner, rows in zip(self.sets, self._ranges, strict=True):
            out[rows] = owner.plain(meshes[rows], pixels[rows], area[rows], pixel)
        return out

    def hide(self, why) -> list:
        """Hide all but the leaves that are drawn themselves."""
        imaged = why == ''
        idle = (imaged | (why == 'out of view')) & self.wanted
        self.watch.hide(np.flatnonzero(idle[self._places]))
        owners = zip(self.sets, self._ranges, strict=True)
        return [owner.thing for owner, rows in owners if owner.hide(imaged[rows])]

    def shown(self) -> list:
        """Return the actors that the user has visible."""
        hidden = set(self.watch.hidden.tolist())
        actors = enumerate(self.watch.actors)
        return [a for row, a in actors if row in hidden or a.GetVisibility()]

    def deactivate(self):
        """Show everything."""
        self.watch.show()
        for owner in self.sets:
            owner.show()

    def release(self, window):
        """Free GPU memory; the context is current."""
        self.deactivate()
        for owner in (*(self.sources[i] for i in self._places), *self.sets):
            owner.release(window)
        self.watch.forget()  # all is to be made anew
