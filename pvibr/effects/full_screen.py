"""Base classes of effects with one full-screen program and at most one image."""

from __future__ import annotations

from functools import cache

import numpy as np

from pvibr.core.effect import Effect
from pvibr.core.params import Param
from pvibr.gl import nbytes_of, release, shader_source
from pvibr.gl.feature import sections
from pvibr.gl.fused import Pointwise
from pvibr.images.projected import Shown

_TEXTS = sections(shader_source(__file__))


@cache
def _text(entries):
    """Return a program; the same object each time, since it is a key and hashed once."""
    return ''.join(_TEXTS[name] for name in ('common', *entries))


class FullScreen(Effect):
    """One full-screen program: a subclass has `parts`, `_uniforms` and `_textures`.

    Parameters
    ----------
    **settings
        Values of the class's settings.
    """

    #: Entry points of the shader, the last with ``main``; if it `covers`, it is blended in place.
    parts: tuple[str, ...] = ()

    _image: Shown | None = None

    def render(self, frame, picture):
        """Draw the program."""
        size = frame.whole
        uniforms = {'tile': frame.tile, 'size': size, **self._uniforms(frame, size)}
        name, textures = f'screen {self.name}', self._textures(frame)
        blend = 'over' if self.covers else ''
        picture.apply(Pointwise(name, _text(self._entries()), uniforms, textures, blend))

    def _entries(self) -> tuple[str, ...]:
        return self.parts

    def _uniforms(self, frame, size) -> dict:
        return {}

    def _textures(self, frame) -> dict:
        return {}

    def release(self):
        """Free GPU memory and close films; the context is current."""
        release(self._image)

    def report(self) -> dict:
        """Return the bytes of GPU memory."""
        return {'bytes': nbytes_of(self._image)}


class FullScreenImage(FullScreen):
    """An image over or behind the scene.

    Parameters
    ----------
    image : path, array, pyvista.Texture, LiveTexture, or a sequence of paths or arrays
        Image to show; its alpha channel is used.
    **settings
        Values of the class's settings.
    """

    neutral = 'opacity', 0
    opacity = Param(1.0, 'Opacity of the image.', range='[0, 1]')
    fit = Param('contain', 'Fit to the rectangle.', choices=('contain', 'cover', 'stretch'))
    place = Param((0.0, 0.0, 1.0, 1.0), 'Left, bottom, right and top, fractions of the subplot.')
    fps = Param(
        None, "Frames per second; the film's rate by default.", range='(0, inf)', kind=float
    )
    loop = Param(True, 'Repeat a sequence after its end, instead of holding the last frame.')

    _image: Shown

    def __init__(self, image, **settings):
        self._image = Shown(image)
        super().__init__(**settings)

    @classmethod
    def sample(cls, actors):
        """Return an instance with a gradient."""
        x, y = np.meshgrid(np.linspace(0, 1, 96), np.linspace(1, 0, 64))
        return cls(np.dstack([x, y, np.ones_like(x)]))

    def needed(self, frame) -> bool | str:
        """Return True if the effect must run."""
        left, bottom, right, top = self.place
        if not (left < right and bottom < top):
            return f'place = {self.place} is empty: left < right and bottom < top'
        if self._image.missing:
            return self._image.missing
        return super().needed(frame)

    def _uniforms(self, frame, size):
        edges = _fitted(self.place, self.fit, self._image.size, size)
        return {'frame': edges, 'bounds': self.place, 'opacity': self.opacity}

    def _textures(self, frame):
        return {'image': self._image.texture(frame.window, frame.time, self.fps, self.loop)}


def _fitted(place, fit, image, size):
    """Return left, bottom, right and top of an image as fractions of the subplot."""
    low, high = np.array(place[:2]), np.array(place[2:])
    pixels = (high - low) * size
    scale = pixels / image
    if fit != 'stretch':
        scale = np.full(2, scale.min() if fit == 'contain' else scale.max())
    half = scale * image / size / 2
    middle = (low + high) / 2
    return (*(middle - half), *(middle + half))
