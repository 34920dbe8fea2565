"""Translucent draws and other translucent props, from far to near."""

from __future__ import annotations

import numpy as np

from pvibr.core._vtk import address

#: Other translucent props among which a thing divides its draws; more share a place.
MOST = 8


class DepthSortedDraws:
    """Puts a thing's draws between the other translucent props of a renderer for its frames."""

    def __init__(self):
        self._weighted = False

    def others(self, frame, mine) -> list:
        """Return the other translucent actors, the farthest first, and stop VTK's own mixing."""
        renderer = frame.renderer
        if renderer.GetUseDepthPeeling():
            return []
        if renderer.GetUseOIT():
            self._weighted = True
            renderer.SetUseOIT(False)
        own = {address(actor) for actor in mine}
        found = [
            prop
            for prop in renderer.GetViewProps()
            if prop.IsA('vtkActor')
            and prop.GetVisibility()
            and address(prop) not in own
            and prop.GetMapper() is not None
            and prop.HasTranslucentPolygonalGeometry()
        ]
        centers = np.array([np.reshape(p.GetBounds(), (3, 2)).mean(1) for p in found])
        depths = depths_of(frame, centers.reshape(-1, 3)).tolist()
        ordered = sorted(zip(depths, range(len(found)), strict=True), reverse=True)
        return [(depth, found[i]) for depth, i in ordered[:MOST]]

    def key(self, others) -> tuple:
        """Return what changes whenever the order does."""
        return tuple((depth, address(actor)) for depth, actor in others)

    def arrange(self, renderer, groups, others):
        """Have a renderer draw groups of actors in turn with others."""
        wanted = list(groups[0])
        for actor, group in zip(others, groups[1:], strict=True):
            wanted += [actor, *group]
        props = renderer.GetViewProps()
        among = {address(actor) for actor in wanted}
        now = [a for p in props if (a := address(p)) in among]
        if now != [address(actor) for actor in wanted]:
            for actor in wanted:
                props.RemoveItem(actor)
                props.AddItem(actor)

    def finish(self, renderer):
        """Leave the renderer's mixing as it was."""
        if self._weighted:
            self._weighted = False
            renderer.SetUseOIT(True)


def depths_of(frame, points) -> np.ndarray:
    """Return how far points are: from the eye, or in parallel projection along the view."""
    view = frame.view_from_world
    if frame.parallel:
        return -(points @ view[2, :3] + view[2, 3])
    away = points - frame.eye
    return np.sqrt((away * away).sum(1))
