"""Meshes of a figure posed on the CPU."""

from __future__ import annotations

import numpy as np

from pvibr.animation.normals import point_normals, with_flipped_winding
from pvibr.figures.mesh_actors import PosedMeshActor
from pvibr.maths.transforms import transform_normals, transform_points
from pvibr.meshes.parts import Part


class PoseSampler:
    """Poses the meshes of a figure on the CPU, relative to a centre."""

    def __init__(self, figure, mesh_actors, skinning):
        self.figure, self.mesh_actors, self.skinning = figure, mesh_actors, skinning
        self.center = np.zeros(3)

    def shapes(self, pose) -> list:
        """Return points and normals of each mesh, (v, 3) float64 each, and if it is mirrored."""
        world = self.figure.world(pose)
        return [self._shape(i, pose, world) for i in range(len(self.mesh_actors))]

    def points(self, mesh_index, pose) -> np.ndarray:
        """Return the points of a mesh in a pose, in the figure's space, (v, 3) float64."""
        return self._posed(mesh_index, pose, self.figure.world(pose))[0]

    def _posed(self, mesh_index, pose, world):
        mesh_actor = self.mesh_actors[mesh_index]
        if isinstance(mesh_actor, PosedMeshActor):
            return self.figure.posed(mesh_index, pose, self.skinning)
        figure_from_joint = np.eye(4) if mesh_actor.node < 0 else world[mesh_actor.node]
        mesh = mesh_actor.part.mesh
        points = transform_points(figure_from_joint, mesh.points)
        return points, transform_normals(figure_from_joint, point_normals(mesh))

    def _shape(self, mesh_index, pose, world):
        points, normals = self._posed(mesh_index, pose, world)
        return points - self.center, normals, self.figure.meshes[mesh_index].mirrors(world)

    def parts(self, pose) -> list[Part]:
        """Return the parts of the figure in a pose."""
        # Deep copies of the meshes: shallow ones share their points.
        parts = [a.part.with_mesh(a.part.mesh.copy()) for a in self.mesh_actors]
        self.set_pose(parts, pose)
        return parts

    def set_pose(self, parts, pose):
        """Set points, normals and winding of parts that :meth:`parts` returned."""
        shapes = zip(self.mesh_actors, parts, self.shapes(pose), strict=True)
        for mesh_actor, part, (points, normals, is_mirrored) in shapes:
            part.mesh.points = points.astype(np.float32)
            part.mesh.point_data.active_normals = normals.astype(np.float32)
            mesh = mesh_actor.part.mesh
            part.mesh.SetPolys((with_flipped_winding(mesh) if is_mirrored else mesh).GetPolys())
