"""Effects over the finished picture: vignette, flash, night vision, iris and overlays."""

from __future__ import annotations

import math

import numpy as np
from scipy.ndimage import distance_transform_edt, gaussian_filter

from pvibr.core.colors import Color
from pvibr.core.params import Param
from pvibr.effects.full_screen import FullScreen, FullScreenImage
from pvibr.gl import Texture, nbytes_of, release
from pvibr.textures.projected import as_rgba

_BLACK = (0.0, 0.0, 0.0)
_BLEND_MODES = ('over', 'add', 'multiply', 'screen')
_INVISIBLE = 1 / 512  # a lower opacity changes no byte


class Vignette(FullScreen):
    """Darkening of the picture towards its corners.

    Parameters
    ----------
    **settings
        `intensity`, `radius`, `softness`, `center`, `color`.

    Examples
    --------
    >>> from pvibr import Vignette
    >>> Vignette(intensity=0.3).radius
    0.4
    """

    single = True
    parts = ('vignette',)
    neutral = 'intensity', 0
    presets = {
        'subtle': {'intensity': 0.25},
        'strong': {'intensity': 0.9, 'radius': 0.3},
    }

    intensity = Param(0.5, 'Opacity of the darkening at the corners.', range='[0, 1]')
    radius = Param(0.4, 'Clear radius, as a fraction of half the diagonal.', range='[0, 4]')
    softness = Param(0.6, 'Transition width, fraction of half the diagonal.', range='(0, 4]')
    center = Param((0.5, 0.5), 'Centre, from (0, 0) at the lower left to (1, 1).')
    color = Color(_BLACK, 'Colour outside the vignette.')

    @classmethod
    def sample(cls, actors):
        """Return a vignette that starts at the centre."""
        return cls(radius=0, softness=0.5)

    def _uniforms(self, frame, size):
        ring_shape = (self.radius, self.softness, self.intensity)
        half_diagonal = 0.5 * math.hypot(*size)
        corner_offset = tuple(edge / half_diagonal for edge in _corner_offset(frame, self.center))
        return {'tint': self.color, 'corner_offset': corner_offset, 'ring': ring_shape}


class Flash(FullScreen):
    """Light that flashes over the picture and fades.

    Parameters
    ----------
    **settings
        `at`, `duration`, `intensity`, `color`.

    Examples
    --------
    >>> import pyvista as pv
    >>> from pvibr import Flash
    >>> pl = pv.Plotter(off_screen=True)
    >>> flash = pl.ibr.add(Flash(duration=0.5))
    >>> pl.ibr.time = 3.0
    >>> flash.fire()
    >>> flash.cover(3.0), round(flash.cover(3.5), 3)
    (1.0, 0.368)
    >>> pl.close()
    """

    parts = ('flash',)
    once = True
    covers = True

    neutral = 'at', None
    presets = {
        'subtle': {'intensity': 0.4, 'duration': 0.2},
        'strong': {'intensity': 1.0, 'duration': 0.8},
    }

    at = Param(
        None, 'Start on pl.ibr.time, set by `fire`.', range='(-inf, inf)', unit='s', kind=float
    )
    duration = Param(
        0.3, 'Time constant of the decay: 37 % of the light remains.', range='(0, inf)', unit='s'
    )
    intensity = Param(1.0, 'Initial opacity.', range='[0, 1]')
    color = Color((1.0, 1.0, 1.0), 'Colour of the flash.')

    @classmethod
    def sample(cls, actors):
        """Return a flash fired at time 0."""
        return cls(at=0)

    def fire(self):
        """Start the flash at the current time of the subplot."""
        self.at = float(self.pipeline.time) if self.pipeline is not None else 0.0

    def cover(self, time) -> float:
        """Return the opacity of the flash.

        Parameters
        ----------
        time : float
            Time in seconds.

        Returns
        -------
        float
            Opacity in [0, 1].
        """
        if self.at is None or time < self.at:
            return 0.0
        return float(self.intensity * np.exp(-(time - self.at) / self.duration))

    def needed(self, frame) -> bool | str:
        """Return True if the effect must run."""
        return self.cover(frame.time) > _INVISIBLE or 'no flash at this time'

    def _uniforms(self, frame, size):
        return {'tint': self.color, 'opacity': self.cover(frame.time)}


class NightVision(FullScreen):
    """An image intensifier: amplified luminance in one colour, with grain.

    Parameters
    ----------
    **settings
        `intensity`, `gain`, `grain`, `rate`, `seed`, `color`.

    Examples
    --------
    >>> from pvibr import NightVision
    >>> NightVision(gain=8).gain
    8.0
    """

    single = True
    parts = ('night_vision',)

    neutral = 'intensity', 0
    presets = {
        'subtle': {'gain': 2.0, 'grain': 0.05},
        'strong': {'gain': 12.0, 'grain': 0.3},
    }

    intensity = Param(1.0, 'Opacity of the effect.', range='[0, 1]')
    gain = Param(4.0, 'Amplification of dark parts; white stays white.', range='(0, 80]')
    grain = Param(0.1, 'Peak-to-peak amplitude of the noise; 0 for none.', range='[0, 1]')
    rate = Param(25.0, 'Frame rate of the noise; 0 freezes it.', range='[0, 1000]', unit='Hz')
    seed = Param(0, 'Seed of the noise.', range='[0, 65535]')
    color = Color((0.35, 1.0, 0.45), 'Colour of the phosphor.')

    def _uniforms(self, frame, size):
        grain_number = int(np.floor(frame.time * self.rate + 1e-9)) + 65536 * self.seed
        return {
            'tint': self.color,
            'tube': (self.gain, self.grain, self.intensity),
            'grain_number': grain_number % 2**31,
            'grid': [n / frame.scale for n in size],
        }


