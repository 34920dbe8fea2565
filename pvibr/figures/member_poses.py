"""Poses of the near members of a crowd, which stay on the GPU while time stands still."""

from __future__ import annotations

import numpy as np

from pvibr.figures.mesh_actors import PosedMeshActor
from pvibr.figures.posing import MeshPose, Posing
from pvibr.gl import nbytes_of, release

_LEAST = 4  # poses for which there is room


class MemberPoses:
    """Poses by number; a member has one as long as it is near."""

    def __init__(self, mesh_actors, skinning):
        self.mesh_actors, self.skinning = mesh_actors, skinning
        self._posed = [a for a in mesh_actors if isinstance(a, PosedMeshActor)]
        self.posing: Posing | None = None
        self._capacity = 0
        self._number_by_slot: dict[int, int] = {}
        self._free: list[int] = []
        self._grow(_LEAST)

    def _grow(self, capacity):
        """Make room for poses."""
        extra, old = capacity - self._capacity, self._capacity
        self._free += range(capacity - 1, old - 1, -1)
        shape = extra, len(self.mesh_actors)
        identities = np.broadcast_to(np.eye(4), (*shape, 4, 4))
        if not old:
            self._keys = np.zeros((0, 2))
            #: Of each pose and mesh: the matrix, and -1 where joints mirror it, else 1.
            self.figure_from_mesh = np.zeros((0, *shape[1:], 4, 4))
            self.turns = np.zeros((0, *shape[1:]))
            self._mesh_poses: list[list | MeshPose] = [[] for _ in self._posed]
        self._keys = np.concatenate([self._keys, np.full((extra, 2), np.nan)])
        self.figure_from_mesh = np.concatenate([self.figure_from_mesh, identities])
        self.turns = np.concatenate([self.turns, np.ones(shape)])
        self._capacity = capacity

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

    def pose(self, window, slots, clips, seconds, moments_of) -> np.ndarray:
        """Pose the members at slots whose clip or clip time has changed; return their numbers."""
        numbers = self._numbers_of(slots)
        keys = np.stack([clips, seconds], 1)
        (changed,) = np.nonzero((self._keys[numbers] != keys).any(1))
        if len(changed):
            self._pose(numbers[changed], moments_of(keys[changed]))
            self._keys[numbers[changed]] = keys[changed]
        if self._posed and (len(changed) or self.posing is None) and len(slots):
            self._draw(window)
        return numbers

    def _numbers_of(self, slots) -> np.ndarray:
        """Return the number of the pose of each slot; those of other slots become free."""
        slot_list = slots.tolist()
        if self._number_by_slot.keys() != set(slot_list):
            for slot in self._number_by_slot.keys() - set(slot_list):
                self._free.append(self._number_by_slot.pop(slot))
            new_slots = [s for s in slot_list if s not in self._number_by_slot]
            if len(new_slots) > len(self._free):
                needed = len(self._number_by_slot) + len(new_slots)
                self._grow(1 << (needed - 1).bit_length())
            for slot in new_slots:
                self._number_by_slot[slot] = self._free.pop()
        return np.array([self._number_by_slot[s] for s in slot_list], int)

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

    def _draw(self, window):
        """Pose all vertices."""
        if self.posing is None or self.posing.poses != self._capacity:
            self._release_posing()
            rest_meshes = [actor.rest_mesh for actor in self._posed]
            self.posing = Posing(window, rest_meshes, poses=self._capacity)
        self.posing.draw(self._mesh_poses, skinning_mode=self.skinning)

    def _release_posing(self):
        release(self.posing)
        self.posing = None

    def release(self):
        """Free the GPU's memory; the context must be alive."""
        self._release_posing()
