"""Light that spreads over a picture: the base of `Bloom` and `Glow`."""

from __future__ import annotations

import math

import numpy as np

from pvibr.core import _vtk
from pvibr.core._vtk import address
from pvibr.core.effect import Effect
from pvibr.core.params import Param
from pvibr.gl import release, texture_limit
from pvibr.gl.blur import CHAINS, Blur, Light, variances
from pvibr.gl.scene_pass import is_marker

_ROWS = 720  # height of the picture to which `downsample` refers
_NARROWEST = 0.79  # least factor of a kernel's width
_ENDS = 1 / 12 + 4 / 6  # variance of a texel, and of interpolation between half-size texels


class LightSpread(Effect):
    """Light blurred by a pyramid; subclasses draw it in `_draw_source` and free it in `_forget`.

    Tiles of a screenshot larger than the window reuse the light of the last whole frame. If the
    camera, the scene or the time changed since, each tile spreads its own light only.

    Parameters
    ----------
    **settings
        Values of the class's settings.
    """

    neutral = 'intensity', 0
    covers = True

    intensity = Param(1.0, 'Amount of the light that is added.', range='[0, inf)')
    downsample = Param(
        8,
        'Texel of the finest blur, in pixels of a 720-row picture; smaller is sharper and slower.',
        choices=(4, 8, 16),
    )
    chain = Param(
        'gaussian',
        'Separable Gaussians, or the faster fixed-width filters of Jimenez, SIGGRAPH 2014.',
        choices=CHAINS,
    )
    kernel = Param(5, 'Size of each Gaussian kernel.', choices=tuple(range(3, 33, 2)), unit='px')
    levels = Param(
        None,
        'Number of blurs, each at half the resolution of the last; by default about twenty rows '
        'remain, at any `downsample`.',
        kind=int,
        range='[1, 10]',
    )
    spread = Param(0.5, 'Weight of wide blurs; 0 is a tight halo.', range='[0, 1]')
    blend = Param('add', 'Blend mode; screen never exceeds white.', choices=('add', 'screen'))
    debug = Param('', 'Intermediate stage to show.', choices=('', 'bright', 'blur'))

    _blur: Blur | None = None
    _window: object = None
    _light: Light | None = None
    _last_whole: tuple = ()
    _reuse_answer = -1, False
    _texel_size = 1.0

    def __init__(self, **settings):
        self._drawn_at = _vtk.vtkTimeStamp()
        super().__init__(**settings)

    def render(self, frame, picture):
        """Add the light to the picture."""
        tile_place = None
        if self._reuses_light(frame):
            tile_place = frame.scale, tuple(np.multiply(frame.tile[:2], frame.whole).tolist())
        else:
            self._light = self._spread_light(frame, picture)
            self._last_whole = (frame, *self._content_marks()) if frame.scale == 1 else ()
            if self.pipeline is not None:  # updates them before the mark
                self.pipeline.surfaces.plain_actors.version()
            self._drawn_at.Modified()
        if self._blur is not None and self._light is not None:
            self._blur.blend(
                picture,
                self._light,
                tile=tile_place,
                intensity=1.0 if self.debug else self.intensity,
                screen=self.blend == 'screen',
                alone=bool(self.debug),
            )

    def _reuses_light(self, frame):
        """Return True if a frame is a tile of the picture whose light was spread last."""
        if frame.scale == 1:
            return False
        if self._reuse_answer[0] != frame.index:  # all hooks of a frame must agree
            is_same_view = bool(self._last_whole) and (
                self._last_whole[1:] == self._content_marks()
                and _sight(self._last_whole[0]) == _sight(frame)
            )
            self._reuse_answer = (
                frame.index,
                is_same_view and not _changed(self.pipeline, self._things, self._drawn_at),
            )
        return self._reuse_answer[1]

    @property
    def _things(self):
        return self.pipeline.things if self.pipeline else ()

    def _content_marks(self):
        """Return a key of the settings and of the content of things."""
        return self.revision, [thing.content_key() for thing in self._things]

    def _spread_light(self, frame, picture):
        """Return the light of a picture, None if there is none."""
        # Very wide pictures get larger texels: textures are limited in size.
        kernel_scale = 1.0
        smallest = max(frame.whole) / texture_limit(frame.window)
        texel_size = max(frame.whole[1] / self.light_rows, smallest)
        if frame.scale == 1:
            texel_size, kernel_scale = self._whole_texels(texel_size, picture.size)
        blur = self._ready_blur(frame, picture.size, texel_size, kernel_scale)
        self._draw_source(frame, picture, blur.source, texel_size)
        lit_texels = blur.lit()
        if self.debug == 'bright':
            return Light(blur.source.colors[0], texel_size, (0, 0, *picture.size))
        if lit_texels is None:
            return Light(blur.source.colors[0], texel_size, (0,) * 4) if self.debug else None
        grown = np.add(lit_texels, blur.reach * np.array([-1, -1, 1, 1]))
        lit_box = tuple((texel_size * grown).tolist())
        return Light(blur.draw(blur.source.colors[0], self.spread), 2 * texel_size, lit_box)

    def _draw_source(self, frame, picture, target, texel_size):
        raise NotImplementedError

    @property
    def light_rows(self) -> float:
        """Rows of the light's image, the same in a window of any size."""
        return 2 * _ROWS / self.downsample

    def _whole_texels(self, texel_size, size):
        """Return a whole number of pixels near a texel's size, and the kernel scale for it."""
        # Averaging whole pixels takes two thirds of the time.
        for whole_pixels in (math.floor(texel_size), math.ceil(texel_size)):
            is_near = whole_pixels and _NARROWEST < texel_size / whole_pixels < 1 / _NARROWEST
            if self.chain == 'gaussian' and is_near and not any(n % whole_pixels for n in size):
                halving, doubling = variances(self.level_count(), self.kernel, self.chain)
                variance_ratio = (texel_size / whole_pixels) ** 2
                excess = (variance_ratio - 1) * (doubling + _ENDS) / halving
                return whole_pixels, math.sqrt(variance_ratio + excess)
        return texel_size, 1.0

    def _ready_blur(self, frame, size, texel_size, kernel_scale=1.0):
        texel_counts = size[0] / texel_size, size[1] / texel_size
        blur_key = texel_counts, self.level_count(), self.kernel, self.chain, kernel_scale
        window = frame.window
        if self._blur is not None and (self._window is not window or self._blur.key != blur_key):
            self._forget_blur()
        if self._blur is None:
            self._blur, self._window = Blur(window, *blur_key), window
        self._texel_size = texel_size
        return self._blur

    def level_count(self) -> int:
        """Return the number of blurs, after which about twenty rows remain."""
        if self.levels is not None:
            return self.levels
        return max(1, 1 + round(math.log2(self.light_rows / 40)))

    def _forget(self):
        """Free GPU memory of `_draw_source`."""

    def release(self):
        """Free GPU memory; the context is current."""
        self._forget()
        self._forget_blur()

    @property
    def blur_sigma(self) -> float:
        """Standard deviation of the widest blur in the last frame, in pixels; NaN before."""
        if self._blur is None:
            return math.nan
        texel_size = self._texel_size
        pixel_variance = min(texel_size**2, 1) / 12
        return texel_size * math.sqrt(self._blur.sigma**2 + _ENDS - pixel_variance / texel_size**2)

    def _forget_blur(self):
        release(self._blur)
        self._blur = self._light = None
        self._last_whole = ()

    def report(self) -> dict:
        """Return GPU memory in bytes, and why no light was drawn."""
        if self._blur is None:
            return {'bytes': 0}
        details = {'bytes': self._blur.nbytes}
        return details if self._light else details | {'skipped': 'there is no light to spread'}


def _sight(frame):
    """Return a key of the view that a whole frame shares with its tiles."""
    tile_size = np.subtract(frame.tile[2:], frame.tile[:2])
    x_scale, y_scale = np.diag(frame.clip_from_view)[:2] * tile_size
    return (
        frame.view_from_world.tobytes(),
        f'{x_scale:.6g} {y_scale:.6g}',
        tuple(round(side / frame.scale) for side in frame.whole),
        frame.time,
    )


def _changed(pipeline, things, time_stamp) -> bool:
    """Return True if the scene changed since; choices that things make by camera do not count."""
    thing_props = {address(prop) for t in things for prop in (*t.props, *t.actors())}
    spread_time, renderer = time_stamp.GetMTime(), pipeline.renderer
    return any(light.GetMTime() > spread_time for light in renderer.GetLights()) or any(
        prop.GetRedrawMTime() > spread_time
        for prop in pipeline.surfaces.plain_actors.of_all(renderer.GetViewProps())
        if address(prop) not in thing_props and not is_marker(prop)
    )
