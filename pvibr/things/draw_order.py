"""The order in which a renderer draws its props."""

from __future__ import annotations

from enum import IntEnum
from itertools import pairwise
from typing import Any

import numpy as np

from pvibr.core._vtk import address
from pvibr.gl.annotations import is_flat
from pvibr.gl.scene_pass import is_end

#: Most depths of other translucent props between which a thing splits its draws.
MOST = 8
_SLICES = 96  # depth slices in which overlapping things take turns
#: Most parts that a thing's draws are split into.
PARTS = MOST + _SLICES + 1


class Stage(IntEnum):
    """The stages of a frame, in order; within a stage the rest of an actor's key decides."""

    #: Meshes and everything without a key.
    OPAQUE = 0
    #: Opaque cores of cards, instances front to back.
    CORE = 1
    #: Soft edges, which blend over all of the above and write no depth.
    FRINGE = 2
    #: The depth of soft edges, if an effect reads it.
    DEPTH = 3
    #: Items that are depth-sorted with other translucent props.
    TRANSLUCENT = 4
    END = 5
    ANNOTATION = 6


class DrawOrder:
    """Sorts a renderer's props by the keys of things and leaves the others in place."""

    def __init__(self, renderer, plain_actors):
        self.renderer, self._plain_actors = renderer, plain_actors
        self._thing_orders: list[tuple] = []
        self._keys_by_id: dict[int, tuple] = {}
        self._time = -1
        self._frame: Any = None
        self._other_depths: list[tuple] = []
        self._had_oit = False

    def others(self, frame, thing, things) -> list[float]:
        """Return the depths at which a thing splits its draws, the farthest first."""
        self._find_others(frame, things)
        split_depths = sorted(depth for depth, _ in self._other_depths)
        if len(split_depths) > MOST:
            split_depths = [
                split_depths[i] for i in np.linspace(0, len(split_depths) - 1, MOST).astype(int)
            ]
        blending_things = [t for t in things if t.blends and _is_shown(t)]
        split_depths += _slices([_depth_range(frame, t) for t in blending_things])
        return sorted(split_depths, reverse=True)

    def _find_others(self, frame, things):
        """Find other translucent props once per frame, with VTK's own blending off."""
        if self._frame is frame:
            return
        self._frame, self._other_depths = frame, []
        renderer = self.renderer
        if renderer.GetUseDepthPeeling():
            return
        if renderer.GetUseOIT():
            self._had_oit = True
            renderer.SetUseOIT(False)
        own_addresses = {address(actor) for t in things if t.blends for actor in t.actors()}
        for prop in renderer.GetViewProps():
            if prop.GetVisibility() and address(prop) not in own_addresses:
                actors = [a for a in self._plain_actors.of(prop) if _is_translucent(a)]
                if actors:
                    self._other_depths.append((_depth(frame, actors), prop))

    def sort(self, frame, things):
        """Sort the renderer's props."""
        props = self.renderer.GetViewProps()
        thing_orders = [thing.order for thing in things]
        if self._frame is frame and self._other_depths:
            pairs = self._other_depths
            thing_orders.append(tuple((translucent(d, after=True), p) for d, p in pairs))
        if thing_orders != self._thing_orders:
            self._thing_orders = thing_orders
            # The orders hold the wrappers, so their ids are stable. Equal keys keep their place,
            # which does not depend on when an actor was created.
            self._keys_by_id = {
                id(actor): (key, rank, place)
                for rank, order in enumerate(thing_orders)
                for place, (key, actor) in enumerate(order)
            }
        elif props.GetMTime() == self._time:
            return
        all_props = list(props)
        sort_keys = [self._keys_by_id.get(id(prop)) or (_key(prop), -1) for prop in all_props]
        if any(a > b for a, b in pairwise(sort_keys)):
            props.RemoveAllItems()
            for k in sorted(range(len(all_props)), key=sort_keys.__getitem__):
                props.AddItem(all_props[k])
        self._time = props.GetMTime()

    def finish(self):
        """Restore the renderer's blending, and depth writes."""
        self.renderer.GetRenderWindow().GetState().vtkglDepthMask(True)
        self._frame, self._other_depths = None, []
        if self._had_oit:
            self._had_oit = False
            self.renderer.SetUseOIT(True)


