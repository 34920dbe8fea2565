"""Materials of closed surfaces that cull the inner side."""

from __future__ import annotations

from functools import cached_property

from pvibr.core._vtk import address
from pvibr.gl.doubles import is_cut_out
from pvibr.instances.enclosing_surfaces import winding
from pvibr.meshes.decimate import Welded
from pvibr.meshes.materials import culled_faces
from pvibr.textures.material_textures import copied_property

_HEAVY = 300_000  # triangles from which it takes too long to test whether a surface is closed


class OneSided:
    """The material of a part, and a copy that culls the hidden side."""

    def __init__(self, part):
        self._part = part
        self._copy, self._known = None, None

    def material(self, outside):
        """Return the material; it culls the inner side, if hidden, when the eye is outside."""
        prop = self._part.actor.GetProperty()
        if not outside or any(culled_faces(prop)) or self._is_open() or not self._winding:
            return prop
        version = address(prop), prop.GetMTime()
        if version != self._known:
            self._copy, self._known = copied_property(prop), version
            self._copy.SetBackfaceCulling(self._winding > 0)
            self._copy.SetFrontfaceCulling(self._winding < 0)
        return self._copy

    def _is_open(self) -> bool:
        """Return True if the inside can be seen."""
        actor = self._part.actor
        planes = actor.GetMapper().GetClippingPlanes()
        is_clipped = planes is not None and planes.GetNumberOfItems() > 0
        is_translucent = actor.GetProperty().GetOpacity() < 1  # blended even if forced opaque
        return is_clipped or is_translucent or bool(actor.HasTranslucentPolygonalGeometry())

    @cached_property
    def _winding(self) -> int:
        part = self._part
        holes = part.alpha_cutoff is not None or is_cut_out(part.actor)
        if holes or not 0 < part.mesh.n_cells <= _HEAVY:  # lines and points have no side
            return 0
        welded = Welded.of(part.mesh)
        return winding(welded.points, welded.faces)
