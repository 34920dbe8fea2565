"""Joints of a pose as a table: names, parents, places, turns and scales."""

from __future__ import annotations

import numpy as np

from pvibr.core.params import checked_flag
from pvibr.maths import quaternions
from pvibr.maths.transforms import AXES, AXIS_SCALES, QUATERNION


def joint_table(skeleton, world_from_joint, world=True) -> dict[str, np.ndarray]:
    """Return columns by name, in the space of the matrices or relative to the parents."""
    is_in_world = checked_flag('world', world)
    matrices = world_from_joint if is_in_world else skeleton.local(world_from_joint)
    rotations, scales = _turns_and_scales(matrices[:, :3, :3])
    columns = {'joint': np.array(skeleton.names, str), 'parent': skeleton.parents.copy()}
    values = matrices[:, :3, 3], quaternions.from_matrices(rotations), scales
    for names, rows in zip((AXES, QUATERNION, AXIS_SCALES), values, strict=True):
        columns |= dict(zip(names, rows.T.copy(), strict=True))
    return columns


def _turns_and_scales(linear):
    """Return rotations and scales, whose product is the matrices unless these shear."""
    scales = np.linalg.norm(linear, axis=-2)
    axes = linear / np.where(scales > 0, scales, 1.0)[:, None]
    # The nearest rotations: what is sheared, or scaled to nothing, has no exact ones.
    left, _, right = np.linalg.svd(axes)
    rotations = left @ right
    mirror_signs = np.where(np.linalg.det(rotations) < 0, -1.0, 1.0)[:, None] ** [0, 0, 1]
    return rotations * mirror_signs[:, None], scales * mirror_signs
