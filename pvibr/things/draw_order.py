"""The order in which a renderer draws its props."""

from __future__ import annotations

from enum import IntEnum
from itertools import pairwise
from typing import Any

import numpy as np

from pvibr.core._vtk import address
from pvibr.gl.annotations import is_flat
from pvibr.gl.scene_pass import is_end

#: Other translucent props among which a thing divides its draws; more share a place.
MOST = 8
_SLICES = 96  # of depth, in which things that mix take turns
#: Parts into which the draws of a thing may be divided.
PARTS = MOST + _SLICES + 1


class Stage(IntEnum):
    """What is drawn one after the other; within a stage the rest of an actor's key decides."""

    #: Meshes, and all that says nothing.
    OPAQUE = 0
    #: What is opaque of cards, those of instances from near to far.
    CORE = 1
    #: Soft edges, which blend with all of the above and write no depth.
    FRINGE = 2
    #: The depth of soft edges, if it is read.
    DEPTH = 3
    #: Of the translucent stage, if items are sorted among the others there.
    TRANSLUCENT = 4
    END = 5
    ANNOTATION = 6


class DrawOrder:
    """Sorts the props of a renderer by the keys of things, the others as they are."""

    def __init__(self, renderer):
        self.renderer = renderer
        self._orders: list[tuple] = []
        self._keys: dict[int, tuple] = {}
        self._time = -1
        self._frame: Any = None
        self._others: list[tuple] = []
        self._weighted = False

    def others(self, frame, thing, things) -> list[float]:
        """Return the depths at which a thing divides its draws, the farthest first."""
        self._look(frame, things)
        found = sorted(depth for depth, _ in self._others)
        if len(found) > MOST:
            found = [found[i] for i in np.linspace(0, len(found) - 1, MOST).astype(int)]
        shown = [t for t in things if t.blends and _shown(t)]
        found += _slices([_depth_range(frame, t) for t in shown])
        return sorted(found, reverse=True)

    def _look(self, frame, things):
        """Find the translucent props of others once in a frame; VTK's own mixing is off then."""
        if self._frame is frame:
            return
        self._frame, self._others = frame, []
        renderer = self.renderer
        if renderer.GetUseDepthPeeling():
            return
        if renderer.GetUseOIT():
            self._weighted = True
            renderer.SetUseOIT(False)
        own = {address(actor) for t in things if t.blends for actor in t.actors()}
        found = [
            prop
            for prop in renderer.GetViewProps()
            if prop.IsA('vtkActor')
            and prop.GetVisibility()
            and address(prop) not in own
            and prop.GetMapper() is not None
            and prop.HasTranslucentPolygonalGeometry()
        ]
        self._others = [(_depth(frame, prop), prop) for prop in found]

    def sort(self, frame, things):
        """Have the renderer draw all props in order."""
        props = self.renderer.GetViewProps()
        orders = [thing.order for thing in things]
        if self._frame is frame and self._others:
            orders.append(tuple((translucent(d, after=True), p) for d, p in self._others))
        if orders != self._orders:
            self._orders = orders
            # By wrappers: VTK makes but one while it lives, and the orders hold them. Where keys
            # are equal by place: when an actor was made depends on what was drawn before.
            self._keys = {
                id(actor): (key, rank, place)
                for rank, order in enumerate(orders)
                for place, (key, actor) in enumerate(order)
            }
        elif props.GetMTime() == self._time:
            return
        listed = list(props)
        keys = [self._keys.get(id(prop)) or (_key(prop), -1) for prop in listed]
        if any(a > b for a, b in pairwise(keys)):
            props.RemoveAllItems()
            for k in sorted(range(len(listed)), key=keys.__getitem__):
                props.AddItem(listed[k])
        self._time = props.GetMTime()

    def finish(self):
        """Leave the renderer's mixing as it was, and depth written."""
        self.renderer.GetRenderWindow().GetState().vtkglDepthMask(True)
        self._frame, self._others = None, []
        if self._weighted:
            self._weighted = False
            self.renderer.SetUseOIT(True)


def in_order(actors, things) -> list:
    """Return actors of things and others as a renderer draws them, for a frame of another view."""
    keys = {address(actor): key for thing in things for key, actor in thing.order}
    return sorted(actors, key=lambda actor: keys.get(address(actor), (Stage.OPAQUE,)))


def translucent(depth, own=0.0, *, after=False) -> tuple:
    """Return the key of draws that are farther than a depth, or of a prop there."""
    return Stage.TRANSLUCENT, -depth, after, -own


def _key(prop) -> tuple:
    """Return the key of a prop that no thing has."""
    if is_end(prop):
        return (Stage.END,)
    return (Stage.ANNOTATION,) if is_flat(prop) else (Stage.OPAQUE,)


def _slices(ranges) -> list[float]:
    """Return depths that divide ranges where two or more overlap, and part those that do not."""
    if len(ranges) < 2:
        return []
    ends = np.unique(ranges)
    middles = (ends[:-1] + ends[1:]) / 2
    depth = sum(((middles > low) & (middles < high)).astype(int) for low, high in ranges)
    mixed = np.where(depth > 1, np.diff(ends), 0.0)
    found = [float(end) for end in ends[:: max(1, -(-len(ends) // (_SLICES // 4)))]]
    if mixed.sum() > 0:
        shares = (np.arange(_SLICES - len(found)) + 0.5) / (_SLICES - len(found))
        at = np.concatenate([[0], np.cumsum(mixed)]) / mixed.sum()
        found += np.interp(shares, at, ends).tolist()
    return found


def _depth_range(frame, thing) -> tuple[float, float]:
    """Return the least and the largest depth of a thing's bounds."""
    low, high = np.reshape(thing.GetBounds(), (3, 2)).T
    corners = np.where(np.indices((2, 2, 2)).reshape(3, -1).T, high, low)
    depths = depths_of(frame, corners)
    if frame.parallel:
        return float(depths.min()), float(depths.max())
    nearest = depths_of(frame, np.clip(frame.eye, low, high)[None])
    return float(nearest[0]), float(depths.max())


def _shown(thing) -> bool:
    bounds = thing.GetBounds()  # those that come later are not prepared yet
    return thing.enabled and thing.visibility and bounds is not None and bounds[0] <= bounds[1]


def _depth(frame, prop) -> float:
    """Return the depth of the middle of a prop."""
    return float(depths_of(frame, np.reshape(prop.GetBounds(), (3, 2)).mean(1)[None])[0])


def depths_of(frame, points) -> np.ndarray:
    """Return how far points are: from the eye, or in parallel projection along the view."""
    view = frame.view_from_world
    if frame.parallel:
        return -(points @ view[2, :3] + view[2, 3])
    away = points - frame.eye
    return np.sqrt((away * away).sum(1))
