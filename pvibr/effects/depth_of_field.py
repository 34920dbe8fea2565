"""Depth of field of a thin lens."""

from __future__ import annotations

from typing import Any

import numpy as np

from pvibr.core import _vtk
from pvibr.core.arguments import as_array
from pvibr.core.effect import Effect
from pvibr.core.params import Param
from pvibr.gl import Quad, Target, nbytes_of, release
from pvibr.gl.quad import quads_of
from pvibr.things.thing import Thing

_STAGES = ('', 'coc', 'near', 'far')
_TILE = 8  # half-size texels along a side, see depth_of_field.glsl
_MIN_SAMPLES = 8
_FOCAL_FRACTION = 0.1  # default focal length, as a fraction of the focus distance


class DepthOfField(Effect):
    """Depth of field of a thin lens, whose blur follows from aperture and focus.

    A point at the distance d has a circle of confusion of the radius
    ``radius * |d - focus| / focus`` in world units at its depth; all lengths are in units of the
    scene. There is one layer of depth: surfaces hidden behind a blurred edge are filled in from
    visible ones beside it, and translucent props and volumes are blurred like the surface behind
    them. Tiles of large screenshots repeat their border pixels.

    Parameters
    ----------
    target : None, array_like of shape (3,), actor, instances or figure, optional
        Focus target: a point in world units, or an actor or thing whose centre stays in focus;
        the camera's focal point by default. ``distance`` overrides it.
    **settings
        Values of the class's settings.

    Examples
    --------
    >>> import pyvista as pv
    >>> import pvibr
    >>> pl = pv.Plotter(off_screen=True)
    >>> actor = pl.add_mesh(pv.Sphere())
    >>> lens = pl.ibr.add(pvibr.DepthOfField(actor, f_number=1.4))
    >>> pl.show()
    """

    single = True
    neutral = 'radius', 0
    covers = True
    presets = {
        'subtle': {'f_number': 5.6},
        'strong': {'f_number': 1.2, 'limit': 0.1, 'samples': 96},
        'fast': {'samples': 16},
    }

    f_number = Param(2.8, 'Focal length over aperture diameter.', range='(0, inf)')
    focal_length = Param(
        None,
        'Focal length, for the aperture only; by default a tenth of the focus distance.',
        range='(0, inf)',
        unit='world',
        kind=float,
    )
    radius = Param(
        None,
        'Aperture radius in place of f_number and focal_length; 0 is a pinhole.',
        range='[0, inf)',
        unit='world',
        kind=float,
    )
    distance = Param(
        None,
        'Focus distance; by default that of `target`.',
        range='(0, inf)',
        unit='world',
        kind=float,
    )
    limit = Param(
        0.05,
        'Largest radius of the circle of confusion, as a fraction of the height; Accumulation has '
        'no such limit.',
        range='(0, 0.5]',
    )
    samples = Param(48, 'Most samples per pixel.', range=f'[{_MIN_SAMPLES}, 512]')
    needs_hdr = Param(False, 'Read colours above 1, for bright spots that keep their light.')
    debug = Param(
        '',
        'Intermediate stage to show: circles (coc) are red before, green behind the focus plane.',
        choices=_STAGES,
    )

    def __init__(self, target=None, **settings):
        self.target = target
        super().__init__(**settings)
        self._quads: dict[str, Quad] = {}
        self._targets: dict[str, Target] = {}
        self._size: tuple = ()

    @classmethod
    def sample(cls, actors):
        """Return an instance with a wide aperture."""
        return cls(distance=2, radius=0.2)

    @property
    def target(self) -> Any:
        """Focus target: None, a point, an actor or a thing."""
        return self._target

    @target.setter
    def target(self, target):
        is_point = target is not None and not isinstance(target, Thing | _vtk.vtkProp3D)
        self._target = _checked_point(target) if is_point else target

    def focus(self, frame) -> float:
        """Return the focus distance.

        Parameters
        ----------
        frame : pvibr.things.frame.Frame
            Frame with the camera.

        Returns
        -------
        float
            World units along the view direction; at least the near plane's.
        """
        if self.distance is not None:
            return self.distance
        target = self.target
        if target is None:
            target = frame.renderer.GetActiveCamera().GetFocalPoint()
        elif not isinstance(target, tuple):
            target = target.center if isinstance(target, Thing) else target.GetCenter()
        view_z = float(frame.view_from_world[2] @ [*target, 1.0])
        return max(-view_z, frame.near, 1e-12)

    def aperture(self, focus) -> float:
        """Return the aperture radius.

        Parameters
        ----------
        focus : float
            Focus distance in world units.

        Returns
        -------
        float
            World units.
        """
        if self.radius is not None:
            return self.radius
        return (self.focal_length or _FOCAL_FRACTION * focus) / (2 * self.f_number)

    def circles(self, frame) -> tuple[float, float]:
        """Return the radii of the circle of confusion at the near and the far plane.

        Between them the radius is linear in the depth buffer's value.

        Parameters
        ----------
        frame : pvibr.things.frame.Frame
            Frame with the camera.

        Returns
        -------
        tuple of 2 float
            Radii in pixels; negative before the focus plane.
        """
        focus_distance = self.focus(frame)
        # A sample sees through a part of the lens as wide as the gap between samples.
        lens_share = 1.0 if frame.sample is None else frame.sample.gap
        scale = lens_share * self.aperture(focus_distance) / focus_distance * frame.pixel_scale
        planes = np.array([frame.near, frame.far])
        circles = (planes - focus_distance) * scale / (1.0 if frame.parallel else planes)
        return float(circles[0]), float(circles[1])

    def lens_of(self, frame) -> tuple[float, float] | None:
        """Return aperture radius and focus distance, None where nothing is blurred."""
        if self.debug or self.needed(frame) is not True:
            return None
        focus_distance = self.focus(frame)
        return self.aperture(focus_distance), focus_distance

    def needed(self, frame) -> bool | str:
        """Return True if the effect must run."""
        if frame.sample is not None and not frame.sample.gap and not self.debug:
            return 'each sample has its own eye within the lens'
        if self.radius != 0 and max(map(abs, self.circles(frame))) <= 0.5 and not self.debug:
            return 'nothing is blurred by more than half a pixel'
        return super().needed(frame)

    def reach(self, frame) -> float:
        """Return the largest radius of the circle of confusion and of its tiles, in pixels."""
        return self.limit * frame.whole[1] + 4 * _TILE

    def render(self, frame, picture):
        """Blur the picture."""
        self._allocate(frame.window, picture.size)
        near_circle, far_circle = (c / 2 for c in self.circles(frame))
        circle_limit = max(self.limit * frame.whole[1] / 2, 0.5)
        lens_terms = (near_circle, far_circle - near_circle, circle_limit)
        scene_textures = {'color': picture.color, 'depth': picture.depth}
        half_picture, layers = self._targets['small'], self._targets['layers']
        circle, tiles = half_picture.colors[1], self._targets['spread'].colors[0]
        self._draw('reduce', 'small', {'lens': lens_terms}, scene_textures)
        self._draw('tile', 'tiles', {}, {'circle': circle})
        tile_reach = int(np.ceil(circle_limit / _TILE)) + 1
        self._draw(
            'spread', 'spread', {'reach': tile_reach}, {'tiles': self._targets['tiles'].colors[0]}
        )
        sample_count = max(_MIN_SAMPLES, round(self.samples * frame.quality))
        self._draw(
            'gather',
            'layers',
            {'samples': sample_count},
            {'color': half_picture.colors[0], 'circle': circle, 'tiles': tiles},
        )
        layer_textures = dict(zip(('behind', 'near', 'cover'), layers.colors, strict=True))
        with picture.drawing():
            self._quads['compose'].draw(
                {'lens': lens_terms, 'stage': _STAGES.index(self.debug)},
                scene_textures | {'circle': circle} | layer_textures,
            )

    def _draw(self, program_name, target_name, uniforms, textures):
        self._targets[target_name].draw(self._quads[program_name], uniforms, textures)

    def _allocate(self, window, size):
        if not self._quads:
            self._quads = quads_of(window, __file__)
        if self._size == size:
            return
        self._free_targets()
        half_size = [-(-s // 2) for s in size]
        tile_counts = [-(-s // _TILE) for s in half_size]
        self._targets = {
            'small': _target(window, half_size, ('rgba16f', 'rg32f'), 'nearest'),
            'tiles': _target(window, tile_counts, ('r32f',), 'nearest'),
            'spread': _target(window, tile_counts, ('r32f',), 'nearest'),
            'layers': _target(window, half_size, ('rgba16f', 'rgba16f', 'r32f'), 'linear'),
        }
        self._size = size

    def _free_targets(self):
        release(*self._targets.values())
        self._targets, self._size = {}, ()

    def release(self):
        """Free GPU memory; the context is current."""
        self._free_targets()
        release(*self._quads.values())
        self._quads = {}

    def state(self) -> dict:
        """Return the settings and a point in focus, but no actor."""
        is_point = isinstance(self.target, tuple)
        return super().state() | ({'target': list(self.target)} if is_point else {})

    def restore(self, state) -> list[str]:
        """Restore the settings and a point in focus: all or none."""
        old_target = self.target
        if 'target' in state:
            self.target = state['target']
        try:
            return super().restore({n: v for n, v in state.items() if n != 'target'})
        except (TypeError, ValueError):
            self.target = old_target
            raise

    def report(self) -> dict:
        """Return the bytes of GPU memory."""
        return {'bytes': nbytes_of(*self._targets.values())}


def _target(window, size, formats, filter) -> Target:
    return Target(window, size[0], size[1], formats, filter=filter)


def _checked_point(target) -> tuple:
    point = as_array('target', target)
    if point.shape != (3,) or point.dtype.kind not in 'iuf' or not np.isfinite(point).all():
        raise ValueError(
            f'target must be None, three finite numbers, an actor or a thing, got {target!r}'
        )
    return tuple(float(x) for x in point)
