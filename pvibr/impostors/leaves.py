"""The leaves of an impostor: state, visibility and bounding boxes."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from pvibr.scene.actor_watch import ActorWatch


class Leaves:
    """Actors and blocks of instances, by the thousand."""

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
        self.watch = ActorWatch([source.actor for source in sources])
        counts = [len(sources), *(len(owner.blocks) for owner in sets)]
        self._ranges = [range(a, b) for a, b in pairwise(np.cumsum(counts).tolist())]

    def __len__(self):
        return len(self.sources)

    def update(self) -> list[int]:
        """Update the changed leaves, and return them."""
        changed = self.watch.changed()
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
        self.watch.hide(np.flatnonzero(idle[: len(self.watch)]))
        owners = zip(self.sets, self._ranges, strict=True)
        return [owner.thing for owner, rows in owners if owner.hide(imaged[rows])]

    def shown(self) -> list:
        """Return the actors that the user has visible."""
        hidden = set(self.watch.hidden.tolist())
        sources = enumerate(self.sources[: len(self.watch)])
        return [s.actor for i, s in sources if i in hidden or s.shown]

    def deactivate(self):
        """Show everything."""
        self.watch.show()
        for owner in self.sets:
            owner.show()

    def release(self, window):
        """Free GPU memory; the context is current."""
        self.deactivate()
        for owner in (*self.sources[: len(self.watch)], *self.sets):
            owner.release(window)
        self.watch.forget()  # all is to be made anew
