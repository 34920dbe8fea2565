"""Materials of closed surfaces that cull the inner side."""

from __future__ import annotations

from functools import cached_property

from pvibr.core._vtk import method
from pvibr.gl.doubles import is_cut_out
from pvibr.instances.enclosing_surfaces import winding
from pvibr.meshes.decimate import Welded
from pvibr.meshes.materials import culled_faces
from pvibr.textures.material_textures import copied_property

_HEAVY = 300_000  # triangles from which it takes too long to test whether a surface is closed


class OneSided:
    """The material of a part, and a copy that culls the hidden side."""

    def __init__(self, part):
        self._part, actor = part, part.actor
        #: Methods of the actor, which each frame calls.
        self._actor_time, self._is_translucent, self._property = (
            method(actor, name)
            for name in ('GetMTime', 'HasTranslucentPolygonalGeometry', 'GetProperty')
        )
        # The copy, None if both sides may be seen, and the times that it was made at.
        self._copy, self._times = None, None

    def material(self, outside):
        """Return the material; it culls the inner side, if hidden, when the eye is outside."""
        if not outside or self._is_translucent():
            return self._property()
        times = self._actor_time(), self._part.actor.GetMapper().GetMTime()
        if times != self._times:
            self._copy, self._times = self._culling_copy(), times
        return self._copy or self._property()

    def _culling_copy(self):
        """Return a copy that culls the hidden side, None if there is none."""
        prop = self._property()
        if any(culled_faces(prop)) or self._is_open() or not self._winding:
            return None
        copy = copied_property(prop)
        copy.SetBackfaceCulling(self._winding > 0)
        copy.SetFrontfaceCulling(self._winding < 0)
        return copy

    def _is_open(self) -> bool:
        """Return True if the inside can be seen."""
        planes = self._part.actor.GetMapper().GetClippingPlanes()
        is_clipped = planes is not None and planes.GetNumberOfItems() > 0
        return is_clipped or self._property().GetOpacity() < 1  # blended even if forced opaque

    @cached_property
    def _winding(self) -> int:
        part = self._part
        holes = part.alpha_cutoff is not None or is_cut_out(part.actor)
        if holes or not 0 < part.mesh.n_cells <= _HEAVY:  # lines and points have no side
            return 0
        welded = Welded.of(part.mesh)
        return winding(welded.points, welded.faces)
