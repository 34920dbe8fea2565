"""Near members of a crowd: meshes posed on the GPU, each at its own clip time."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from pvibr.figures.mesh_actors import PosedMeshActor
from pvibr.figures.posing import SAMPLERS, Posing, posed_feature
from pvibr.instances.mesh_pool import MeshPool, lendable


class _Group(list):
    """Actors of one member, and the number of its pose."""

    number = 0


class PosedPool(MeshPool):
    """Actors of a figure, lent to near members and posed with them."""

    def __init__(self, level, mesh_actors, skinning):
        super().__init__(level)
        self.mesh_actors, self.skinning = mesh_actors, skinning
        self._posed = [b for b in mesh_actors if isinstance(b, PosedMeshActor)]
        self._posing: Posing | None = None
        self._shown: dict = {}
        self._made_so_far = 0

    def _made(self) -> list:
        group = _Group(self._actor(mesh_actor) for mesh_actor in self.mesh_actors)
        group.number = self._made_so_far
        self._made_so_far += 1
        return group

    def _actor(self, mesh_actor):
        actor = lendable(mesh_actor.part, mesh_actor.actor.GetMapper())
        if isinstance(mesh_actor, PosedMeshActor):
            posed_feature().attach(actor)
        return actor

    @property
    def nbytes(self) -> int:
        """Bytes on the GPU."""
        return 0 if self._posing is None else self._posing.nbytes

    def pose(self, window, keys, moments_of, matrix_of):
        """Pose the lent actors if any changed, and bind their textures."""
        shown = {self.lent[i].number: (i, key) for i, key in keys.items()}
        if any(self._shown.get(number) != what for number, what in shown.items()):
            moments = moments_of(list(keys.values()))
            self._draw(window, dict(zip(keys, moments, strict=True)), matrix_of)
            self._shown = shown
        if self._posing is None or not shown:
            return
        units = {name: t.activate() for name, t in self._posing.textures.items()}
        for group in self.lent.values():
            self._aim(self._posing, group, units)

    def _draw(self, window, moments, matrix_of):
        for i, moment in moments.items():
            world = matrix_of(i)
            for mesh_actor, actor in zip(self.mesh_actors, self.lent[i], strict=True):
                matrix = world @ mesh_actor.local(moment)
                actor.GetUserMatrix().DeepCopy(np.asarray(matrix, float).ravel().tolist())
        if not self._posed:
            return
        if self._posing is None or self._posing.poses < self._made_so_far:
            self._release_posing()
            rest_meshes = [b.rest_mesh for b in self._posed]
            room = max(4, 1 << (self._made_so_far - 1).bit_length())
            self._posing = Posing(window, rest_meshes, poses=room, how=self.skinning)
        # Unused poses are drawn too, but never read.
        some = next(iter(moments.values()))
        placed = [some] * self._posing.poses
        for i, moment in moments.items():
            placed[self.lent[i].number] = moment
        places = []
        for mesh_actor in self._posed:
            made = {id(moment): mesh_actor.mesh_pose(moment) for moment in moments.values()}
            places.append([made[id(moment)] for moment in placed])
        self._posing.draw(places)

    def _aim(self, posing, group, units):
        moved = [
            a
            for b, a in zip(self.mesh_actors, group, strict=True)
            if isinstance(b, PosedMeshActor)
        ]
        for actor, (first, end) in zip(moved, pairwise(posing.rows), strict=True):
            rows = (end - first) // posing.poses
            uniforms = actor.GetShaderProperty().GetVertexCustomUniforms()
            uniforms.SetUniformi('ibr_posed_row', first + group.number * rows)
            for name in SAMPLERS:
                uniforms.SetUniformi(name, units[name])

    def finish(self):
        """Release the texture units."""
        if self._posing is not None:
            for texture in self._posing.textures.values():
                texture.deactivate()

    def _release_posing(self):
        if self._posing is not None:
            self._posing.release()
        self._posing, self._shown = None, {}

    def release(self, window):
        """Release all GPU resources; the context must be alive."""
        self._release_posing()
        for mesh_actor in self.mesh_actors:
            mesh_actor.release(window)
