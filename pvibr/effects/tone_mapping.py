"""Exposure and tone curves: map scene light to display colours."""

from __future__ import annotations

from functools import cache

from pvibr.core.effect import Effect
from pvibr.core.params import Param
from pvibr.effects.auto_exposure import AutoExposure
from pvibr.gl import Texture, nbytes_of, release, shader_source
from pvibr.gl.feature import sections
from pvibr.gl.fused import Pointwise
from pvibr.maths.tones import CURVES

_TEXTS = sections(shader_source(__file__))


class ToneMapping(Effect):
    """Exposure, and a tone curve that maps light above 1 to the range of the display.

    The default curve leaves colours in [0, 1] unchanged, so they can still be read as data; the
    others change every colour. The curves are those of :func:`pvibr.maths.tones.tone_map`.

    Automatic exposure brings the log-average luminance of the whole picture, background
    included, to middle grey (0.18); `exposure` is added. The picture is metered before bloom. The
    exposure follows ``pl.ibr.time`` with the time constant `adaptation`, independent of the frame
    rate; if time stands still or goes back, it adapts at once. Tiles of large screenshots use the
    exposure of the last frame.

    Parameters
    ----------
    curve : {'faithful', 'reinhard', 'aces', 'agx', 'neutral'}, optional
        Tone curve; only faithful leaves colours in [0, 1] unchanged.
    **settings
        `exposure`, `auto`, `adaptation`, `min_exposure`, `max_exposure`, `white`,
        `intensity`.

    Examples
    --------
    >>> import pyvista as pv
    >>> from pvibr import ToneMapping
    >>> pl = pv.Plotter(off_screen=True)
    >>> _ = pl.add_mesh(pv.Sphere(), color='white')
    >>> tone = pl.ibr.add(ToneMapping('aces', exposure=0.5))
    >>> pl.show()
    """

    single = True
    reads_depth = False
    needs_hdr = True
    neutral = 'intensity', 0
    presets = {
        'film': {'curve': 'aces'},
        'neutral': {'curve': 'neutral'},
        'eye': {'curve': 'agx', 'auto': True},
    }

    curve = Param(
        'faithful', 'Tone curve; only faithful leaves colours of data unchanged.', choices=CURVES
    )
    exposure = Param(0.0, 'Exposure; one stop doubles the light.', range='[-32, 32]', unit='stops')
    auto = Param(False, 'Automatic exposure, from the luminance of the picture.')
    adaptation = Param(1.0, 'Time constant of automatic exposure.', range='[0, inf)', unit='s')
    min_exposure = Param(-6.0, 'Least automatic exposure.', range='[-32, 32]', unit='stops')
    max_exposure = Param(6.0, 'Largest automatic exposure.', range='[-32, 32]', unit='stops')
    white = Param(4.0, 'Luminance that the reinhard curve maps to white.', range='(0, inf)')
    intensity = Param(1.0, 'Opacity of the mapped picture.', range='[0, 1]')

    def __init__(self, curve=curve.default, **settings):
        self._auto_exposure: AutoExposure | None = None
        self._metered_frame: int | None = None
        super().__init__(curve=curve, **settings)

    @classmethod
    def sample(cls, actors):
        """Return an instance that changes every colour."""
        return cls(exposure=2, curve='aces')

    @property
    def stops(self) -> float:
        """Exposure of the last frame in stops, automatic exposure included."""
        metered_stops = 0.0
        if self.auto and self._auto_exposure is not None:
            metered_stops = self._auto_exposure.stops
        return self.exposure + metered_stops

    @property
    def metered(self) -> Texture | None:
        """A texel with the stops of automatic exposure, None without."""
        if not self.auto or self._auto_exposure is None:
            return None
        return self._auto_exposure.texture

    def render(self, frame, picture):
        """Expose the picture and apply the curve."""
        stops, metered = self.expose(frame, picture), self.metered
        uniforms = {'stops': stops, 'white': self.white, 'intensity': self.intensity}
        textures = {} if metered is None else {'metered': metered}
        is_exposed = int(stops != 0 or metered is not None)
        program_text = map_text(CURVES.index(self.curve), is_exposed, len(textures))
        picture.apply(Pointwise('tone_mapping map', program_text, uniforms, textures))

    def expose(self, frame, picture) -> float:
        """Return the exposure as set, in stops; the first call of a frame meters the picture."""
        if self.auto and self._metered_frame != frame.index and frame.scale == 1:
            self._metered_frame = frame.index
            self._auto_exposure = self._auto_exposure or AutoExposure(frame.window)
            stop_range = self.min_exposure, max(self.min_exposure, self.max_exposure)
            self._auto_exposure.follow(picture, frame.time, self.adaptation, stop_range)
        return self.exposure

    def reset(self):
        """Reset automatic exposure, as after a cut, to adapt to the next frame at once."""
        self._metered_frame = None
        if self._auto_exposure is not None:
            self._auto_exposure.reset()

    def release(self):
        """Free GPU memory; the context is current."""
        release(self._auto_exposure)
        self._auto_exposure = self._metered_frame = None

    def report(self) -> dict:
        """Return the bytes of GPU memory and the exposure of the last frame in stops."""
        return {'bytes': nbytes_of(self._auto_exposure), 'stops': self.stops}


@cache
def map_text(curve_number, is_exposed, is_metered):
    """Return a program's text: one object each time, since it is a key whose hash is kept."""
    values = {'CURVE': curve_number, 'EXPOSED': is_exposed, 'METERED': is_metered}
    constants = ''.join(f'const int {name} = {value};\n' for name, value in values.items())
    return constants + _TEXTS['light'] + _TEXTS['map']
