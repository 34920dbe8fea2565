"""Joints of a pose as a table: names, parents, places, turns and scales."""

from __future__ import annotations

import numpy as np

from pvibr.core.params import checked_flag
from pvibr.maths import quaternions
from pvibr.maths.transforms import AXES, AXIS_SCALES, QUATERNION, turns_and_scales


def joint_table(skeleton, world_from_joint, world=True) -> dict[str, np.ndarray]:
    """Return columns by name, in the space of the matrices or relative to the parents."""
    is_in_world = checked_flag('world', world)
    matrices = world_from_joint if is_in_world else skeleton.local(world_from_joint)
    rotations, scales = turns_and_scales(matrices[:, :3, :3])
    columns = {'joint': np.array(skeleton.names, str), 'parent': skeleton.parents.copy()}
    values = matrices[:, :3, 3], quaternions.from_matrices(rotations), scales
    for names, rows in zip((AXES, QUATERNION, AXIS_SCALES), values, strict=True):
        columns |= dict(zip(names, rows.T.copy(), strict=True))
    return columns
