"""Poses of the near members of a crowd, each posed once a frame for all views of it."""

from __future__ import annotations

import numpy as np

from pvibr.figures.mesh_actors import PosedMeshActor
from pvibr.figures.posing import MeshPose, Posing, most_poses, pose_rows
from pvibr.gl import nbytes_of, release

_LEAST = 4  # poses for which there is room, if there is
_SPARE = 2  # poses over those for which there is room, at most
_SHARED = 0.25  # of all poses, where there are too few: phases that members farther away share


class MemberPoses:
    """Poses of a level by number; a member keeps one until others need it."""

    def __init__(self, mesh_actors, skinning):
        self.mesh_actors, self.skinning = mesh_actors, skinning
        self._posed = [a for a in mesh_actors if isinstance(a, PosedMeshActor)]
        self._rows = pose_rows([actor.rest_mesh for actor in self._posed])
        self._ceiling = np.inf  # most poses that the driver has not refused
        #: Share of the memory for poses that it may take.
        self.memory_share = 1.0
        self.posing: Posing | None = None
        #: Whether the CPU poses the meshes: textures of the driver are too small for one pose.
        self.by_cpu = False
        #: What members share because there are too few poses; empty if each has its own.
        self.note = ''
        self._forget()

    def _forget(self):
        """Have no poses."""
        self._capacity = 0
        #: Number of the pose of each slot, or of each phase that members share, below 0.
        self._number_of: dict[int, int] = {}
        self._free: list[int] = []
        self._grow(0)

    def _grow(self, capacity):
        """Make room for poses."""
        extra, old = capacity - self._capacity, self._capacity
        self._free += range(capacity - 1, old - 1, -1)
        shape = extra, len(self.mesh_actors)
        identities = np.broadcast_to(np.eye(4), (*shape, 4, 4))
        if not old:
            #: Clip and time of each pose.
            self.keys = np.zeros((0, 2))
            self._used_at = np.zeros(0)
            #: Of each pose and mesh: the matrix, and -1 where joints mirror it, else 1.
            self.figure_from_mesh = np.zeros((0, *shape[1:], 4, 4))
            self.turns = np.zeros((0, *shape[1:]))
            self._mesh_poses: list[list | MeshPose] = [[] for _ in self._posed]
        self.keys = np.concatenate([self.keys, np.full((extra, 2), np.nan)])
        self._used_at = np.concatenate([self._used_at, np.full(extra, np.nan)])
        self.figure_from_mesh = np.concatenate([self.figure_from_mesh, identities])
        self.turns = np.concatenate([self.turns, np.ones(shape)])
        self._capacity = capacity

    def needed_rows(self, count) -> int:
        """Return the rows that poses of as many members take."""
        return count * self._rows[0]

    @property
    def nbytes(self) -> int:
        """Bytes on the GPU."""
        return nbytes_of(self.posing)

    def first_rows(self, mesh_actor, numbers) -> np.ndarray:
        """Return the first row of the posed vertices of a mesh in poses, 0 if it is rigid."""
        if self.posing is None or not isinstance(mesh_actor, PosedMeshActor):
            return np.zeros(len(numbers))
        first, end = (self.posing.rows[self._posed.index(mesh_actor) + k] for k in (0, 1))
        return first + numbers * ((end - first) // self.posing.poses)

    def _most(self, window) -> int:
        return most_poses(window, self._rows, self.memory_share)

    def ask(self, window):
        """Ask the driver whether it has room for a pose; without, the CPU poses the meshes."""
        self.by_cpu = not self._most(window)
        if self._posed and not self.by_cpu:
            try:
                release(Posing(window, [actor.rest_mesh for actor in self._posed]))
            except RuntimeError:
                self.by_cpu = True

    def pose(self, window, time, slots, ranks, clips, seconds, durations, moments_of):
        """Pose members, ranked from the nearest; return the numbers of their poses."""
        while True:
            most = len(slots) if self.by_cpu else int(min(self._most(window), self._ceiling))
            if self._capacity > _SPARE * max(most, _LEAST):
                self.release()
            members = slots, ranks, clips, seconds, durations
            try:
                return self._posed_within(most, window, time, members, moments_of)
            except RuntimeError:
                if self.posing is not None or most < 2:
                    raise
                self._ceiling = min(most, self._capacity) // 2
                self.release()

    def _posed_within(self, most, window, time, members, moments_of):
        slots, ranks, clips, seconds, durations = members
        owners, seconds = self._shared(slots, ranks, clips, seconds, durations, most)
        owners, first, inverse = np.unique(owners, return_index=True, return_inverse=True)
        numbers = self._numbers_of(owners, most, time)
        keys = np.stack([clips[first], seconds[first]], 1)
        (changed,) = np.nonzero((self.keys[numbers] != keys).any(1))
        if len(changed):
            self._pose(numbers[changed], moments_of(keys[changed]))
            self.keys[numbers[changed]] = keys[changed]
        is_drawn = bool(self._posed) and len(slots) > 0 and not self.by_cpu
        if is_drawn and (len(changed) or self.posing is None):
            self._draw(window, numbers[changed])
        return numbers[inverse]

    def _shared(self, slots, ranks, clips, seconds, durations, most) -> tuple:
        """Return the owner of each member's pose and its clip time.

        Where there are fewer poses than members, those farther away share phases of their clips.
        """
        self.note = 'posed by the CPU: no texture has room for the vertices' * self.by_cpu
        if len(slots) <= most:
            return slots, seconds
        shown_clips = np.unique(clips)
        phase_count = max(int(_SHARED * most) // len(shown_clips), 1)
        exact_count = max(most - phase_count * len(shown_clips), 0)
        is_far = ranks >= exact_count
        steps = np.maximum(durations, 1e-12) / phase_count
        phases = np.minimum((seconds / steps).astype(int), phase_count - 1)
        places = np.searchsorted(shown_clips, clips) if most >= len(shown_clips) else 0 * phases
        self.note = (
            f'{exact_count} nearest in poses of their own, {is_far.sum()} in {phase_count} phases '
            f'of a clip, {steps.max():.3g} s apart: there is room for {most} poses'
        )
        owners = np.where(is_far, -1 - (places * phase_count + phases), slots)
        return owners, np.where(is_far, (phases + 0.5) * steps, seconds)

    def _numbers_of(self, owners, most, time) -> np.ndarray:
        """Return the number of the pose of each owner."""
        owner_list = owners.tolist()
        new_owners = [owner for owner in owner_list if owner not in self._number_of]
        missing = len(new_owners) - len(self._free)
        if missing > 0:
            # First poses of former times, then more room, then those of other views of this one.
            missing -= self._free_others(owner_list, missing, lambda used_at: used_at != time)
        if missing > 0:
            needed = self._capacity + missing
            ahead = max(1 << (needed - 1).bit_length(), _LEAST)
            self._grow(max(min(ahead, most), self._capacity))
            missing = len(new_owners) - len(self._free)
        if missing > 0:
            self._free_others(owner_list, missing, lambda _used_at: True)
        for owner in new_owners:
            self._number_of[owner] = self._free.pop()
        numbers = np.array([self._number_of[owner] for owner in owner_list], int)
        self._used_at[numbers] = time
        return numbers

    def _free_others(self, owners, count, may_go) -> int:
        """Free up to a count of poses of other owners; return how many."""
        others = [
            owner
            for owner in self._number_of.keys() - set(owners)
            if may_go(self._used_at[self._number_of[owner]])
        ][:count]
        for owner in others:
            self._free.append(self._number_of.pop(owner))
        return len(others)

    def _pose(self, numbers, moments):
        """Take the poses of moments, each of some of the numbers."""
        for places, moment in moments:
            moment_numbers = numbers[places]
            for k, mesh_actor in enumerate(self.mesh_actors):
                self.figure_from_mesh[moment_numbers, k] = mesh_actor.local(moment)
                is_mirrored = mesh_actor.mirrors(np.eye(4), moment)
                self.turns[moment_numbers, k] = np.where(is_mirrored, -1.0, 1.0)
            for k, mesh_actor in enumerate(self._posed):
                mesh_poses = self._mesh_poses[k]
                self._mesh_poses[k] = self._with(
                    mesh_poses, moment_numbers, mesh_actor.mesh_pose(moment)
                )

    def _with(self, mesh_poses, numbers, mesh_pose):
        """Return the poses of a mesh, in one `MeshPose` if only joints move it."""
        if mesh_pose.matrices is not None and mesh_pose.matrices.ndim == 4:
            matrices = getattr(mesh_poses, 'matrices', mesh_pose.matrices[:0])
            if len(matrices) < self._capacity:  # unused poses are drawn too, but never read
                extra = self._capacity - len(matrices)
                matrices = np.concatenate([matrices, np.repeat(mesh_pose.matrices[:1], extra, 0)])
            matrices[numbers] = mesh_pose.matrices
            return MeshPose(matrices, mesh_pose.origin)
        mesh_poses += [mesh_pose] * (self._capacity - len(mesh_poses))
        for number in numbers.tolist():
            mesh_poses[number] = mesh_pose
        return mesh_poses

    def _draw(self, window, numbers):
        """Pose the vertices of some poses, and of those between them."""
        first, end = (numbers.min(), numbers.max() + 1) if len(numbers) else (0, self._capacity)
        if self.posing is None or self.posing.poses != self._capacity:
            self._release_posing()
            rest_meshes = [actor.rest_mesh for actor in self._posed]
            self.posing = Posing(window, rest_meshes, poses=self._capacity)
            first, end = 0, self._capacity
        options = {'skinning_mode': self.skinning, 'span': (int(first), int(end))}
        self.posing.draw(self._mesh_poses, **options)

    def _release_posing(self):
        release(self.posing)
        self.posing = None

    def release(self):
        """Free the GPU's memory, and forget all poses; the context must be alive."""
        self._release_posing()
        self._forget()
