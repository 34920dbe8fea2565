"""Near members of a crowd: meshes posed on the GPU, each at its own clip time."""

from __future__ import annotations

import numpy as np
import pyvista as pv

from pvibr.figures.member_poses import MemberPoses
from pvibr.figures.mesh_actors import PosedMeshActor, turn
from pvibr.figures.posing import posed_feature
from pvibr.gl import set_vertex_uniforms
from pvibr.instances.mesh_pool import MeshPool, lendable
from pvibr.maths.transforms import signs_of


class _Group(list):
    """Actors of one member, and the pose that they show."""

    #: Number, clip and time of the pose, and the posing that it is read from.
    shown: tuple = ()
    #: The matrices of the actors, and whether their meshes are mirrored.
    matrices: list
    mirrored: list


class PosedPool(MeshPool):
    """Actors of a figure, lent to near members and posed for each."""

    turns_normals = False  # where a pose mirrors, faces are wound the other way

    def __init__(self, level, skinning):
        super().__init__(level)
        self.mesh_actors = level.mesh_actors
        self.poses = MemberPoses(level.mesh_actors, skinning)
        self._posed = [a for a in self.mesh_actors if isinstance(a, PosedMeshActor)]
        #: Members, nearest first.
        self._slots: list = []

    def lend(self, ids, matrix_of) -> list:
        """Place actors at members, nearest first, and hide all others; return new actors."""
        self._slots = list(ids)
        return super().lend(ids, matrix_of)

    def _new_actors(self) -> list:
        group = _Group(self._actor(mesh_actor) for mesh_actor in self.mesh_actors)
        group.matrices = [actor.GetUserMatrix() for actor in group]
        group.mirrored = [False] * len(group)
        for k, mesh_actor in enumerate(self.mesh_actors) if self.poses.by_cpu else ():
            if isinstance(mesh_actor, PosedMeshActor):
                group[k].SetMapper(mesh_actor.mapper_of(mesh_actor.mesh.copy()))
        return group

    def _actor(self, mesh_actor):
        actor = lendable(mesh_actor.part, mesh_actor.actor.GetMapper())
        if isinstance(mesh_actor, PosedMeshActor) and not self.poses.by_cpu:
            posed_feature().attach(actor)
        return actor

    def show_sides(self, outside):
        """Show both sides: a pose may flip triangles."""

    @property
    def nbytes(self) -> int:
        """Bytes on the GPU."""
        return self.poses.nbytes

    def pose(self, window, group, time, state):
        """Pose the lent actors whose clip time has changed."""
        slots = np.array(self._slots)
        numbers, keys = state.pose_members(self.poses, window, group, time, slots)
        posing = self.poses.posing
        poses = zip(self._slots, numbers.tolist(), keys.tolist(), strict=True)
        shown = [(self.lent[slot], (number, *key, posing)) for slot, number, key in poses]
        changed = [k for k, (actors, pose) in enumerate(shown) if actors.shown != pose]
        for mesh_actor in self._posed:
            mesh_actor.draws.posing = posing
        if not changed:
            return
        groups = [shown[k][0] for k in changed]
        self._move(groups, numbers[changed], group.matrices(slots[changed]))
        for k in changed if self.poses.by_cpu else ():
            clip, seconds = keys[k].tolist()
            self._pose_here(shown[k][0], numbers[k], state.pose(int(clip), seconds))
        for k in changed:
            shown[k][0].shown = shown[k][1]

    def _place(self, actors, matrix):
        super()._place(actors, matrix)
        actors.shown = ()  # the pose moves the meshes, too

    def _move(self, groups, numbers, world_from_figure):
        """Place the actors of groups in poses, wound the other way where these mirror them."""
        for k, mesh_actor in enumerate(self.mesh_actors):
            matrices = world_from_figure @ self.poses.figure_from_mesh[numbers, k]
            mirrored = (self.poses.turns[numbers, k] < 0) != (signs_of(matrices) < 0)
            first_rows = self.poses.first_rows(mesh_actor, numbers).astype(int).tolist()
            rows = matrices.reshape(-1, 16).tolist(), mirrored.tolist(), first_rows
            for group, matrix, is_mirrored, first_row in zip(groups, *rows, strict=True):
                group.matrices[k].DeepCopy(matrix)
                is_posed = isinstance(mesh_actor, PosedMeshActor)
                if is_mirrored != group.mirrored[k]:
                    group.mirrored[k] = is_mirrored
                    if is_posed and self.poses.by_cpu:
                        turn(pv.wrap(group[k].GetMapper().GetInput()))
                    else:
                        group[k].SetMapper(mesh_actor.mapper(is_mirrored))
                if is_posed:
                    set_vertex_uniforms((group[k],), {'ibr_posed_row': first_row})

    def _pose_here(self, group, number, pose):
        """Pose the meshes of a group by the CPU."""
        for k, mesh_actor in enumerate(self.mesh_actors):
            if isinstance(mesh_actor, PosedMeshActor):
                mesh = pv.wrap(group[k].GetMapper().GetInput())
                placement = self.poses.figure_from_mesh[number, k], self.poses.skinning
                mesh_actor.pose_here(mesh, pose, *placement)

    def finish(self):
        """Release the texture units."""
        for mesh_actor in self._posed[:1]:
            mesh_actor.draws.unbind()

    def release(self, window):
        """Release all GPU resources; the context must be alive."""
        self.finish()
        self.poses.release()
        for mesh_actor in self.mesh_actors:
            mesh_actor.release(window)
