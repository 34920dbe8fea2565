"""What full-screen billboards have in common: one program, and at most one image."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np

from pvibr.core.effect import Effect
from pvibr.core.params import Param
from pvibr.gl import shader_source
from pvibr.gl.feature import sections
from pvibr.gl.fused import Pointwise
from pvibr.images.projected import Shown

_TEXTS = sections(shader_source(__file__))


@cache
def _text(entries):
    """Return a program, the same object each time: it is a key, and hashed once."""
    return ''.join(_TEXTS[name] for name in ('common', *entries))


class FullScreen(Effect):
    """One full-screen program over the picture, with at most one texture of its own.

    A subclass names its entry points in `parts`, and gives ``_uniforms(frame, size)`` and
    ``_textures(frame)``.

    Parameters
    ----------
    **settings
        Values of the class's settings.
    """

    #: Entry points of the shader, the last with ``main``.
    parts: tuple[str, ...] = ()
    #: Whether it covers the picture, and is blended with it in place.
    covers = False

    _image: Any = None

    def render(self, frame, picture):
        """Draw over or behind the picture."""
        size = frame.whole
        uniforms = {'tile': frame.tile, 'size': size, **self._uniforms(frame, size)}
        name, textures = f'screen {self.name}', self._textures(frame)
        blend = 'over' if self._covers() else ''
        picture.apply(Pointwise(name, _text(self._entries()), uniforms, textures, blend))

    def _covers(self) -> bool:
        return self.covers

    def _entries(self) -> tuple[str, ...]:
        return self.parts

    def _uniforms(self, frame, size) -> dict:
        return {}

    def _textures(self, frame) -> dict:
        return {}

    def release(self):
        """Free what it holds on the GPU and close films; the context is current."""
        if self._image is not None:
            self._image.release()

    def report(self) -> dict:
        """Return the bytes on the GPU."""
        return {'bytes': self._image.nbytes if self._image else 0}


class FullScreenImage(FullScreen):
    """What a picture over the scene and one behind it have in common.

    Parameters
    ----------
    image : path, array, pyvista.Texture, LiveTexture, or a sequence of paths or arrays
        See :class:`pvibr.images.projected.Shown`.
    **settings
        Values of the class's settings.
    """

    opacity = Param(1.0, 'How much of the picture is seen.', range='[0, 1]')
    fit = Param(
        'contain',
        'How it fills its place: whole, cut to the shape of the place, or stretched.',
        choices=('contain', 'cover', 'stretch'),
    )
    place = Param(
        (0.0, 0.0, 1.0, 1.0), 'Left, bottom, right, top of where it is, as shares of the subplot.'
    )
    fps = Param(
        None,
        "Pictures of a sequence per second of pl.ibr.time; by default the film's own.",
        range='(0, inf)',
        kind=float,
    )
    loop = Param(True, 'Whether a sequence begins again after its end, or its last is held.')

    def __init__(self, image, **settings):
        self._image = Shown(image)
        super().__init__(**settings)

    def needed(self, frame) -> bool | str:
        """Tell whether it can be seen."""
        left, bottom, right, top = self.place
        if not (left < right and bottom < top):
            return f'place = {self.place} is empty: left < right and bottom < top'
        if self._image.missing:
            return self._image.missing
        return self.opacity > 0 or 'opacity is 0'

    def _uniforms(self, frame, size):
        edges = _fitted(self.place, self.fit, self._image.size, size)
        return {'frame': edges, 'bounds': self.place, 'opacity': self.opacity}

    def _textures(self, frame):
        return {'image': self._image.texture(frame.window, frame.time, self.fps, self.loop)}


def _fitted(place, fit, image, size):
    """Return where the edges of an image are, as shares of the subplot."""
    low, high = np.array(place[:2]), np.array(place[2:])
    pixels = (high - low) * size
    scale = pixels / image
    if fit != 'stretch':
        scale = np.full(2, scale.min() if fit == 'contain' else scale.max())
    half = scale * image / size / 2
    middle = (low + high) / 2
    return (*(middle - half), *(middle + half))
