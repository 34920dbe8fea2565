"""A lens as wide as a real one: sharp at one distance, soft before and behind it."""

from __future__ import annotations

from typing import Any

import numpy as np

from pvibr.core import _vtk
from pvibr.core.effect import Effect
from pvibr.core.params import Param
from pvibr.gl import Quad, Target, shader_source
from pvibr.gl.feature import sections
from pvibr.scene.thing import Thing

_STAGES = ('', 'coc', 'near', 'far')
_TILE = 8  # texels of half size along a side, see depth_of_field.glsl
#: The focal length that none was given for, as a share of the distance in focus.
_LEAST = 8  # looks
_SHARE = 0.1


class DepthOfField(Effect):
    """The blur of a thin lens: its size follows from aperture and focus, as in a camera.

    A point at the distance d is spread over a circle whose radius is
    ``radius * |d - focus| / focus`` world units where it lies, so that every length follows the
    scene's own unit. What one layer of depth cannot tell is made up: what is hidden behind a
    blurred edge is that which is seen beside it. Translucent props and volumes are blurred like
    the surface behind them. A screenshot larger than the window is drawn in tiles: beside their
    borders what lies beyond them is not known, and their outermost pixels stand for it.

    Parameters
    ----------
    target : None, array_like of shape (3,), actor, instances or figure, optional
        What is in focus: a point in world units, or the middle of an actor or thing wherever it
        goes; by default the camera's focal point. ``distance`` goes before it.
    **settings
        See the class's Params.

    Examples
    --------
    >>> import pyvista as pv
    >>> import pvibr
    >>> pl = pv.Plotter(off_screen=True)
    >>> actor = pl.add_mesh(pv.Sphere())
    >>> lens = pl.ibr.add(pvibr.DepthOfField(actor, f_number=1.4))
    >>> pl.show()
    """

    f_number = Param(
        2.8, 'Focal length over the width of the opening: less is more blur.', range='(0, inf)'
    )
    focal_length = Param(
        None,
        'Of the lens, which with the f-number tells how wide it opens; by default a tenth '
        "of the distance in focus. The angle of view is the camera's own.",
        range='(0, inf)',
        unit='world',
        kind=float,
    )
    radius = Param(
        None,
        'Of the opening, in place of f-number and focal length; 0 is a pinhole and no blur.',
        range='[0, inf)',
        unit='world',
        kind=float,
    )
    distance = Param(
        None,
        'From the camera to the plane in focus; by default that of the target.',
        range='(0, inf)',
        unit='world',
        kind=float,
    )
    limit = Param(
        0.05,
        'Largest radius of a circle as a share of the height of the picture: looks that are '
        'too far apart make large circles coarse.',
        range='(0, 0.5]',
    )
    samples = Param(
        48,
        'Most looks around each pixel, in large circles: more is smoother and slower.',
        range=f'[{_LEAST}, 512]',
    )
    needs_hdr = Param(False, 'See colours above 1, which multisampling does not go with.')
    debug = Param(
        '',
        'Show the circles (red before, green behind the plane in focus) or one layer.',
        choices=_STAGES,
    )

    def __init__(self, target=None, **settings):
        self.target = target
        super().__init__(**settings)
        self._quads: dict[str, Quad] = {}
        self._targets: dict[str, Target] = {}
        self._size: tuple = ()

    @property
    def target(self) -> Any:
        """What is in focus: None, a point, an actor or a thing."""
        return self._target

    @target.setter
    def target(self, target):
        known = target is None or isinstance(target, Thing | _vtk.vtkProp3D)
        self._target = target if known else _point(target)

    def focus(self, frame) -> float:
        """Return the distance of the plane in focus.

        Parameters
        ----------
        frame : pvibr.core.frame.Frame
            Whose camera looks.

        Returns
        -------
        float
            World units along the view; never before the near plane.
        """
        if self.distance is not None:
            return self.distance
        target: Any = self.target
        if target is None:
            target = frame.renderer.GetActiveCamera().GetFocalPoint()
        elif not isinstance(target, tuple):
            target = target.center if isinstance(target, Thing) else target.GetCenter()
        away = -float(frame.view_from_world[2, :3] @ target + frame.view_from_world[2, 3])
        return max(away, frame.near, 1e-12)

    def opening(self, focus) -> float:
        """Return the radius of the opening.

        Parameters
        ----------
        focus : float
            Distance of the plane in focus, world units.

        Returns
        -------
        float
            World units.
        """
        if self.radius is not None:
            return self.radius
        return (self.focal_length or _SHARE * focus) / (2 * self.f_number)

    def circles(self, frame) -> tuple[float, float]:
        """Return the circle of confusion at the near plane and at the far plane.

        Between them it is linear in the value of the depth buffer.

        Parameters
        ----------
        frame : pvibr.core.frame.Frame
            Whose camera looks.

        Returns
        -------
        tuple of 2 float
            Radii in pixels; below 0 before the plane in focus.
        """
        focus = self.focus(frame)
        scale = self.opening(focus) / focus * frame.pixel_scale
        near, far = (
            (d - focus) * scale / (1.0 if frame.parallel else d) for d in (frame.near, frame.far)
        )
        return near, far

    def needed(self, frame) -> bool | str:
        """Tell whether anything may be out of focus."""
        if self.radius == 0:
            return 'radius is 0'
        sharp = max(map(abs, self.circles(frame))) <= 0.5 and not self.debug
        return 'nothing is out of focus by half a pixel' if sharp else True

    def reach(self, frame) -> float:
        """Return the radius of the largest circle of confusion, and of its tiles, in pixels."""
        return self.limit * frame.whole[1] + 4 * _TILE

    def render(self, frame, picture):
        """Draw the picture as the lens sees it."""
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
        samples = max(_LEAST, round(self.samples * frame.quality))
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
            entries = sections(shader_source(__file__))
            self._quads = {n: Quad(window, t, f'DepthOfField {n}') for n, t in entries.items()}
        if self._size == size:
            return
        self._free()
        half = [-(-s // 2) for s in size]
        tile = [-(-s // _TILE) for s in half]
        whole = 'rgba16f'
        self._targets = {
            'small': _target(window, half, (whole, 'r32f'), 'nearest'),
            'tiles': _target(window, tile, ('r32f',), 'nearest'),
            'spread': _target(window, tile, ('r32f',), 'nearest'),
            'layers': _target(window, half, (whole, whole, 'r32f'), 'linear'),
        }
        self._size = size

    def _free(self):
        for target in self._targets.values():
            target.release()
        self._targets, self._size = {}, ()

    def release(self):
        """Free what it holds on the GPU; the context is current."""
        self._free()
        for quad in self._quads.values():
            quad.release()
        self._quads = {}

    def state(self) -> dict:
        """Return the settings, and the point in focus; an actor is no value, and left out."""
        is_point = isinstance(self.target, tuple)
        return super().state() | ({'target': list(self.target)} if is_point else {})

    def restore(self, state) -> list[str]:
        """Set the settings to what `state` returned; all of them or none."""
        old = self.target
        if 'target' in state:
            self.target = state['target']
        try:
            return super().restore({n: v for n, v in state.items() if n != 'target'})
        except (TypeError, ValueError):
            self.target = old
            raise

    def report(self) -> dict:
        """Return the bytes that it holds."""
        return {'bytes': sum(t.nbytes for t in self._targets.values())}


def _target(window, size, formats, filter) -> Target:
    return Target(window, size[0], size[1], formats, filter=filter)


def _point(target) -> tuple:
    point = np.asarray(target)
    if point.shape != (3,) or point.dtype.kind not in 'iuf' or not np.isfinite(point).all():
        msg = f'target = {target!r}: must be None, three finite numbers, an actor or a thing'
        raise ValueError(msg)
    return tuple(float(x) for x in point)