class Iris(FullScreen):
    """An iris that closes around a point, as at the end of silent films.

    Parameters
    ----------
    shape : path, array or pyvista.Texture, optional
        Mask of the opening: bright, opaque pixels are open; a circle by default. Its largest
        inscribed circle takes the place of that circle.
    **settings
        `opening`, `center`, `softness`, `color`.

    Raises
    ------
    ValueError
        If no pixel of the shape is bright.

    Examples
    --------
    >>> from pvibr import Iris
    >>> Iris(opening=0.25, center=(0.3, 0.6)).opening
    0.25
    """

    single = True
    covers = True

    neutral = 'opening', 1

    opening = Param(0.5, 'Opening: 0 is closed, 1 shows the whole picture.', range='[0, 1]')
    center = Param((0.5, 0.5), 'Centre, from (0, 0) at the lower left to (1, 1).', range='[0, 1]')
    softness = Param(0.0, 'Width of the edge, as a fraction of the height.', range='[0, 1]')
    color = Color(_BLACK, 'Colour outside the opening.')

    def __init__(self, shape=None, **settings):
        self._shape = None if shape is None else _shape_of(shape)
        self._distance_field: Texture | None = None
        super().__init__(**settings)

    @classmethod
    def sample(cls, actors):
        """Return an instance in a vivid colour."""
        return cls(opening=0.4, color=(1, 0, 0))

    def _entries(self):
        return 'disk' if self._shape is None else 'shape', 'iris'

    def _uniforms(self, frame, size):
        edge_width = max(self.softness * size[1], 1.0)
        far_corner = (max(c, 1 - c) * n for c, n in zip(self.center, size, strict=True))
        opening_radius = self.opening * (math.hypot(*far_corner) + edge_width)
        uniforms = {
            'tint': self.color,
            'corner_offset': _corner_offset(frame, self.center),
            'opening': (opening_radius, 1 / edge_width),
        }
        return uniforms if self._shape is None else uniforms | {'shape_circle': self._shape[1]}

    def _textures(self, frame):
        if self._shape is None:
            return {}
        if self._distance_field is None:
            texture = Texture(frame.window, filter='linear')
            self._distance_field = texture.upload(self._shape[0][::-1])
        return {'shape': self._distance_field}

    def release(self):
        """Free GPU memory; the context is current."""
        super().release()
        release(self._distance_field)
        self._distance_field = None

    def report(self) -> dict:
        """Return the bytes of GPU memory."""
        return {'bytes': nbytes_of(self._distance_field)}


class ImageOverlay(FullScreenImage):
    """An image, image sequence or film over the picture, such as a title, logo or frame.

    Parameters
    ----------
    image : path, array, pyvista.Texture, LiveTexture, or a sequence of paths or arrays
        Image to show; its alpha channel is used.
    **settings
        `mode`, `opacity`, `fit`, `place`, `fps`, `loop`.

    See Also
    --------
    Backdrop : An image behind the scene.

    Examples
    --------
    >>> from pvibr import ImageOverlay
    >>> ImageOverlay(np.ones((8, 8, 3)), place=(0.8, 0.8, 1, 1), opacity=0.5).mode
    'over'
    """

    once = True
    mode = Param('over', 'Blend mode.', choices=_BLEND_MODES)

    @property
    def covers(self) -> bool:  # type: ignore[override]
        """Whether it also covers transparent background."""
        return self.mode == 'over'

    def _entries(self):
        return 'image', 'picture' if self.covers else 'mixed'

    def _uniforms(self, frame, size):
        uniforms = super()._uniforms(frame, size)
        return uniforms if self.covers else uniforms | {'mode': _BLEND_MODES.index(self.mode)}


def _corner_offset(frame, center):
    """Return the frame's lower left corner from a centre, and the frame's size, in pixels."""
    low, high = np.reshape(frame.tile, (2, 2))
    offset, extent = (low - center) * frame.whole, (high - low) * frame.whole
    return *offset.tolist(), *extent.tolist()


def _shape_of(image):
    """Return signed distances to a mask's edge, and its inscribed circle in uv."""
    rgba_pixels = as_rgba(image, 'shape') / 255.0
    is_bright = np.pad(rgba_pixels[..., :3].mean(axis=-1) * rgba_pixels[..., 3] > 0.5, 2)
    if not is_bright.any():
        raise ValueError('shape must have bright, opaque pixels, got none')
    inside, outside = map(distance_transform_edt, (is_bright, ~is_bright))
    distances = np.where(is_bright, inside - 0.5, 0.5 - outside)
    distances = gaussian_filter(distances, 1.0)  # avoids steps in magnified edges
    row, column = np.unravel_index(inside.argmax(), inside.shape)
    radius, (height, width) = distances.max(), is_bright.shape
    circle_center = ((column + 0.5) / width, 1 - (row + 0.5) / height)
    circle = (*circle_center, radius / width, radius / height)
    return (distances / radius).astype(np.float32), circle