def _is_translucent(prop) -> bool:
    """Return whether a prop is an actor with translucent polygons."""
    if not prop.IsA('vtkActor') or prop.GetMapper() is None:
        return False
    return bool(prop.GetVisibility() and prop.HasTranslucentPolygonalGeometry())


def in_order(actors, things) -> list:
    """Return actors in the order a renderer would draw them, for a frame of another view."""
    sort_keys = {address(actor): key for thing in things for key, actor in thing.order}
    return sorted(actors, key=lambda actor: sort_keys.get(address(actor), (Stage.OPAQUE,)))


def translucent(depth, own_depth=0.0, *, after=False) -> tuple:
    """Return the key of draws beyond a depth, or (`after`) of a prop at that depth."""
    return Stage.TRANSLUCENT, -depth, after, -own_depth


def interleaved(frame, thing, other_depths, parts) -> tuple:
    """Return the order of a blending thing's parts, back to front between other props' depths."""
    own_depth = float(depths_of(frame, np.array([thing.center]))[0])
    return tuple(
        ((*translucent(depth, own_depth), k), actor)
        for depth, part in zip((*other_depths, -np.inf), parts, strict=True)
        for k, actor in enumerate(part)
    )


def _key(prop) -> tuple:
    """Return the key of a prop that belongs to no thing."""
    if is_end(prop):
        return (Stage.END,)
    return (Stage.ANNOTATION,) if is_flat(prop) else (Stage.OPAQUE,)


def _slices(ranges) -> list[float]:
    """Return depths that slice overlapping ranges and separate disjoint ones."""
    if len(ranges) < 2:
        return []
    range_ends = np.unique(ranges)
    middles = (range_ends[:-1] + range_ends[1:]) / 2
    overlaps = sum(((middles > low) & (middles < high)).astype(int) for low, high in ranges)
    mixed_lengths = np.where(overlaps > 1, np.diff(range_ends), 0.0)
    end_step = max(1, -(-len(range_ends) // (_SLICES // 4)))
    split_depths = range_ends[::end_step].tolist()
    if mixed_lengths.sum() > 0:
        fractions = (np.arange(_SLICES - len(split_depths)) + 0.5) / (_SLICES - len(split_depths))
        cumulative = np.concatenate([[0], np.cumsum(mixed_lengths)]) / mixed_lengths.sum()
        split_depths += np.interp(fractions, cumulative, range_ends).tolist()
    return split_depths


def _depth_range(frame, thing) -> tuple[float, float]:
    """Return the smallest and largest depth of a thing's bounds."""
    low, high = np.reshape(thing.GetBounds(), (3, 2)).T
    box_corners = np.where(np.indices((2, 2, 2)).reshape(3, -1).T, high, low)
    corner_depths = depths_of(frame, box_corners)
    if frame.parallel:
        return float(corner_depths.min()), float(corner_depths.max())
    nearest_depth = depths_of(frame, np.clip(frame.eye, low, high)[None])
    return float(nearest_depth[0]), float(corner_depths.max())


def _is_shown(thing) -> bool:
    bounds = thing.GetBounds()  # None where it is not prepared yet
    return thing.enabled and thing.visibility and bounds is not None and bounds[0] <= bounds[1]


def _depth(frame, actors) -> float:
    """Return the depth of the centre of actors."""
    boxes = np.reshape([actor.GetBounds() for actor in actors], (-1, 3, 2))
    center = (boxes[..., 0].min(0) + boxes[..., 1].max(0)) / 2
    return float(depths_of(frame, center[None])[0])


def depths_of(frame, points) -> np.ndarray:
    """Return the distances of points from the eye, or in parallel projection along the view."""
    view_from_world = frame.view_from_world
    if frame.parallel:
        return -(points @ view_from_world[2, :3] + view_from_world[2, 3])
    from_eye = points - frame.eye
    return np.sqrt((from_eye * from_eye).sum(1))
