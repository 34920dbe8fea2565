"""The leaves of an impostor: state, visibility and bounding boxes."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np

from pvibr.substitutes.sections import Sections
from pvibr.things.actor_watch import ActorWatch
from pvibr.things.content_key import unclipped_parts_of

#: Reasons for leaves outside of planes, and of those that a moving one cuts.
CLIPPED_AWAY, CUT_BY_MOVING = 'clipped away', 'cut by a moving plane'
#: Reasons for leaves that are not drawn.
UNDRAWN = 'hidden', 'out of view', CLIPPED_AWAY
_COLUMNS = (
    *('eligible', 'visible', 'cells', 'seconds'),
    *('center', 'half', 'radius', 'reach', 'corners', 'stroke_px', 'opacity'),
)


class Leaves:
    """Actors and blocks of instances as arrays, with spare places."""

    def __init__(self, sources, instance_sets=()):
        self.sets = list(instance_sets)
        self.sections = Sections()
        self.sources: list[Any] = []
        self.eligible = self.visible = np.zeros(0, bool)
        self.mesh_reasons = np.zeros(0, object)
        self.center, self.half = np.zeros((0, 3)), np.zeros((0, 3, 3))
        self.radius, self.reach = np.zeros(0), np.zeros((0, 3))
        self.stroke_px, self.opacity = np.zeros(0), np.zeros(0)
        self.cells, self.seconds = np.zeros(0, int), np.zeros(0)
        self.corners = np.zeros((0, 80, 3))
        leaf_counts = [len(sources), *(len(owner.blocks) for owner in instance_sets)]
        self.grow(sum(leaf_counts))
        self.sources = [*sources, *(block for owner in instance_sets for block in owner.blocks)]
        self._dops: dict = {}
        watched_actors = [source.actor for source in sources]
        self.watch = ActorWatch(watched_actors, parts=unclipped_parts_of)
        self._places = np.arange(len(sources))  # of the watched actors
        self._ranges = [range(a, b) for a, b in pairwise(np.cumsum(leaf_counts).tolist())]

    def __len__(self):
        """Return the number of places."""
        return len(self.sources)

    @property
    def present(self) -> list[int]:
        """The occupied places."""
        return [i for i, source in enumerate(self.sources) if source is not None]

    def grow(self, extra_places):
        """Add empty places."""
        self.sources += [None] * extra_places
        self.sections.grow(extra_places)
        for name in _COLUMNS:
            old_values = getattr(self, name)
            new_values = np.zeros((extra_places, *old_values.shape[1:]), old_values.dtype)
            setattr(self, name, np.concatenate([old_values, new_values]))
        self.mesh_reasons = np.append(self.mesh_reasons, np.full(extra_places, 'hidden', object))

    def add(self, source):
        """Put an actor at a free place, of which there must be one."""
        place = self.sources.index(None)
        self.sources[place] = source
        self._places = np.append(self._places, place)
        self.watch.add(source.actor)

    def remove(self, actor, window) -> int:
        """Remove an actor and return its place; the context is current."""
        watch_index = self.watch.actors.index(actor)
        place = int(self._places[watch_index])
        self.sources[place].release(window)
        self.sources[place] = None
        self.eligible[place] = self.visible[place] = False
        self.mesh_reasons[place] = 'hidden'
        self._places = np.delete(self._places, watch_index)
        self.watch.drop(watch_index)
        self.sections.list_planes(self)
        return place

    def update(self) -> list[int]:
        """Update the changed leaves, and return them."""
        changed_leaves = [int(self._places[row]) for row in self.watch.changed()]
        if changed_leaves and len(self._dops) > 2 * len(self.watch) + 64:
            self._dops.clear()  # drop those of stale data
        for i in changed_leaves:
            self.sources[i].update(self._dops)
        self.watch.settle()
        for instance_set, leaf_ids in zip(self.sets, self._ranges, strict=True):
            if instance_set.changed():
                instance_set.update()
                changed_leaves += leaf_ids
        for i in changed_leaves:
            self._read_source(i)
        if changed_leaves:
            self.sections.list_planes(self)
        return changed_leaves

    def cut(self) -> list[int]:
        """Compare the clipping planes with those of the frame before; return what they change."""
        changed_leaves = self.sections.update(self)
        for i in changed_leaves:
            self._read_reason(i)
        return changed_leaves

    def clipped_sources(self, leaf_ids) -> list:
        """Return sources, of which the planes that cut them clip what they draw."""
        for i in leaf_ids:
            self.sources[i].clip(self.sections.planes_of(i))
        return [self.sources[i] for i in leaf_ids]

    @property
    def tinted(self) -> bool:
        """Whether the edges of any leaf have another colour than black."""
        return any(self.sources[i].has_tint for i in self.present)

    @property
    def live(self) -> np.ndarray:
        """Which leaves may be drawn as images."""
        return self.eligible & self.visible & ~self.sections.removed

    def _read_reason(self, i):
        source, is_removed = self.sources[i], self.sections.removed[i]
        if source is not None:
            reason = source.why or CLIPPED_AWAY * bool(is_removed)
            self.mesh_reasons[i] = reason if source.shown else 'hidden'

    def _read_source(self, i):
        source = self.sources[i]
        self.eligible[i], self.visible[i] = not source.why, source.shown
        self._read_reason(i)
        self.cells[i], self.seconds[i] = source.cells, source.seconds
        if source.why:
            return
        self.center[i], self.half[i], self.radius[i] = source.center, source.half, source.radius
        self.corners[i], self.stroke_px[i] = source.corners, source.stroke_px
        self.opacity[i] = source.opacity
        self.reach[i] = np.abs(source.corners).max(0)

    def plain(self, mesh_cost, size_px, card_area, pixel_cost) -> np.ndarray:
        """Return the seconds of each leaf drawn without an image."""
        plain_cost = mesh_cost.copy()
        for instance_set, ids in zip(self.sets, self._ranges, strict=True):
            plain_cost[ids] = instance_set.plain(
                mesh_cost[ids], size_px[ids], card_area[ids], pixel_cost
            )
        return plain_cost

    def hide(self, mesh_reasons, error_sizes) -> list:
        """Hide the leaves drawn as images or out of view; return the instances affected."""
        # Those that moving planes cut are drawn by coarser meshes, within errors in world units.
        if self.sections.has_moving:
            self._draw_drafts(mesh_reasons, error_sizes)
        as_image = mesh_reasons == ''
        is_unseen = (mesh_reasons == 'out of view') | (mesh_reasons == CLIPPED_AWAY)
        is_hidden = (as_image | is_unseen) & self.visible
        self.watch.hide(np.flatnonzero(is_hidden[self._places]))
        owners = zip(self.sets, self._ranges, strict=True)
        return [owner.thing for owner, ids in owners if owner.hide(as_image[ids])]

    def _draw_drafts(self, mesh_reasons, error_sizes):
        is_moving = mesh_reasons[self._places] == CUT_BY_MOVING
        for row in np.flatnonzero(is_moving).tolist():
            place = self._places[row]
            draft = self.sources[place].draft
            mapper = draft.mapper_of(self.watch.actors[row], error_sizes[place])
            if mapper is not None:
                self.watch.draw_by(row, mapper)

    def shown(self) -> list:
        """Return the actors that are visible to the user."""
        hidden_rows = set(self.watch.hidden.tolist())
        actors = enumerate(self.watch.actors)
        return [a for row, a in actors if row in hidden_rows or a.GetVisibility()]

    def deactivate(self):
        """Show everything."""
        self.watch.show()
        for owner in self.sets:
            owner.show()

    def release(self, window):
        """Free GPU memory; the context is current."""
        self.deactivate()
        for resource in (*(self.sources[i] for i in self._places), *self.sets):
            resource.release(window)
        self.watch.forget()
