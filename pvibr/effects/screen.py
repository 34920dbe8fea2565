"""Billboards that fill a subplot, over the picture."""

from __future__ import annotations

import math

import numpy as np
from scipy.ndimage import distance_transform_edt, gaussian_filter

from pvibr.core.params import Param
from pvibr.effects.full_screen import FullScreen, FullScreenImage
from pvibr.gl import Texture
from pvibr.images.projected import as_rgba

_BLACK = (0.0, 0.0, 0.0)
_MODES = ('over', 'add', 'multiply', 'screen')
_UNSEEN = 1 / 512  # what covers less than that changes no byte


class Vignette(FullScreen):
    """Darken the picture towards its corners.

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

    parts = ('vignette',)

    intensity = Param(0.5, 'How much is taken away at the outside.', range='[0, 1]')
    radius = Param(
        0.4,
        'Where it begins, as a share of half the diagonal: colours within stay.',
        range='[0, 4]',
    )
    softness = Param(
        0.6,
        'Width of the ring in which it grows, as a share of half the diagonal.',
        range='(0, 4]',
    )
    center = Param((0.5, 0.5), 'The middle, from (0, 0) lower left to (1, 1).')
    color = Param(_BLACK, 'What the picture turns to.', range='[0, 1]')

    def needed(self, frame) -> bool | str:
        """Tell whether it darkens anything."""
        return self.intensity > 0 or 'intensity is 0'

    def _uniforms(self, frame, size):
        ring = (self.radius, self.softness, self.intensity)
        half = 0.5 * math.hypot(*size)
        away = tuple(edge / half for edge in _away(frame, self.center))
        return {'tint': self.color, 'away': away, 'ring': ring}


class Flash(FullScreen):
    """Cover the picture with light that fades.

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
    covers = True

    at = Param(
        None,
        'When it is fired, by pl.ibr.time; None is never.',
        range='(-inf, inf)',
        unit='s',
        kind=float,
    )
    duration = Param(0.3, 'Time in which it fades by 63 %.', range='(0, inf)', unit='s')
    intensity = Param(1.0, 'How much it covers when it is fired.', range='[0, 1]')
    color = Param((1.0, 1.0, 1.0), 'The light.', range='[0, 1]')

    def fire(self):
        """Fire it now, by the time of the subplot."""
        self.at = float(self.pipeline.time) if self.pipeline is not None else 0.0

    def cover(self, time) -> float:
        """Return how much of the picture it covers.

        Parameters
        ----------
        time : float
            Seconds.

        Returns
        -------
        float
            From 0 to 1.
        """
        if self.at is None or time < self.at:
            return 0.0
        return float(self.intensity * np.exp(-(time - self.at) / self.duration))

    def needed(self, frame) -> bool | str:
        """Tell whether it can be seen."""
        return self.cover(frame.time) > _UNSEEN or 'no flash at this time'

    def _uniforms(self, frame, size):
        return {'tint': self.color, 'much': self.cover(frame.time)}


