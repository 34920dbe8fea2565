"""Many figures posed together: for each alone, numpy's calls take longer than its sums."""

from __future__ import annotations

import numpy as np

from pvibr.animation.boxes import around_moved
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
        sizes = [len(figure.skeleton) for figure in figures]
        ends = np.cumsum(sizes)
        firsts = ends - sizes
        self._own = [slice(*pair) for pair in zip(firsts, ends, strict=True)]
        above = [figure.skeleton.parents for figure in figures]
        pairs = zip(above, firsts, strict=True)
        self._jumps = Jumps(np.concatenate([np.where(p < 0, p, p + k) for p, k in pairs]))
        held = [figure.joint_boxes[how] for figure, how, _ in members]
        nodes, self._binds, self._boxes = map(np.concatenate, zip(*held, strict=True))
        counts = [len(boxes) for _, _, boxes in held]
        self._nodes = nodes + np.repeat(firsts, counts)
        self._starts = np.cumsum(counts) - counts
        self._lanes = list(_lanes(clips, firsts))

    def moved(self, poses, time):
        """Yield pose, ``figure_from_joint`` (n, 4, 4), signs and bounds (6,) of each figure.

        Poses are given, or :class:`ClipSource` that play clips.
        """
        plays = [isinstance(pose, ClipSource) for pose in poses]
        pairs = list(zip(poses, plays, strict=True))
        given = [p.figure.rest if playing else p for p, playing in pairs]
        parts = {name: np.concatenate([getattr(p, name) for p in given]) for name in _PARTS}
        table = np.array([p.timing() if playing else _NO_CLIP for p, playing in pairs]).T
        times = local_times(table[1] + table[0] * time, *table[2:])
        for lanes, lane, member, row in self._lanes:
            parts[lanes.path][row] = lanes.at(times[member], lane)
        world = self._jumps.world(unchecked_pose(**parts).matrices())
        bounds = around_moved(world[self._nodes] @ self._binds, self._boxes, self._starts)
        signs = signs_of(world)
        for i, own in enumerate(self._own):
            pose = poses[i]
            if plays[i]:
                own_parts = {name: values[own] for name, values in parts.items()}
                pose = unchecked_pose(**own_parts, weights=given[i].weights, time=times[i])
            yield pose, world[own], signs[own], bounds[i]


def _lanes(clips, firsts):
    """Yield the lanes of clips, and for each use of a track its lane, member and joint."""
    players: dict = {}
    for member, clip in enumerate(clips):
        if clip is not None:
            players.setdefault(clip, []).append(member)
    tracks = [track for clip in players for track in clip.joint_tracks]
    members = [players[clip] for clip in players for _ in clip.joint_tracks]
    for lanes, places in by_kind(tracks):
        uses = [(i, k, tracks[p].node) for i, p in enumerate(places) for k in members[p]]
        lane, member, node = np.array(uses).T
        yield lanes, lane, member, firsts[member] + node
