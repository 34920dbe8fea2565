"""A ground under the scene, without a visible end."""

from __future__ import annotations

from typing import Any

import numpy as np
import pyvista as pv

from pvibr.core import _vtk
from pvibr.core.colors import Color
from pvibr.core.effect import Effect
from pvibr.core.params import Param
from pvibr.core.plotters import put_inner
from pvibr.gl import set_fragment_uniforms, shader_source
from pvibr.gl.feature import Feature, sections
from pvibr.maths.vectors import unit_vectors

#: Where fading starts, in radii of the scene, and ends, as a fraction of the ground's radius.
_FADE, _FADED = 1.05, 0.9
#: Gap below the scene, in radii of the scene, against z-fighting with flat scenes; elsewhere a
#: fraction of the scene's height is enough.
_GAP, _GAP_OF_HEIGHT = 1e-3, 1e-2
#: Least near plane as a fraction of the far one, for the precision of depth buffers.
_NEAREST = 2e-4
_TEXT = sections(shader_source(__file__))
FADES = Feature(
    'ground',
    vertex={
        'VTK::PositionVC::Dec': _TEXT['vertex.declare'],
        'VTK::PositionVC::Impl': _TEXT['vertex.place'],
    },
    fragment={
        'VTK::PositionVC::Dec': _TEXT['fragment.declare'],
        'VTK::DepthPeeling::Impl': _TEXT['fragment.fade'],
    },
)


