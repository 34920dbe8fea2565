"""Bloom: light of bright parts spreads over their surroundings."""

from __future__ import annotations

import math

from pvibr.core.params import Param
from pvibr.effects.light_spread import LightSpread
from pvibr.gl import Quad, release, shader_source
from pvibr.gl.feature import sections
from pvibr.gl.texture import filtered
from pvibr.maths.tones import to_display, to_light

_OPERATORS = ('subtract', 'keep', 'soft')


class Bloom(LightSpread):
    """Light from bright parts of the picture spreads over their surroundings.

    The bright pass extracts light above a threshold at reduced resolution; a chain of Gaussian
    blurs on ever smaller images spreads it, and the result is added to the picture. The blur
    conserves energy: the added light sums up to `intensity` times that of the bright pass. Its
    width is a fraction of the height, the same in a window of any size. Brightness is the
    luminance of a pixel (Rec. 709); its light keeps its hue. Pixels out of reach of any light
    keep their colour exactly.

    By default light above 1 spreads: highlights, bright lamps, a bright :class:`pvibr.Sky`.
    Colours of data are below and do not bloom. A lower `threshold` lets them;
    :class:`pvibr.Glow` makes chosen objects shine, whatever their colours.

    If a :class:`pvibr.ToneMapping` exposes the picture, `threshold` and `knee` apply to exposed
    colours.

    Parameters
    ----------
    threshold : float, optional
        Luminance above which light spreads; by default that of white, which spares colours of
        data.
    **settings
        Values of the class's settings.

    Examples
    --------
    >>> import pyvista as pv
    >>> import pvibr
    >>> pl = pv.Plotter(off_screen=True)
    >>> _ = pl.add_mesh(pv.Sphere(), color='white')
    >>> bloom = pl.ibr.add(pvibr.Bloom(0.9, intensity=0.4))
    >>> bloom.operator
    'soft'
    """

    single = True
    reads_depth = False
    presets = {
        'subtle': {'intensity': 0.4, 'spread': 0.3},
        'strong': {'threshold': 0.5, 'intensity': 2.0, 'spread': 0.8},
    }
    threshold = Param(1.0, 'Luminance above which light spreads.', range='[0, inf)')
    operator = Param(
        'soft',
        "Bright pass of a luminance S above the threshold T: 'subtract' S - T; 'keep' S, which "
        "may flicker in motion; 'soft' S times a smooth step.",
        choices=_OPERATORS,
    )
    firefly_reduction = Param(
        0.0,
        'Attenuation of isolated bright pixels, which flicker in motion; 1 is the partial Karis '
        'average.',
        range='[0, 1]',
    )
    knee = Param(0.2, 'Width of the smooth step above the threshold.', range='(0, inf)')
    saturation = Param(1.0, 'Saturation of the light; 0 is white.', range='[0, 1]')
    background = Param(False, 'Whether a plain background blooms as well.')
    needs_hdr = Param(True, 'Read colours above 1: highlights brighter than white.')

    _bright_quad: Quad | None = None
    _bright_key: tuple = ()

    def __init__(self, threshold=threshold.default, **settings):
        super().__init__(threshold=threshold, **settings)

    @classmethod
    def sample(cls, actors):
        """Return an instance with a low threshold."""
        return cls(threshold=0.2)

    def _draw_source(self, frame, picture, target, texel_size):
        stops, metered = 0.0, None
        if self.pipeline is not None:
            stops, metered = self.pipeline.exposure(frame, picture)
        quad = self._bright_pass(frame.window, picture, texel_size, metered is not None)
        uniforms = {
            'picture_size': picture.size,
            'texel_size': float(texel_size),
            'limits': self.limits(stops),
            'background': float(self.background),
            'saturation': self.saturation,
            'firefly_reduction': self.firefly_reduction,
        }
        color = picture.color
        with filtered(color, 'nearest'):
            textures = {'color': color} | ({} if metered is None else {'metered': metered})
            target.draw(quad, uniforms, textures)

    def choices(self) -> dict[str, int]:
        """Return the defines of the bright pass that depend on settings."""
        fireflies = int(self.firefly_reduction > 0)
        return {'OPERATOR': _OPERATORS.index(self.operator), 'FIREFLIES': fireflies}

    def limits(self, stops):
        """Return the threshold and both ends of the smooth step, before exposure as set."""
        display_limits = self.threshold, self.threshold, self.threshold + self.knee
        if stops == 0:
            return display_limits
        return tuple(to_display(to_light(display_limits) * 2.0**-stops).tolist())

    def _bright_pass(self, window, picture, texel_size, is_metered):
        is_whole = float(texel_size).is_integer() and not any(n % texel_size for n in picture.size)
        defines = {
            **self.choices(),
            'FLOATS': int(picture.color.is_float),
            'TAPS': math.ceil(texel_size) + (not is_whole),
            'WHOLE': int(is_whole),
            'METERED': int(is_metered),
        }
        key = window, defines
        if self._bright_quad is None or self._bright_key != key:
            self._forget()
            quad = Quad(window, bright_text(defines), 'bloom bright')
            self._bright_quad, self._bright_key = quad, key
        return self._bright_quad

    def _forget(self):
        release(self._bright_quad)
        self._bright_quad, self._bright_key = None, ()


def bright_text(defines) -> str:
    """Return the source of the bright pass."""
    lines = ''.join(f'#define {name} {value}\n' for name, value in defines.items())
    light = sections(shader_source(__file__, 'tone_mapping'))['light']
    return lines + light + sections(shader_source(__file__))['bright']
