"""Near members of a crowd drawn as meshes, many per draw call."""

from __future__ import annotations

import numpy as np

from pvibr.figures.mesh_actors import PosedMeshActor, WireMeshActor
from pvibr.figures.pose_sheet import WIDTH
from pvibr.gl import Texture, nbytes_of, shader_source
from pvibr.gl.feature import Feature, sections
from pvibr.instances.mesh_draws import (
    MeshDraws,
    MeshPartDraws,
    can_batch,
    draws_feature,
)
from pvibr.instances.mesh_pool import PLACE_ERROR
from pvibr.meshes.materials import culled_faces
from pvibr.things.shader_draws import ROW, pack

_TEXELS = 4  # per member


def can_share_draws(level, may_mirror) -> bool:
    """Return whether members may share draws: all look, and wind if faces are culled, alike."""
    if may_mirror and culls_faces(level.mesh_actors):
        return False
    # Also heavy ones, each with a draw of its own: an actor costs more than that.
    return can_batch(level, np.inf) and all(_is_alike(actor) for actor in level.mesh_actors)


def _is_alike(mesh_actor) -> bool:
    if isinstance(mesh_actor, PosedMeshActor):
        return not mesh_actor.has_morphed_colors
    return not isinstance(mesh_actor, WireMeshActor)


def culls_faces(mesh_actors) -> bool:
    """Return whether the material of any mesh culls faces."""
    return any(any(culled_faces(actor.actor.GetProperty())) for actor in mesh_actors)


class CrowdDraws(MeshDraws):
    """The near members of a group that show a level."""

    def __init__(self, level, poses, *shared):
        self.poses = poses
        super().__init__(level, *shared)

    def _part_draws(self, capacity, center, *shared) -> list:
        level = self.level
        rows = zip(level.parts, level.materials, level.mesh_actors, strict=True)
        origin = np.zeros_like(center)  # matrices are those of the meshes
        return [MemberDraws(*row, self.poses, capacity, origin, *shared) for row in rows]

    def set_inputs(self, _entries, *inputs):
        """Set the textures and uniforms that all parts share; each has entries of its own."""
        for draws in self._parts:
            draws.set_inputs(draws.entries, *inputs)

    def upload(self, window, slots, shares, radii, numbers, eye_from_figure):
        """Upload what places and poses each member that is drawn, nearest first."""
        for k, draws in enumerate(self._parts):
            entries = np.empty((len(slots), _TEXELS, 4))
            eye_from_mesh = eye_from_figure @ self.poses.figure_from_mesh[numbers, k]
            entries[:, :3] = eye_from_mesh[:, :3]
            entries[:, 3, 0] = self.poses.first_rows(draws.mesh_actor, numbers)
            entries[:, 3, 1], entries[:, 3, 2] = slots, shares
            entries[:, 3, 3] = PLACE_ERROR * radii * self.poses.turns[numbers, k]
            draws.upload_entries(window, entries.reshape(-1, 4).astype(np.float32))

    @property
    def nbytes(self) -> int:
        """Bytes of the entries on the GPU."""
        return nbytes_of(*self._parts)

    def release(self, window):
        """Free GPU memory; the context is current."""
        for draws in self._parts:
            draws.release(window)


class MemberDraws(MeshPartDraws):
    """Draws of one mesh of a figure, in the poses of near members."""

    def __init__(self, part, material, mesh_actor, poses, *shared):
        self.mesh_actor, self.poses = mesh_actor, poses
        self._uploaded = np.zeros(0, np.float32)
        super().__init__(part, material, *shared)

    def _feature(self, *, depth=False) -> Feature:
        return member_feature(self.part.mesh, isinstance(self.mesh_actor, PosedMeshActor), depth)

    def upload_entries(self, window, entries):
        """Upload the entries unless they are on the GPU."""
        if self.entries is None or not np.array_equal(entries, self._uploaded):
            self._uploaded = entries
            self.entries = self.entries or Texture(window)
            self.entries.upload(pack(entries, _TEXELS * ROW, 4))

    def _inputs(self):
        textures, *uniforms = super()._inputs()
        if self.poses.posing is not None and isinstance(self.mesh_actor, PosedMeshActor):
            textures = textures | self.poses.posing.textures
        return textures, *uniforms


def member_feature(mesh, is_posed, depth=False) -> Feature:
    """Return the shader of copies of a mesh, each with a matrix and perhaps a pose."""
    section = sections(shader_source(__file__))
    defines = f'#define POSED {int(is_posed)}\n#define WIDTH {WIDTH}u\n'
    normal = '#define normalMC ibr_vertex_normal\n', '#undef normalMC\n'
    return draws_feature(
        mesh,
        defines + section['vertex.members'],
        section['vertex.begin'],
        depth=depth,
        around_normal=normal if is_posed else ('', ''),
    )