class Ground(Effect):
    """A ground under the scene that fades into the horizon.

    It receives light and shadows like any surface and casts none. Its size follows the scene, but
    it is not part of the scene's bounds: resetting the camera ignores it. It is invisible from
    below.

    Parameters
    ----------
    color : ColorLike, optional
        Colour of the material.
    **settings
        Values of the class's settings.

    Examples
    --------
    >>> import pyvista as pv
    >>> import pvibr
    >>> pl = pv.Plotter(off_screen=True)
    >>> _ = pl.add_mesh(pv.Sphere())
    >>> ground = pl.ibr.add(pvibr.Ground('ivory'))
    >>> shadows = pl.ibr.add(pvibr.Shadows())
    >>> pl.bounds.z_min
    -0.5
    """

    single = True
    neutral = 'size', 0
    web = 'shown', 'a disc that does not fade'

    color = Color((0.85, 0.85, 0.85), 'Colour of the material.')
    size = Param(16.0, 'Radius in radii of the scene; 0 hides the ground.', range='[0, 1000]')
    up = Param((0.0, 0.0, 1.0), 'Up direction in world space.')
    height = Param(
        None,
        'Height along `up` in world space; by default right below the scene.',
        unit='world',
        kind=float,
    )

    def __init__(self, color=color.default, **settings):
        self._actor: Any = None
        self._observer: int | None = None
        self._fit_key: tuple = ()
        #: Near and far planes before and after they were widened.
        self._plane_change: tuple = ((), ())
        self._disc_center, self._scene_radius = np.zeros(3), 0.0
        super().__init__(color=color, **settings)

    @property
    def props(self) -> tuple:
        """VTK props in the scene."""
        return () if self._actor is None else (self._actor,)

    def attach(self, pipeline):
        """Add the disc to the scene."""
        super().attach(pipeline)
        renderer = pipeline.renderer
        disc = pv.Disc(inner=0.0, outer=1.0, r_res=1, c_res=90)
        self._actor = pv.Actor(pv.DataSetMapper(disc))
        self._actor.SetUseBounds(False)
        self._actor.SetPickable(False)
        self._actor.SetProperty(_vtk.vtkProperty())  # PyVista's has edges if its theme has
        self._actor.GetProperty().BackfaceCullingOn()
        self._actor.SetVisibility(False)  # until a frame needs it
        FADES.attach(self._actor)
        self._fit_key = ()
        put_inner(renderer, self._actor)
        self._observer = renderer.AddObserver('ResetCameraClippingRangeEvent', self._widen_planes)
        self._widen_planes(renderer)

    def detach(self):
        """Remove the disc from the scene."""
        renderer = self.pipeline.renderer
        self._restore_planes(renderer)
        renderer.RemoveActor(self._actor)
        renderer.RemoveObserver(self._observer)
        self._actor = self._observer = None
        super().detach()

    def needed(self, frame) -> bool | str:
        """Return True if there is a scene above."""
        needs = super().needed(frame)
        if needs is True and not np.any(self.up):
            needs = 'up is (0, 0, 0): give a direction'
        if needs is True and not self._fit_scene(frame.renderer):
            needs = 'the scene is empty'
        if needs is not True:
            self._restore_planes(frame.renderer)
        elif not self._actor.GetVisibility():
            self._widen_planes(frame.renderer)
        self._actor.SetVisibility(needs is True)
        return needs

    def deactivate(self):
        """Hide the disc."""
        if self._actor is not None:
            self._restore_planes(self.pipeline.renderer)
            self._actor.SetVisibility(False)

    def _fit_scene(self, renderer) -> bool:
        """Fit place and size to the scene; return False if it is empty."""
        low_corner, high_corner = np.reshape(renderer.ComputeVisiblePropBounds(), (3, 2)).T
        if not (low_corner <= high_corner).all():
            return False
        fit_key = (*low_corner, *high_corner, *self.up, self.height, self.size, *self.color)
        if fit_key == self._fit_key:
            return True
        self._fit_key = fit_key
        up, scene_center = unit_vectors(self.up), (low_corner + high_corner) / 2
        self._scene_radius = max(float(np.linalg.norm(high_corner - low_corner)) / 2, 1e-12)
        # The lowest and highest corner of the box along the up direction.
        corner_pairs = (low_corner, high_corner), (high_corner, low_corner)
        lowest, highest = (float(np.where(up > 0, *pair) @ up) for pair in corner_pairs)
        gap = _GAP * self._scene_radius
        if highest - lowest > gap:
            gap = min(gap, _GAP_OF_HEIGHT * (highest - lowest))
        height = lowest - gap if self.height is None else self.height
        self._disc_center = scene_center + (height - scene_center @ up) * up
        side_axis = np.eye(3)[np.abs(up).argmin()]
        right_axis = unit_vectors(np.cross(side_axis, up))
        disc_matrix = np.eye(4)
        disc_axes = np.column_stack([right_axis, np.cross(up, right_axis), up])
        disc_matrix[:3, :3], disc_matrix[:3, 3] = self._world_size * disc_axes, self._disc_center
        self._actor.user_matrix = disc_matrix
        self._actor.GetProperty().SetColor(*self.color)
        return True

    @property
    def _world_size(self) -> float:
        return self.size * self._scene_radius

    def _widen_planes(self, renderer, _event=None):
        """Widen near and far planes to include the ground, which the bounds leave out."""
        if not (self.enabled and self.size and np.any(self.up) and self._fit_scene(renderer)):
            return
        camera = renderer.GetActiveCamera()
        scene_planes = camera.GetClippingRange()
        if scene_planes == self._plane_change[1]:
            scene_planes = self._plane_change[0]
        near, far = scene_planes
        eye_offset = np.array(camera.GetPosition()) - self._disc_center
        far = max(far, float(np.linalg.norm(eye_offset)) + self._world_size)
        # In perspective, no point of a plane is closer than the eye's height above it.
        eye_height = float(eye_offset @ unit_vectors(self.up))
        if camera.GetParallelProjection():
            eye_height = 0.0
        if eye_height >= 0:
            near = max(min(near, 0.5 * eye_height), _NEAREST * far)
        camera.SetClippingRange(near, far)
        self._plane_change = scene_planes, camera.GetClippingRange()

    def _restore_planes(self, renderer):
        """Restore near and far planes, unless something else changed them."""
        camera = renderer.GetActiveCamera()
        if camera.GetClippingRange() == self._plane_change[1]:
            camera.SetClippingRange(*self._plane_change[0])

    def prepare(self, frame):
        """Set the colour and range of the fading."""
        set_fragment_uniforms(self.props, self.fading(frame))

    def fading(self, frame) -> dict:
        """Return the uniforms of the shader by which it fades."""
        fade_span = _FADE, max(_FADED * self.size, 2 * _FADE)
        return {
            'ibr_horizon': tuple(self.pipeline.horizon_color(frame)),
            'ibr_fade': tuple(radius / self.size for radius in fade_span),
        }
