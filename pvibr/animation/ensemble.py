"""Many figures posed together: for each alone, numpy's calls take longer than its sums."""

from __future__ import annotations

import numpy as np

from pvibr.animation.boxes import joint_bounds
from pvibr.animation.clip import by_kind, local_times
from pvibr.animation.mixer import ClipSource
from pvibr.animation.pose import unchecked_pose
from pvibr.animation.skeleton import Jumps
from pvibr.maths.transforms import signs_of

_PARTS = ('translation', 'rotation', 'scale')
#: Speed, offset and cycle of what plays no clip.
_NO_CLIP = (0.0,) * 6


class Ensemble:
    """Figures posed in one go: only joints move their points.

    Members are a figure, its way of skinning, and the clip that it plays or None.
    """

    def __init__(self, members):
        self.members = members
        figures, _, clips = zip(*members, strict=True)
        joint_counts = [len(figure.skeleton) for figure in figures]
        joint_ends = np.cumsum(joint_counts)
        first_joints = joint_ends - joint_counts
        self._joint_slices = [slice(*pair) for pair in zip(first_joints, joint_ends, strict=True)]
        parent_lists = [figure.skeleton.parents for figure in figures]
        parent_pairs = zip(parent_lists, first_joints, strict=True)
        self._jumps = Jumps(np.concatenate([np.where(p < 0, p, p + k) for p, k in parent_pairs]))
        joint_boxes = [figure.joint_boxes[skinning_mode] for figure, skinning_mode, _ in members]
        box_joints, self._binds, self._boxes = map(np.concatenate, zip(*joint_boxes, strict=True))
        box_counts = [len(boxes) for _, _, boxes in joint_boxes]
        self._nodes = box_joints + np.repeat(first_joints, box_counts)
        self._starts = np.cumsum(box_counts) - box_counts
        self._lanes = list(_lanes(clips, first_joints))

    def posed(self, poses, time):
        """Yield pose, ``figure_from_joint`` (n, 4, 4), signs and bounds (6,) of each figure.

        Poses are given, or :class:`ClipSource` that play clips.
        """
        plays_clip = [isinstance(pose, ClipSource) for pose in poses]
        pairs = list(zip(poses, plays_clip, strict=True))
        starts = [p.figure.rest if playing else p for p, playing in pairs]
        parts = {name: np.concatenate([getattr(p, name) for p in starts]) for name in _PARTS}
        clip_timing = np.array([p.timing() if playing else _NO_CLIP for p, playing in pairs]).T
        times = local_times(clip_timing[1] + clip_timing[0] * time, *clip_timing[2:])
        for lanes, lane_indices, member_indices, joint_rows in self._lanes:
            parts[lanes.path][joint_rows] = lanes.at(times[member_indices], lane_indices)
        world = self._jumps.world(unchecked_pose(**parts).matrices())
        bounds = joint_bounds(world[self._nodes] @ self._binds, self._boxes, self._starts)
        mirror_signs = signs_of(world)
        for i, joint_slice in enumerate(self._joint_slices):
            pose = poses[i]
            if plays_clip[i]:
                own_parts = {name: values[joint_slice] for name, values in parts.items()}
                pose = unchecked_pose(**own_parts, weights=starts[i].weights, time=times[i])
            yield pose, world[joint_slice], mirror_signs[joint_slice], bounds[i]


def _lanes(clips, first_joints):
    """Yield the lanes of clips, and for each use of a track its lane, member and joint."""
    members_by_clip: dict = {}
    for member, clip in enumerate(clips):
        if clip is not None:
            members_by_clip.setdefault(clip, []).append(member)
    tracks = [track for clip in members_by_clip for track in clip.joint_tracks]
    members = [members_by_clip[clip] for clip in members_by_clip for _ in clip.joint_tracks]
    for lanes, places in by_kind(tracks):
        uses = [(i, k, tracks[p].node) for i, p in enumerate(places) for k in members[p]]
        lane, member, node = np.array(uses).T
        yield lanes, lane, member, first_joints[member] + node
