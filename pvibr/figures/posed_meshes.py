"""Near members of a crowd: meshes posed on the GPU, each at its own clip time."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from pvibr.figures.mesh_actors import PosedMeshActor
from pvibr.figures.posing import Posing, posed_feature
from pvibr.gl import set_vertex_uniforms
from pvibr.instances.mesh_pool import MeshPool, lendable


class _Group(list):
    """Actors of one member, and the number of its pose."""

    number = 0


class PosedPool(MeshPool):
    """Actors of a figure, lent to near members and posed for each."""

    turns_normals = False  # where a pose mirrors, faces are wound the other way

    def __init__(self, level, mesh_actors, skinning):
        super().__init__(level)
        self.mesh_actors, self.skinning = mesh_actors, skinning
        self._posed = [b for b in mesh_actors if isinstance(b, PosedMeshActor)]
        self._posing: Posing | None = None
        self._shown_keys: dict = {}
        self._made_so_far = 0

    def _new_actors(self) -> list:
        group = _Group(self._actor(mesh_actor) for mesh_actor in self.mesh_actors)
        group.number = self._made_so_far
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

    def pose(self, window, key_by_slot, moments_of, matrix_of):
        """Pose the lent actors if any changed."""
        pose_keys = {self.lent[i].number: (i, key) for i, key in key_by_slot.items()}
        if any(self._shown_keys.get(number) != pose_key for number, pose_key in pose_keys.items()):
            moments = moments_of(list(key_by_slot.values()))
            self._draw(window, dict(zip(key_by_slot, moments, strict=True)), matrix_of)
        self._shown_keys = pose_keys  # newly lent actors have no pose yet
        for mesh_actor in self._posed:
            mesh_actor.draws.posing = self._posing

    def _draw(self, window, moments, matrix_of):
        for i, moment in moments.items():
            world_from_figure = matrix_of(i)
            for mesh_actor, actor in zip(self.mesh_actors, self.lent[i], strict=True):
                world_from_mesh = world_from_figure @ mesh_actor.local(moment)
                actor.GetUserMatrix().DeepCopy(np.asarray(world_from_mesh, float).ravel().tolist())
                mapper = mesh_actor.mapper(mesh_actor.mirrors(world_from_mesh, moment))
                if actor.GetMapper() is not mapper:
                    actor.SetMapper(mapper)
        if not self._posed:
            return
        if self._posing is None or self._posing.poses < self._made_so_far:
            self._release_posing()
            rest_meshes = [b.rest_mesh for b in self._posed]
            pose_capacity = max(4, 1 << (self._made_so_far - 1).bit_length())
            self._posing = Posing(window, rest_meshes, poses=pose_capacity)
        # Unused poses are drawn too, but never read.
        any_moment = next(iter(moments.values()))
        moment_by_pose = [any_moment] * self._posing.poses
        for i, moment in moments.items():
            moment_by_pose[self.lent[i].number] = moment
        mesh_poses = []
        for mesh_actor in self._posed:
            pose_of = {id(moment): mesh_actor.mesh_pose(moment) for moment in moments.values()}
            mesh_poses.append([pose_of[id(moment)] for moment in moment_by_pose])
        self._posing.draw(mesh_poses, skinning_mode=self.skinning)
        for group in self.lent.values():
            self._aim(self._posing, group)

    def _aim(self, posing, group):
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
        self._posing, self._shown_keys = None, {}

    def release(self, window):
        """Release all GPU resources; the context must be alive."""
        self._release_posing()
        for mesh_actor in self.mesh_actors:
            mesh_actor.release(window)