class NightVision(FullScreen):
    """Show luminance alone, amplified, in one colour and with grain.

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

    parts = ('night_vision',)

    intensity = Param(1.0, 'Share of what the tube shows in the picture.', range='[0, 1]')
    gain = Param(
        4.0,
        'How much dark parts are amplified: about gain times, white stays white.',
        range='(0, 80]',
    )
    grain = Param(0.1, 'How much noise there is, from darkest to brightest.', range='[0, 1]')
    rate = Param(
        25.0,
        'Times a second of pl.ibr.time that the noise changes; 0 keeps it.',
        range='[0, 1000]',
        unit='Hz',
    )
    seed = Param(0, 'Another one, another noise.', range='[0, 65535]')
    color = Param((0.35, 1.0, 0.45), 'The light of the tube.', range='[0, 1]')

    def needed(self, frame) -> bool | str:
        """Tell whether the picture changes."""
        return self.intensity > 0 or 'intensity is 0'

    def _uniforms(self, frame, size):
        moment = int(np.floor(frame.time * self.rate + 1e-9)) + 65536 * self.seed
        tube = (self.gain, self.grain, self.intensity)
        grid = [n / frame.scale for n in size]
        return {'tint': self.color, 'tube': tube, 'moment': moment % 2**31, 'grid': grid}


class Iris(FullScreen):
    """Close the picture around a point, as silent films end.

    Parameters
    ----------
    shape : path, array or pyvista.Texture, optional
        What is bright and opaque is the opening; a circle unless given. It is scaled so that its
        largest inner circle, whose middle lies on `center`, does what the circle would do.
    **settings
        `opening`, `center`, `softness`, `color`.

    Raises
    ------
    ValueError
        Where no pixel of the shape is bright.

    Examples
    --------
    >>> from pvibr import Iris
    >>> Iris(opening=0.25, center=(0.3, 0.6)).opening
    0.25
    """

    covers = True

    opening = Param(
        0.5, 'How far it is open: 0 shows nothing, 1 the whole picture.', range='[0, 1]'
    )
    center = Param(
        (0.5, 0.5), 'What it closes around, from (0, 0) lower left to (1, 1).', range='[0, 1]'
    )
    softness = Param(
        0.0, 'Width of its edge, as a share of the height; a pixel at least.', range='[0, 1]'
    )
    color = Param(_BLACK, 'What covers the rest.', range='[0, 1]')

    def __init__(self, shape=None, **settings):
        self._shape = None if shape is None else _shape_of(shape)
        self._distances: Texture | None = None
        super().__init__(**settings)

    def _entries(self):
        return 'disk' if self._shape is None else 'shape', 'iris'

    def needed(self, frame) -> bool | str:
        """Tell whether it covers anything."""
        return self.opening < 1 or 'opening is 1'

    def _uniforms(self, frame, size):
        soft = max(self.softness * size[1], 1.0)
        away = (max(c, 1 - c) * n for c, n in zip(self.center, size, strict=True))
        reach = self.opening * (math.hypot(*away) + soft)
        found = {'tint': self.color, 'away': _away(frame, self.center), 'reach': (reach, 1 / soft)}
        return found if self._shape is None else found | {'scale': self._shape[1]}

    def _textures(self, frame):
        if self._shape is None:
            return {}
        if self._distances is None:
            self._distances = Texture(frame.window, filter='linear').upload(self._shape[0][::-1])
        return {'shape': self._distances}

    def release(self):
        """Free what it holds on the GPU; the context is current."""
        super().release()
        if self._distances is not None:
            self._distances.release()
        self._distances = None

    def report(self) -> dict:
        """Return the bytes on the GPU."""
        return {'bytes': self._distances.nbytes if self._distances else 0}


class ImageOverlay(FullScreenImage):
    """Lay an image, a sequence or a film over the picture: a title, a logo, a frame.

    Parameters
    ----------
    image : path, array, pyvista.Texture, LiveTexture, or a sequence of paths or arrays
        See :class:`pvibr.images.projected.Shown`; its alpha counts.
    **settings
        `mode`, `opacity`, `fit`, `place`, `fps`, `loop`.

    See Also
    --------
    Backdrop : Behind the scene.

    Examples
    --------
    >>> import numpy as np
    >>> from pvibr import ImageOverlay
    >>> ImageOverlay(np.ones((8, 8, 3)), place=(0.8, 0.8, 1, 1), opacity=0.5).mode
    'over'
    """

    mode = Param('over', 'How it meets the picture.', choices=_MODES)

    def _covers(self):
        return self.mode == 'over'

    def _entries(self):
        return 'image', 'picture' if self._covers() else 'mixed'

    def _uniforms(self, frame, size):
        found = super()._uniforms(frame, size)
        return found if self._covers() else found | {'mode': _MODES.index(self.mode)}


def _away(frame, center):
    """Return where what is drawn begins, as seen from a place, and its size; in pixels."""
    (left, bottom, right, top), (width, height) = frame.tile, frame.whole
    return (
        (left - center[0]) * width,
        (bottom - center[1]) * height,
        (right - left) * width,
        (top - bottom) * height,
    )


def _shape_of(image):
    """Return distances to the edge of what is bright, and its inner circle in texture space."""
    pixels = as_rgba(image) / 255.0
    bright = np.pad(pixels[..., :3].mean(axis=-1) * pixels[..., 3] > 0.5, 2)
    if not bright.any():
        msg = 'shape has no bright pixel: white, or opaque on transparent, is where it is open'
        raise ValueError(msg)
    inside = distance_transform_edt(bright)
    away = np.where(bright, inside - 0.5, 0.5 - distance_transform_edt(~bright))
    away = gaussian_filter(away, 1.0)  # else its edge has steps where it is seen large
    row, column = np.unravel_index(inside.argmax(), inside.shape)
    radius, (height, width) = away.max(), bright.shape
    middle = ((column + 0.5) / width, 1 - (row + 0.5) / height)
    return (away / radius).astype(np.float32), (*middle, radius / width, radius / height)
