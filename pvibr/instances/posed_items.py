"""Poses of instances, and the mesh that each shows."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from pvibr.core.nan_rows import NanRows
from pvibr.instances.instance_arguments import checked_index, index_for, repeated, same_kind
from pvibr.meshes.posed import array_names, posed_source, source_of
from pvibr.meshes.poses import placed_by


@dataclass(frozen=True, eq=False)
class PosedItems:
    """Poses and meshes of instances, replaced rather than changed."""

    #: Points (n, 3) or matrices (n, 4, 4), in the space of the set, as users pass them.
    local_poses: np.ndarray
    #: The same in the world.
    poses: np.ndarray
    #: Mesh of each, shape (n,).
    index: np.ndarray
    mesh_count: int = 1
    #: The arguments by which poses are turned and scaled.
    placing: dict = field(default_factory=dict)
    #: World from set, None for the identity.
    world: np.ndarray | None = None
    #: Whether the array of poses is not the user's.
    owns_poses: bool = False
    #: Which items have NaN, and are hidden.
    nan_rows: NanRows = field(default_factory=NanRows)

    def __len__(self):
        return len(self.local_poses)

    def centers(self) -> np.ndarray:
        """Return the origins of items in the world, shape (n, 3)."""
        return self.poses[:, :3, 3] if self.poses.ndim == 3 else self.poses

    def in_world(self, local_poses) -> np.ndarray:
        """Return poses of the set in the world."""
        return local_poses if self.world is None else placed_by(self.world, local_poses)

    def given_poses(self) -> np.ndarray:
        """Return poses in the space of the set, NaN where an item has it."""
        nan_mask = self.nan_rows.mask
        if nan_mask is None:
            return self.local_poses
        poses = self.local_poses.copy()
        poses[nan_mask] = np.nan
        return poses

    def checked(self, poses) -> tuple[np.ndarray, NanRows]:
        """Return checked poses, and which have NaN; those of datasets are turned as at first."""
        shared_placing = {k: v for k, v in self.placing.items() if np.ndim(v) == 0}
        names = array_names(poses, shared_placing.get('orient'), shared_placing.get('scale'))
        nan_rows = self.nan_rows.anew()
        source = source_of(poses, *names, nan_rows=nan_rows)
        placing = {} if source.arrays is None else shared_placing
        return posed_source(source, nan_rows=nan_rows, **placing), nan_rows

    def placed(self, world) -> PosedItems:
        """Return the items with another transform of the set."""
        items = replace(self, world=world)
        return replace(items, poses=items.in_world(self.local_poses))

    def replaced(self, poses, index) -> PosedItems:
        """Return any number of items; None keeps the poses, or their meshes."""
        local_poses, nan_rows = self.local_poses, self.nan_rows
        if poses is not None:
            local_poses, nan_rows = self.checked(poses)
        count, is_same = len(local_poses), local_poses is self.local_poses
        if index is None:
            index = index_for(count, self.index, self.mesh_count)
        else:
            index = checked_index(repeated('index', index, count), count, self.mesh_count)
        items = replace(self, index=index, owns_poses=self.owns_poses and is_same)
        items = replace(items, local_poses=local_poses, nan_rows=nan_rows)
        return replace(items, poses=self.in_world(local_poses))

    def with_index(self, ids, index) -> PosedItems:
        """Return the items with some meshes changed."""
        index = checked_index(repeated('index', index, len(ids)), len(ids), self.mesh_count)
        all_index = self.index.copy()
        all_index[ids] = index
        return replace(self, poses=self.in_world(self.local_poses), index=all_index)

    def can_move(self, local_poses) -> bool:
        """Return True if these poses fit the array of all."""
        return same_kind(self.local_poses, local_poses)[0] is self.local_poses

    def with_poses(self, ids, local_poses, nan_rows, *, in_place) -> PosedItems:
        """Return the items with some poses changed, in the same arrays if these are its own."""
        all_poses, local_poses = same_kind(self.local_poses, local_poses)
        if not (in_place and self.owns_poses):
            all_poses = np.array(all_poses)
        all_poses[ids] = local_poses
        poses = self.poses
        if in_place and self.world is not None:
            poses[ids] = self.in_world(local_poses)
        else:
            poses = self.in_world(all_poses)
        items = replace(self, local_poses=all_poses, poses=poses, owns_poses=True)
        if not (self.nan_rows.by_name or nan_rows.by_name):
            return items
        return replace(items, nan_rows=self.nan_rows.changed('poses', len(self), ids, nan_rows))
