"""The meshes of a figure posed on the GPU, or by the CPU where the GPU has no room for them."""

from __future__ import annotations

from pvibr.core.errors import warn
from pvibr.figures.posing import Posing


class FigurePosing:
    """Posed meshes of one figure."""

    def __init__(self, posed):
        self._posed = posed
        self.gpu: Posing | None = None
        #: Why the CPU poses the meshes; empty if the GPU does.
        self.refusal = ''

    @property
    def nbytes(self) -> int:
        """Bytes on the GPU."""
        return 0 if self.gpu is None else self.gpu.nbytes

    def passes(self, window, moment, skinning, bulge) -> list:
        """Return the passes that pose the meshes on the GPU, none if the CPU has posed them."""
        if not self.refusal:
            try:
                return self._gpu_passes(window, moment, skinning, bulge)
            except (ValueError, RuntimeError) as error:
                self._refuse(error)
        for mesh_actor in self._posed:
            placement = mesh_actor.local(moment), skinning, bulge
            mesh_actor.pose_here(mesh_actor.mesh, moment.pose, *placement)
        return []

    def _gpu_passes(self, window, moment, skinning, bulge) -> list:
        if self.gpu is None:
            self.gpu = Posing(window, [a.rest_mesh for a in self._posed])
            for mesh_actor, first_row in zip(self._posed, self.gpu.rows, strict=False):
                mesh_actor.aim(first_row)
                mesh_actor.draws.posing = self.gpu
        mesh_poses = [[a.mesh_pose(moment)] for a in self._posed]
        return self.gpu.passes(mesh_poses, skinning, bulge)

    def _refuse(self, error):
        """Let the CPU pose the meshes from now on."""
        self._release_gpu()
        self.refusal = f'posed by the CPU, which takes longer: {error}'
        for mesh_actor in self._posed:
            mesh_actor.use_gpu(False)
        warn(f'A figure is {self.refusal}.')

    def unbind(self):
        """Release the texture units."""
        for mesh_actor in self._posed[:1]:
            mesh_actor.draws.unbind()

    def release(self):
        """Release all GPU resources, and let the GPU try again; the context must be alive."""
        self._release_gpu()
        for mesh_actor in self._posed if self.refusal else ():
            mesh_actor.use_gpu(True)
        self.refusal = ''

    def _release_gpu(self):
        self.unbind()
        if self.gpu is not None:
            self.gpu.release()
        for mesh_actor in self._posed:
            mesh_actor.draws.posing = None
        self.gpu = None
