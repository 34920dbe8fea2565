"""All that an impostor stands for: what changed, what is hidden, and where everything is."""

from __future__ import annotations

import numpy as np

from pvibr import _vtk


class Leaves:
    """Sources, of which thousands are asked in every frame.

    Parameters
    ----------
    sources : list of Source
        One or more.

    Attributes
    ----------
    fits, wanted : numpy.ndarray, shape (n,), bool
        Which can be images, and which the user has visible.
    why : numpy.ndarray, shape (n,), object
        Why each is none whatever the eye sees, empty where it may be one.
    center, half, radius, corners
        Of each, see :class:`pvibr.actors.impostor_sources.Source`.
    reach : numpy.ndarray, shape (n, 3)
        From the middle, along x, y and z.
    """

    def __init__(self, sources):
        n = len(sources)
        self.sources = sources
        self.fits, self.wanted = np.zeros(n, bool), np.zeros(n, bool)
        self.why = np.full(n, '', object)
        self.center, self.half = np.zeros((n, 3)), np.zeros((n, 3, 3))
        self.radius, self.reach = np.zeros(n), np.zeros((n, 3))
        self.corners = np.zeros((n, 80, 3))
        self._dops: dict = {}
        # Attributes of a PyVista actor take their time, so that its methods are looked up once.
        actors = [source.actor for source in sources]
        self._own = [actor.GetMTime for actor in actors]
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
        own = np.array([clock() for clock in self._own])
        rest = np.array([clock() for clock in self._clocks], own.dtype)
        late = np.flatnonzero(own > max(self._seen.GetMTime(), self._shown.GetMTime()))
        later = self._owners[rest > self._seen.GetMTime()]
        changed = sorted({*late.tolist(), *later.tolist()})
        for i in changed:
            self._take(i)
        if changed:
            self._watch()
        self._seen.Modified()
        return changed

    def _take(self, i):
        source = self.sources[i]
        source.update(self._dops)
        self.fits[i], self.wanted[i] = not source.why, source.shown
        self.why[i] = source.why if source.shown else 'hidden'
        if source.why:
            return
        self.center[i], self.half[i], self.radius[i] = source.center, source.half, source.radius
        self.corners[i] = source.corners
        self.reach[i] = np.abs(source.corners).max(0)

    def _watch(self):
        sources = self.sources
        if len(self._dops) > 2 * len(sources) + 64:
            self._dops.clear()  # of data that changed since
        counts = [len(source.clocks) for source in sources]
        self._owners = np.repeat(np.arange(len(sources)), counts)
        self._clocks = [clock for source in sources for clock in source.clocks]
        self._pipelines = [source.pipeline for source in sources if source.pipeline is not None]

    def hide(self, which):
        """Hide some until :meth:`show`.

        Parameters
        ----------
        which : numpy.ndarray of int
            Indices.
        """
        self.hidden = which
        for i in which.tolist():
            self._off[i]()

    def show(self):
        """Show again what was hidden, which is no change."""
        if len(self.hidden):
            for i in self.hidden.tolist():
                self._on[i]()
            self._shown.Modified()
            self.hidden = np.zeros(0, int)

    def shown(self) -> list:
        """Return the actors that the user has visible."""
        hidden = set(self.hidden.tolist())
        return [s.actor for i, s in enumerate(self.sources) if i in hidden or s.shown]

    def release(self, window):
        """Free the GPU's memory; the context must be alive.

        Parameters
        ----------
        window : vtkOpenGLRenderWindow
            Whose context is current; None where there is none.
        """
        self.show()
        for source in self.sources:
            source.release(window)
        self._seen = _vtk.vtkTimeStamp()  # all is to be made anew
