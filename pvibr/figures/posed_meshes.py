"""Near members of a crowd: meshes posed on the GPU, each at its own clip time."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from pvibr.figures.mesh_actors import PosedMeshActor
from pvibr.figures.posing import MeshPose, Posing, posed_feature
from pvibr.gl import set_vertex_uniforms
from pvibr.instances.mesh_pool import MeshPool, lendable


class _Group(list):
    """Actors of one member, the number of its pose, and the posing that they read it from."""

    number = 0
    posing: Posing | None = None
    #: The matrices of the actors, and whether their meshes are mirrored.
    matrices: list
    mirrored: list


class PosedPool(MeshPool):
    """Actors of a figure, lent to near members and posed for each."""

    turns_normals = False  # where a pose mirrors, faces are wound the other way

    def __init__(self, level, skinning):
        super().__init__(level)
        self.mesh_actors, self.skinning = level.mesh_actors, skinning
        self._posed = [b for b in self.mesh_actors if isinstance(b, PosedMeshActor)]
        self._posing: Posing | None = None
        #: Slot and clip time of each pose, by its number.
        self._shown_keys: dict = {}
        #: By mesh, its last pose of each number.
        self._mesh_poses: list[list] = [[] for _ in self._posed]
        self._made_so_far = 0

    def _new_actors(self) -> list:
        group = _Group(self._actor(mesh_actor) for mesh_actor in self.mesh_actors)
        group.number = self._made_so_far
        group.matrices = [actor.GetUserMatrix() for actor in group]
        group.mirrored = [False] * len(group)
        self._made_so_far += 1
        return group

    def _actor(self, mesh_actor):
        actor = lendable(mesh_actor.part, mesh_actor.actor.GetMapper())
        if isinstance(mesh_actor, PosedMeshActor):
            posed_feature().attach(actor)
        return actor

    def show_sides(self, outside):
        """Show both sides: a pose may flip triangles."""

    @property
    def nbytes(self) -> int:
        """Bytes on the GPU."""
        return 0 if self._posing is None else self._posing.nbytes

    def pose(self, window, key_by_slot, moments_of, matrices_of):
        """Pose the lent actors whose clip time has changed."""
        pose_keys = {self.lent[i].number: (i, key) for i, key in key_by_slot.items()}
        changed = dict(
            pose_key
            for number, pose_key in pose_keys.items()
            if self._shown_keys.get(number) != pose_key
        )
        if changed:
            groups = [self.lent[i] for i in changed]
            world_from_figure = np.asarray(matrices_of(list(changed)), float)
            self._draw(window, groups, moments_of(list(changed.values())), world_from_figure)
        self._shown_keys = pose_keys
        for mesh_actor in self._posed:
            mesh_actor.draws.posing = self._posing

    def _place(self, actors, matrix):
        super()._place(actors, matrix)
        self._shown_keys.pop(actors.number, None)  # the pose moves the meshes, too

    def _draw(self, window, groups, moments, world_from_figure):
        for indices, moment in moments:
            shown_groups = [groups[i] for i in indices]
            for k, mesh_actor in enumerate(self.mesh_actors):
                matrices = world_from_figure[indices] @ mesh_actor.local(moment)
                mirrored = np.broadcast_to(mesh_actor.mirrors(matrices, moment), len(indices))
                _move(shown_groups, k, mesh_actor, matrices, mirrored)
        if not self._posed:
            return
        posing = self._posing_with_room(window)
        for mesh_actor, mesh_poses in zip(self._posed, self._mesh_poses, strict=True):
            changed_poses: dict = {}
            for indices, moment in moments:
                poses = _single_poses(mesh_actor.mesh_pose(moment))
                numbers = [groups[i].number for i in indices]
                changed_poses.update(zip(numbers, poses, strict=True))
            # Unused poses are drawn too, but never read.
            any_pose = next(iter(changed_poses.values()))
            mesh_poses += [any_pose] * (posing.poses - len(mesh_poses))
            for number, mesh_pose in changed_poses.items():
                mesh_poses[number] = mesh_pose
        posing.draw(self._mesh_poses, skinning_mode=self.skinning)
        for group in self.lent.values():
            if group.posing is not posing:
                self._aim(posing, group)

    def _posing_with_room(self, window) -> Posing:
        """Return a posing with a pose for each group of actors."""
        if self._posing is None or self._posing.poses < self._made_so_far:
            self._release_posing()
            rest_meshes = [b.rest_mesh for b in self._posed]
            pose_capacity = max(4, 1 << (self._made_so_far - 1).bit_length())
            self._posing = Posing(window, rest_meshes, poses=pose_capacity)
        return self._posing

    def _aim(self, posing, group):
        group.posing = posing
        pairs = zip(self.mesh_actors, group, strict=True)
        actors = [actor for posed, actor in pairs if isinstance(posed, PosedMeshActor)]
        for actor, (first_row, end_row) in zip(actors, pairwise(posing.rows), strict=True):
            n_rows = (end_row - first_row) // posing.poses
            set_vertex_uniforms((actor,), {'ibr_posed_row': first_row + group.number * n_rows})

    def finish(self):
        """Release the texture units."""
        for mesh_actor in self._posed[:1]:
            mesh_actor.draws.unbind()

    def _release_posing(self):
        self.finish()
        if self._posing is not None:
            self._posing.release()
        self._posing = None

    def release(self, window):
        """Release all GPU resources; the context must be alive."""
        self._release_posing()
        self._shown_keys = {}
        for mesh_actor in self.mesh_actors:
            mesh_actor.release(window)


def _move(groups, k, mesh_actor, matrices, mirrored):
    """Place the k-th actor of each group, wound the other way where it is mirrored."""
    rows = matrices.reshape(-1, 16).tolist()
    for group, row, is_mirrored in zip(groups, rows, mirrored.tolist(), strict=True):
        group.matrices[k].DeepCopy(row)
        if is_mirrored != group.mirrored[k]:
            group.mirrored[k] = is_mirrored
            group[k].SetMapper(mesh_actor.mapper(is_mirrored))


def _single_poses(mesh_pose) -> list[MeshPose]:
    """Return each pose of a mesh in one or many poses."""
    if mesh_pose.matrices is None or mesh_pose.matrices.ndim == 3:
        return [mesh_pose]
    return [MeshPose(matrices, mesh_pose.origin) for matrices in mesh_pose.matrices]
