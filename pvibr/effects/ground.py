"""A ground under the scene that has no end to be seen."""

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

#: Where it begins to fade, in radii of the scene, and where it has faded, as a share of its own.
_FADE, _FADED = 1.05, 0.9
#: Gap under the scene, in radii of it: what is flat there would flicker. Under what is not, a
#: share of its height is enough.
_GAP, _GAP_OF_HEIGHT = 1e-3, 1e-2
#: Depth buffers need a near plane that is not much closer, as a share of the far one.
_NEAREST = 2e-4
_TEXT = sections(shader_source(__file__))
_FADES = Feature(
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
    """A ground under everything in the scene, which fades into the horizon.

    It receives light and shadows like any surface and casts none. Its size follows the scene, but
    it is not part of the scene's bounds, so resetting the camera ignores it. From below it is
    invisible.

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
    size = Param(16.0, 'Radius, in radii of the scene.', range='[0, 1000]')
    up = Param((0.0, 0.0, 1.0), 'Up direction in world space.')
    height = Param(
        None,
        'Height in world space; by default right below the scene.',
        unit='world',
        kind=float,
    )

    def __init__(self, color=color.default, **settings):
        self._actor: Any = None
        self._observer: int | None = None
        self._fitted: tuple = ()
        #: Near and far planes before they were moved, and after.
        self._planes: tuple = ((), ())
        self._center, self._radius = np.zeros(3), 0.0
        super().__init__(color=color, **settings)

    @property
    def props(self) -> tuple:
        """VTK props that stand for it in the scene."""
        return () if self._actor is None else (self._actor,)

    def attach(self, pipeline):
        """Put the disc into the scene."""
        super().attach(pipeline)
        renderer = pipeline.renderer
        disc = pv.Disc(inner=0.0, outer=1.0, r_res=1, c_res=90)
        self._actor = pv.Actor(pv.DataSetMapper(disc))
        self._actor.SetUseBounds(False)
        self._actor.SetPickable(False)
        self._actor.SetProperty(_vtk.vtkProperty())  # PyVista's has edges if its theme has
        self._actor.GetProperty().BackfaceCullingOn()
        self._actor.SetVisibility(False)  # until a frame needs it
        _FADES.attach(self._actor)
        self._fitted = ()
        put_inner(renderer, self._actor)
        self._observer = renderer.AddObserver('ResetCameraClippingRangeEvent', self._widen)
        self._widen(renderer)

    def detach(self):
        """Take the disc out of the scene."""
        renderer = self.pipeline.renderer
        self._narrow(renderer)
        renderer.RemoveActor(self._actor)
        renderer.RemoveObserver(self._observer)
        self._actor = self._observer = None
        super().detach()

    def needed(self, frame) -> bool | str:
        """Return True if there is a scene above it."""
        why = super().needed(frame)
        if why is True and not np.any(self.up):
            why = 'up is (0, 0, 0): give a direction'
        if why is True and not self._fit(frame.renderer):
            why = 'nothing is in the scene'
        if why is not True:
            self._narrow(frame.renderer)
        elif not self._actor.GetVisibility():
            self._widen(frame.renderer)
        self._actor.SetVisibility(why is True)
        return why

    def deactivate(self):
        """Hide the disc."""
        if self._actor is not None:
            self._narrow(self.pipeline.renderer)
            self._actor.SetVisibility(False)

    def _fit(self, renderer) -> bool:
        """Have the place and the size that the scene asks for; return whether there is one."""
        low, high = np.reshape(renderer.ComputeVisiblePropBounds(), (3, 2)).T
        if not (low <= high).all():
            return False
        key = (*low, *high, *self.up, self.height, self.size, *self.color)
        if key == self._fitted:
            return True
        self._fitted = key
        up, middle = unit_vectors(self.up), (low + high) / 2
        self._radius = max(float(np.linalg.norm(high - low)) / 2, 1e-12)
        # Of a box, the corner that is lowest along the up direction.
        ends = (low, high), (high, low)
        lowest, highest = (float(np.where(up > 0, *pair) @ up) for pair in ends)
        gap = _GAP * self._radius
        if highest - lowest > gap:
            gap = min(gap, _GAP_OF_HEIGHT * (highest - lowest))
        height = lowest - gap if self.height is None else self.height
        self._center = middle + (height - middle @ up) * up
        side = np.eye(3)[np.abs(up).argmin()]
        right = unit_vectors(np.cross(side, up))
        matrix = np.eye(4)
        axes = np.column_stack([right, np.cross(up, right), up])
        matrix[:3, :3], matrix[:3, 3] = self._reach * axes, self._center
        self._actor.user_matrix = matrix
        self._actor.GetProperty().SetColor(*self.color)
        return True

    @property
    def _reach(self) -> float:
        return self.size * self._radius

    def _widen(self, renderer, _event=None):
        """Have the near and far planes take the ground in, of which the bounds know nothing."""
        if not (self.enabled and self.size and np.any(self.up) and self._fit(renderer)):
            return
        camera = renderer.GetActiveCamera()
        before = camera.GetClippingRange()
        if before == self._planes[1]:
            before = self._planes[0]
        near, far = before
        away = np.array(camera.GetPosition()) - self._center
        far = max(far, float(np.linalg.norm(away)) + self._reach)
        # In perspective nothing of a plane is closer than the eye's height over it.
        above = 0.0 if camera.GetParallelProjection() else float(away @ unit_vectors(self.up))
        if above >= 0:
            near = max(min(near, 0.5 * above), _NEAREST * far)
        camera.SetClippingRange(near, far)
        self._planes = before, camera.GetClippingRange()

    def _narrow(self, renderer):
        """Have the near and far planes where they were, unless they were moved since."""
        camera = renderer.GetActiveCamera()
        if camera.GetClippingRange() == self._planes[1]:
            camera.SetClippingRange(*self._planes[0])

    def prepare(self, frame):
        """Set the colour that it fades into."""
        span = _FADE, max(_FADED * self.size, 2 * _FADE)
        uniforms = {
            'ibr_horizon': self.pipeline.horizon_color(frame),
            'ibr_fade': tuple(radius / self.size for radius in span),
        }
        set_fragment_uniforms(self.props, uniforms)
