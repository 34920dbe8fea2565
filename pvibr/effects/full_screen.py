"""Base classes of effects that are one full-screen program with at most one image."""

from __future__ import annotations

from functools import cache

import numpy as np

from pvibr.core.effect import Effect
from pvibr.core.params import Param
from pvibr.gl import nbytes_of, release, shader_source
from pvibr.gl.feature import sections
from pvibr.gl.fused import Pointwise
from pvibr.textures.projected import Shown

_TEXTS = sections(shader_source(__file__))


@cache
def _text(entry_points):
    """Return a program's text: one object each time, since it is a key whose hash is kept."""
    return ''.join(_TEXTS[name] for name in ('common', *entry_points))


class FullScreen(Effect):
    """One full-screen program; subclasses set `parts`, `_uniforms` and `_textures`.

    Parameters
    ----------
    **settings
        Values of the class's settings.
    """

    #: Shader sections, the last with ``main``; if the effect `covers`, it is blended in place.
    parts: tuple[str, ...] = ()
    reads_depth = False

    _image: Shown | None = None

    def render(self, frame, picture):
        """Draw the program."""
        uniforms = {'tile': frame.tile, **self._uniforms(frame, frame.whole)}
        program = f'screen {self.name}', _text(self._entries())
        blend_mode = 'over' if self.covers else ''
        picture.apply(Pointwise(*program, uniforms, self._textures(frame), blend_mode))

    def _entries(self) -> tuple[str, ...]:
        return self.parts

    def _uniforms(self, frame, size) -> dict:
        return {}

    def _textures(self, frame) -> dict:
        return {}

    def release(self):
        """Free GPU memory and close films; the context must be current."""
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
    fit = Param('contain', 'How the image fills `place`.', choices=('contain', 'cover', 'stretch'))
    place = Param((0.0, 0.0, 1.0, 1.0), 'Left, bottom, right and top, fractions of the subplot.')
    fps = Param(
        None, "Frames per second; by default the film's own.", range='(0, inf)', kind=float
    )
    loop = Param(True, 'Repeat a sequence after its end, instead of holding the last frame.')

    _image: Shown

    def __init__(self, image, **settings):
        self._image = Shown(image, has_coverage=True)
        super().__init__(**settings)

    @classmethod
    def sample(cls, actors):
        """Return an instance with a gradient."""
        x, y = np.meshgrid(np.linspace(0, 1, 96), np.linspace(1, 0, 64))
        return cls(np.dstack([x, y, np.ones_like(x)]))

    def needed(self, frame) -> bool | str:
        """Return True if the effect must run."""
        if not np.less(self.place[:2], self.place[2:]).all():
            return f'place must have left < right and bottom < top, got {self.place}'
        if self._image.missing:
            return self._image.missing
        return super().needed(frame)

    def _uniforms(self, frame, size):
        image_edges = _fitted(self.place, self.fit, self._image.size, size)
        return {'image_rect': image_edges, 'bounds': self.place, 'opacity': self.opacity}

    def _textures(self, frame):
        return {'image': self._image.texture(frame.window, frame.time, self.fps, self.loop)}


def _fitted(rect, fit, image_size, subplot_size):
    """Return the edges of a fitted image: left, bottom, right, top as fractions of the subplot."""
    low, high = np.array(rect[:2]), np.array(rect[2:])
    rect_pixels = (high - low) * subplot_size
    scale = rect_pixels / image_size
    if fit != 'stretch':
        scale = np.full(2, scale.min() if fit == 'contain' else scale.max())
    half_extent = scale * image_size / subplot_size / 2
    rect_center = (low + high) / 2
    return (*(rect_center - half_extent), *(rect_center + half_extent))
