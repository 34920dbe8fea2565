"""What is in a renderer: the props that light falls on, and those that throw shadows."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from pvibr.maths.views import may_see

_MAPPERS = ('vtkPolyDataMapper', 'vtkDataSetMapper', 'vtkGlyph3DMapper')


class Surfaces:
    """The actors of a renderer that are surfaces, listed anew only when props come or go.

    Parameters
    ----------
    renderer : vtkRenderer
        Whose actors.
    """

    def __init__(self, renderer):
        self.renderer = renderer
        self._stamp = None
        self._actors: list = []

    def actors(self) -> list:
        """Return the actors that draw polygons, lines or points of data, hidden ones too."""
        stamp = self.renderer.GetViewProps().GetMTime()
        if stamp != self._stamp:
            self._stamp = stamp
            self._actors = [a for a in self.renderer.GetActors() if _is_surface(a)]
        return self._actors


def _is_surface(actor) -> bool:
    if actor.IsA('vtkSkybox') or actor.IsA('vtkCubeAxesActor'):
        return False
    mapper = actor.GetMapper()
    return mapper is not None and any(mapper.IsA(name) for name in _MAPPERS)


@dataclass
class Casters:
    """What is drawn in a view from somewhere else.

    Attributes
    ----------
    actors : list of vtkActor
        Visible props that are drawn as they are.
    things : list of pvibr.Effect
        Things in the pipeline that choose what they draw for each view, such as instances.
    """

    actors: list = field(default_factory=list)
    things: list = field(default_factory=list)

    def key(self) -> tuple:
        """Return what changes whenever anything drawn does."""
        actors = tuple((a.GetAddressAsString(''), a.GetRedrawMTime()) for a in self.actors)
        return actors, tuple((id(t), t.stamp()) for t in self.things)

    def bounds(self) -> np.ndarray:
        """Return the world bounds of each, shape (n, 6); of what has none, nothing."""
        boxes = [a.GetBounds() for a in self.actors] + [t.bounds for t in self.things]
        found = np.array([b for b in boxes if b is not None and b[0] <= b[1]], float)
        return found.reshape(-1, 6)

    def seen(self, view) -> Casters:
        """Return what may be in a view.

        Parameters
        ----------
        view : pvibr.maths.views.View
            Where from.

        Returns
        -------
        Casters
            Actors whose boxes reach into it, and all things: they leave out what they like.
        """
        boxes = np.array([a.GetBounds() or (1, -1) * 3 for a in self.actors], float)
        inside = may_see(view, boxes.reshape(-1, 6))
        return Casters([a for a, i in zip(self.actors, inside, strict=True) if i], self.things)
