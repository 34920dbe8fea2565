"""Instances in a scene exported without pvibr: a method of a set."""

from __future__ import annotations

import numpy as np


def bake_into(self, scene):
    """Add the instances to a scene exported without pvibr."""
    for k, model in self._models.by_mesh.items():
        ids = np.flatnonzero((self._items.index == k) & self.drawn_items())
        poses = self._items.poses[ids]
        colors = None if self._colors is None else self._colors[ids]
        limits = model.limits(self.max_error) if model.atlas.errors else None
        scene.copies(
            self,
            [level.parts for level in model.levels],
            poses,
            largest=limits and tuple(limits.mesh_to.min(1).tolist()),
            colors=colors,
            multiply=self.multiplies,
        )
        scene.strokes(model.levels[0].parts, poses, colors=colors)
