"""The choice of levels of a set, in one pass with those of all small sets of its subplot."""

from __future__ import annotations

from itertools import pairwise
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np

from pvibr.instances.choices import GroupBlocks
from pvibr.instances.limits import driver_in
from pvibr.things.item_set import view_key

#: Instances up to which sets share a pass; what larger ones do each outweighs its cost.
_MOST = 1024


class SharedChoices:
    """Chooses what draws the small sets of a subplot, all of them when the first one asks."""

    _of_pipelines: WeakKeyDictionary = WeakKeyDictionary()

    def __init__(self):
        self.sets: list[Any] = []
        self._blocks = GroupBlocks()

    @classmethod
    def of(cls, pipeline) -> SharedChoices:
        """Return the one of a pipeline."""
        return cls._of_pipelines.setdefault(pipeline, cls())

    def choose(self, frame, asking) -> tuple[list, list]:
        """Return the limits of each group of a set in a frame, and what draws it."""
        version, choices = frame.once(self._of_all).get(asking, (None, []))
        limits, poses = asking.version(frame)
        # A set may have changed since another one asked.
        if (limits, poses) != version:
            choices = asking.groups.choose(frame, limits)
        return limits, choices

    def _of_all(self, frame) -> dict:
        """Return versions and choices of the small sets that have none for the view, by set."""
        sets = [things for things in self.sets if _shares(frame, things)]
        if len(sets) < 2:
            return {}
        versions = [things.version(frame) for things in sets]
        self._blocks = self._blocks.of([group for things in sets for group in things.groups])
        choices = self._blocks.choose(frame, [x for limits, _ in versions for x in limits])
        ends = np.cumsum([0, *(len(things.groups) for things in sets)]).tolist()
        parts = [choices[first:end] for first, end in pairwise(ends)]
        return dict(zip(sets, zip(versions, parts, strict=True), strict=True))


def _shares(frame, things) -> bool:
    """Return whether a set chooses its levels with others in a frame."""
    return len(things) <= _MOST and things.enabled and things.lacks_choice(frame)


# -- methods of instances -----------------------------------------------------------------------


def lacks_choice(self, frame) -> bool:
    """Return True if it is visible, and its levels are not chosen for the view of a frame."""
    chosen_key = self._content_key
    is_chosen = chosen_key is not None and chosen_key[0] == frame.once(view_key)
    return not is_chosen and bool(self.GetVisibility())


def version(self, frame) -> tuple[list, list]:
    """Return the limits of each group in a frame, and what changes with its poses."""
    scales = frame.pixel_scales if frame.depth_map else None
    key = self._changes, self.revision, frame.quality, scales, frame.once(driver_in)
    if key != self._limits_key:
        models = [group.model for group in self.groups]
        self._limits_key, self._limits = key, self._level_choice().limits_in(frame, models)
    return self._limits, self.groups.versions()


def choose(self, frame, _other_depths):
    """Choose and show what draws its instances in a frame."""
    limits, choices = self._shared_choices.choose(frame, self)
    if self.groups.draw(frame, limits, choices, depth=self._depth_is_read(frame)):
        self.order = self.groups.draw_order()
