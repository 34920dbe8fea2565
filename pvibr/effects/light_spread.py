"""Light that spreads over a picture: the base of bloom and glow."""

from __future__ import annotations

import math

from pvibr.core import _vtk
from pvibr.core._vtk import address
from pvibr.core.effect import Effect
from pvibr.core.params import Param
from pvibr.gl import release, texture_limit
from pvibr.gl.blur import CHAINS, Blur, Light, variances
from pvibr.gl.scene_pass import is_marker

_ROWS = 720  # of the picture that `downsample` is about
_NARROWEST = 0.79  # of a kernel's width
_ENDS = 1 / 12 + 4 / 6  # variance of a texel, and of what is between texels of half the size


class LightSpread(Effect):
    """Light blurred by a pyramid; a subclass draws it with `_draw_source`, freed by `_forget`.

    Tiles of a screenshot larger than the window use the light of the last whole frame. If the
    camera, the scene or the time changed since, each tile has only its own light.

    Parameters
    ----------
    **settings
        Values of the class's settings.
    """

    neutral = 'intensity', 0
    covers = True

    intensity = Param(1.0, 'Factor of the added light.', range='[0, inf)')
    downsample = Param(
        8,
        'Texel of the finest blur, as pixels of a picture of 720 rows; smaller is sharper.',
        choices=(4, 8, 16),
    )
    chain = Param(
        'gaussian',
        'Separable Gaussians, or the faster filters of fixed width by Jimenez, SIGGRAPH 2014.',
        choices=CHAINS,
    )
    kernel = Param(5, 'Size of each Gaussian kernel.', choices=tuple(range(3, 33, 2)), unit='px')
    levels = Param(
        None,
        'Number of blurs, each at half the resolution; as wide at any `downsample` by default.',
        kind=int,
        range='[1, 10]',
    )
    spread = Param(0.5, 'Weight of wide blurs against narrow ones.', range='[0, 1]')
    blend = Param('add', 'Blend mode of the light.', choices=('add', 'screen'))
    debug = Param('', 'Intermediate stage to show.', choices=('', 'bright', 'blur'))

    _blur: Blur | None = None
    _window: object = None
    _light: Light | None = None
    _seen: tuple = ()
    _asked = -1, False
    _side = 1.0

    def __init__(self, **settings):
        self._drawn_at = _vtk.vtkTimeStamp()
        super().__init__(**settings)

    def render(self, frame, picture):
        """Add the light to the picture."""
        tile = None
        if self._is_part(frame):
            left, bottom = frame.tile[:2]
            tile = frame.scale, (left * frame.whole[0], bottom * frame.whole[1])
        else:
            self._light = self._spread_light(frame, picture)
            self._seen = (frame, *self._marks()) if frame.scale == 1 else ()
            self._drawn_at.Modified()
        if self._blur is not None and self._light is not None:
            self._blur.blend(
                picture,
                self._light,
                tile=tile,
                intensity=1.0 if self.debug else self.intensity,
                screen=self.blend == 'screen',
                alone=bool(self.debug),
            )

    def _is_part(self, frame):
        """Return True if a frame is a tile of a picture whose light is known."""
        if frame.scale == 1:
            return False
        if self._asked[0] != frame.index:  # once: all hooks of a frame must agree
            same = bool(self._seen) and (
                self._seen[1:] == self._marks() and _sight(self._seen[0]) == _sight(frame)
            )
            self._asked = (
                frame.index,
                same and not _changed(frame.renderer, self._things, self._drawn_at),
            )
        return self._asked[1]

    @property
    def _things(self):
        return self.pipeline.things if self.pipeline else ()

    def _marks(self):
        """Return a key of the settings and of what things draw."""
        return self.revision, [thing.content_key() for thing in self._things]

    def _spread_light(self, frame, picture):
        """Return the light of a picture, None if there is none."""
        # A tile of a picture that was not drawn whole has only its own light.
        # A picture of a few rows has wider texels: no driver has textures of so many.
        width = 1.0
        side = max(frame.whole[1] / self._rows, max(frame.whole) / texture_limit(frame.window))
        if frame.scale == 1:
            side, width = self._fitted(side, picture.size)
        blur = self._ready(frame, picture.size, side, width)
        self._draw_source(frame, picture, blur.source, side)
        lit = blur.lit()
        if self.debug == 'bright':
            return Light(blur.source.colors[0], side, (0, 0, *picture.size))
        if lit is None:
            return Light(blur.source.colors[0], side, (0,) * 4) if self.debug else None
        reach = blur.reach
        box = [side * b for b in (lit[0] - reach, lit[1] - reach, lit[2] + reach, lit[3] + reach)]
        return Light(blur.draw(blur.source.colors[0], self.spread), 2 * side, tuple(box))

    def _draw_source(self, frame, picture, target, side):
        raise NotImplementedError

    @property
    def _rows(self) -> float:
        """Rows of the image of the light: as many in a window of any size."""
        return 2 * _ROWS / self.downsample

    def _fitted(self, side, size):
        """Return a whole number of pixels near a side, and by how much to widen kernels for it."""
        # A picture of whole texels is averaged in two thirds of the time.
        for pixels in (math.floor(side), math.ceil(side)):
            near = pixels and _NARROWEST < side / pixels < 1 / _NARROWEST
            if self.chain == 'gaussian' and near and not any(n % pixels for n in size):
                halving, doubling = variances(self._levels(), self.kernel, self.chain)
                ratio = (side / pixels) ** 2
                return pixels, math.sqrt(ratio + (ratio - 1) * (doubling + _ENDS) / halving)
        return side, 1.0

    def _ready(self, frame, size, side, width=1.0):
        extent = size[0] / side, size[1] / side
        key = extent, self._levels(), self.kernel, self.chain, width
        window = frame.window
        if self._blur is not None and (self._window is not window or self._blur.key != key):
            self._forget_blur()
        if self._blur is None:
            self._blur, self._window = Blur(window, *key), window
        self._side = side
        return self._blur

    def _levels(self):
        """Return the levels after which about twenty rows are left."""
        if self.levels is not None:
            return self.levels
        return max(1, 1 + round(math.log2(self._rows / 40)))

    def _forget(self):
        """Free GPU memory of `_draw_source`."""

    def release(self):
        """Free GPU memory; the context is current."""
        self._forget()
        self._forget_blur()

    @property
    def blur_sigma(self) -> float:
        """Standard deviation of the widest blur of the last frame in pixels, NaN before it."""
        if self._blur is None:
            return math.nan
        side = self._side
        pixel = min(side**2, 1) / 12
        return side * math.sqrt(self._blur.sigma**2 + _ENDS - pixel / side**2)

    def _forget_blur(self):
        release(self._blur)
        self._blur = self._light = None
        self._seen = ()

    def report(self) -> dict:
        """Return the bytes of GPU memory, and why no light was drawn."""
        if self._blur is None:
            return {'bytes': 0}
        details = {'bytes': self._blur.nbytes}
        return details if self._light else details | {'skipped': 'there is no light to spread'}


def _sight(frame):
    """Return a key that a whole frame shares with its tiles."""
    left, bottom, right, top = frame.tile
    across = frame.clip_from_view[0, 0] * (right - left)
    up = frame.clip_from_view[1, 1] * (top - bottom)
    return (
        frame.view_from_world.tobytes(),
        f'{across:.6g} {up:.6g}',
        tuple(round(side / frame.scale) for side in frame.whole),
        frame.time,
    )


def _changed(renderer, things, when) -> bool:
    """Return True if the scene changed since; what things choose by camera does not count."""
    chosen = {address(prop) for t in things for prop in (*t.props, *t.actors())}
    since = when.GetMTime()
    return any(light.GetMTime() > since for light in renderer.GetLights()) or any(
        prop.GetRedrawMTime() > since
        for prop in renderer.GetViewProps()
        if prop.IsA('vtkProp3D') and address(prop) not in chosen and not is_marker(prop)
    )
