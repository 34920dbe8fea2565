"""Depth of field of a thin lens."""

from __future__ import annotations

from typing import Any

import numpy as np

from pvibr.core import _vtk
from pvibr.core.effect import Effect
from pvibr.core.params import Param
from pvibr.gl import Quad, Target, nbytes_of, release
from pvibr.gl.quad import quads_of
from pvibr.maths.arguments import as_array
from pvibr.scene.thing import Thing

_STAGES = ('', 'coc', 'near', 'far')
_TILE = 8  # texels of half size along a side, see depth_of_field.glsl
_MIN_SAMPLES = 8
_FOCAL_FRACTION = 0.1  # default focal length over the focus distance


class DepthOfField(Effect):
    """Depth of field of a thin lens, whose blur follows from aperture and focus.

    A point at the distance d has a circle of confusion with the radius
    ``radius * |d - focus| / focus`` in world units at its depth, so that all lengths are in units
    of the scene. There is one layer of depth: surfaces hidden behind a blurred edge are filled in
    from the visible ones beside it, and translucent props and volumes are blurred like the
    surface behind them. Tiles of large screenshots repeat their border pixels.

    Parameters
    ----------
    target : None, array_like of shape (3,), actor, instances or figure, optional
        Focus target: a point in world units, or an actor or thing whose centre is followed; the
        camera's focal point by default. ``distance`` overrides it.
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
        'Focal length for the aperture only; by default a tenth of the focus distance.',
        range='(0, inf)',
        unit='world',
        kind=float,
    )
    radius = Param(
        None,
        'Aperture radius, in place of f-number and focal length; 0 is a pinhole.',
        range='[0, inf)',
        unit='world',
        kind=float,
    )
    distance = Param(
        None,
        'Focus distance; that of the target by default.',
        range='(0, inf)',
        unit='world',
        kind=float,
    )
    limit = Param(
        0.05,
        'Maximum radius of the circle of confusion, as a fraction of the height; samples of '
        'Accumulation have none.',
        range='(0, 0.5]',
    )
    samples = Param(48, 'Maximum number of samples per pixel.', range=f'[{_MIN_SAMPLES}, 512]')
    needs_hdr = Param(False, 'Use colours above 1.')
    debug = Param(
        '',
        'Intermediate stage to show; circles are red before, green behind the focus plane.',
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
        known = target is None or isinstance(target, Thing | _vtk.vtkProp3D)
        self._target = target if known else _point(target)

    def focus(self, frame) -> float:
        """Return the focus distance.

        Parameters
        ----------
        frame : pvibr.core.frame.Frame
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
        away = -float(frame.view_from_world[2, :3] @ target + frame.view_from_world[2, 3])
        return max(away, frame.near, 1e-12)

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

        Between them, the radius is linear in the value of the depth buffer.

        Parameters
        ----------
        frame : pvibr.core.frame.Frame
            Frame with the camera.

        Returns
        -------
        tuple of 2 float
            Radii in pixels; negative before the focus plane.
        """
        focus = self.focus(frame)
        # Samples see through parts of the lens, each as wide as they are apart.
        part = 1.0 if frame.sample is None else frame.sample.gap
        scale = part * self.aperture(focus) / focus * frame.pixel_scale
        near, far = (
            (d - focus) * scale / (1.0 if frame.parallel else d) for d in (frame.near, frame.far)
        )
        return near, far

    def lens_of(self, frame) -> tuple[float, float] | None:
        """Return aperture radius and focus distance, None where nothing is blurred."""
        if self.debug or self.needed(frame) is not True:
            return None
        focus = self.focus(frame)
        return self.aperture(focus), focus

    def needed(self, frame) -> bool | str:
        """Return True if the effect must run."""
        if frame.sample is not None and not frame.sample.gap and not self.debug:
            return 'each sample has an eye of its own within the lens'
        if self.radius != 0 and max(map(abs, self.circles(frame))) <= 0.5 and not self.debug:
            return 'nothing is out of focus by half a pixel'
        return super().needed(frame)

    def reach(self, frame) -> float:
        """Return the maximum radius of the circle of confusion and its tiles, in pixels."""
        return self.limit * frame.whole[1] + 4 * _TILE

    def render(self, frame, picture):
        """Blur the picture."""
        self._allocate(frame.window, picture.size)
        near, far = (c / 2 for c in self.circles(frame))
        most = max(self.limit * frame.whole[1] / 2, 0.5)
        lens = (near, far - near, most)
        scene = {'color': picture.color, 'depth': picture.depth}
        small, layers = self._targets['small'], self._targets['layers']
        circle, tiles = small.colors[1], self._targets['spread'].colors[0]
        self._draw('reduce', 'small', {'lens': lens}, scene)
        self._draw('tile', 'tiles', {}, {'circle': circle})
        reach = int(np.ceil(most / _TILE)) + 1
        self._draw(
            'spread', 'spread', {'reach': reach}, {'tiles': self._targets['tiles'].colors[0]}
        )
        samples = max(_MIN_SAMPLES, round(self.samples * frame.quality))
        self._draw(
            'gather',
            'layers',
            {'samples': samples},
            {'color': small.colors[0], 'circle': circle, 'tiles': tiles},
        )
        found = dict(zip(('behind', 'near', 'cover'), layers.colors, strict=True))
        with picture.drawing():
            self._quads['compose'].draw(
                {'lens': lens, 'stage': _STAGES.index(self.debug)},
                scene | {'circle': circle} | found,
            )

    def _draw(self, name, target, uniforms, textures):
        self._targets[target].draw(self._quads[name], uniforms, textures)

    def _allocate(self, window, size):
        if not self._quads:
            self._quads = quads_of(window, __file__)
        if self._size == size:
            return
        self._free()
        half = [-(-s // 2) for s in size]
        tile = [-(-s // _TILE) for s in half]
        whole = 'rgba16f'
        self._targets = {
            'small': _target(window, half, (whole, 'rg32f'), 'nearest'),
            'tiles': _target(window, tile, ('r32f',), 'nearest'),
            'spread': _target(window, tile, ('r32f',), 'nearest'),
            'layers': _target(window, half, (whole, whole, 'r32f'), 'linear'),
        }
        self._size = size

    def _free(self):
        release(*self._targets.values())
        self._targets, self._size = {}, ()

    def release(self):
        """Free GPU memory; the context is current."""
        self._free()
        release(*self._quads.values())
        self._quads = {}

    def state(self) -> dict:
        """Return the settings and a point in focus; an actor is left out."""
        is_point = isinstance(self.target, tuple)
        return super().state() | ({'target': list(self.target)} if is_point else {})

    def restore(self, state) -> list[str]:
        """Restore the settings and a point in focus; all of them or none."""
        old = self.target
        if 'target' in state:
            self.target = state['target']
        try:
            return super().restore({n: v for n, v in state.items() if n != 'target'})
        except (TypeError, ValueError):
            self.target = old
            raise

    def report(self) -> dict:
        """Return the bytes of GPU memory."""
        return {'bytes': nbytes_of(*self._targets.values())}


def _target(window, size, formats, filter) -> Target:
    return Target(window, size[0], size[1], formats, filter=filter)


def _point(target) -> tuple:
    point = as_array('target', target)
    if point.shape != (3,) or point.dtype.kind not in 'iuf' or not np.isfinite(point).all():
        raise ValueError(
            f'target = {target!r}: must be None, three finite numbers, an actor or a thing'
        )
    return tuple(float(x) for x in point)
