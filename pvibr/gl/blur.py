"""A wide blur as small blurs of small images."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from pvibr.gl.feature import sections
from pvibr.gl.fused import Pointwise
from pvibr.gl.quad import Quad, shader_source
from pvibr.gl.target import Target
from pvibr.gl.texture import Texture, nbytes_of, release

# llvmpipe samples whole floats faster than half ones, and these images are small.
_FORMAT = ('rgba32f',)
_X, _Y = (1.0, 0.0), (0.0, 1.0)
_ENDLESS = 1e9
_TINY = 1e-6  # of a texel: rounding
# How an image is halved, by a Gaussian along each axis or in one pass of 13 taps, and doubled.
_PASSES = {'gaussian': ('halve', 'mix'), 'tent': ('down13', 'tent')}
CHAINS = tuple(_PASSES)


def halving_taps(kernel, width=1.0):
    """Return the bilinear taps of a Gaussian that halves an image along one axis."""
    texels, weights = (a.reshape(-1, 2) for a in _gaussian(kernel, width))
    pairs = weights.sum(axis=1)
    places = (texels * weights).sum(axis=1) / pairs
    return places, pairs / pairs.sum()


def _gaussian(kernel, width):
    texels = np.arange(2 * kernel) - kernel + 0.5
    return texels, np.exp(-0.5 * (texels * 3 / (kernel * width)) ** 2)


def halves(size, times=1) -> tuple[int, int]:
    """Return a size halved, rounded up so that nothing is lost."""
    return -(-size[0] // 2**times), -(-size[1] // 2**times)


@dataclass(frozen=True)
class Light:
    """Light to be drawn on pictures."""

    image: Texture
    scale: float
    box: tuple[int, int, int, int]


class Blur:
    """Blurs an image: its result is of half the size, and as bright in sum."""

    def __init__(self, window, extent, levels, kernel, chain='gaussian', width=1.0):
        self.key = extent, levels, kernel, chain, width
        size = math.ceil(extent[0] - _TINY), math.ceil(extent[1] - _TINY)
        text = sections(shader_source(__file__))
        text['halve'] = _constants(kernel, width) + text['halve']
        self._quads = {n: Quad(window, text[n], f'blur {n}') for n in _PASSES[chain]}
        self._add = [f'#define WHOLE {k}\n' + text['add'] for k in (0, 1)]
        self.source = Target(window, size[0], size[1], (*_FORMAT, 'r8'))
        self._chain = chain
        self._levels = [_Level(window, halves(size, k)) for k in range(levels)]

    @property
    def nbytes(self) -> int:
        """Bytes on the GPU."""
        return nbytes_of(*self._targets())

    def _targets(self):
        return [self.source, *(t for level in self._levels for t in level.targets)]

    @property
    def sigma(self) -> float:
        """Standard deviation of the widest blur alone, in texels of `source`."""
        return float(np.sqrt(sum(variances(*self.key[1:]))))

    @property
    def reach(self) -> int:
        """Texels of `source` beyond which a texel has no part in the result."""
        # Of each halving, each doubling, and the way between texels of the result.
        down, up = (self.key[2], 2) if self._chain == 'gaussian' else (3, 4)
        last = 2 ** len(self._levels)
        return down * (last - 1) + up * (last - 2) + 3

    def lit(self):
        """Find the light in `source`, where it was drawn: waits for the GPU."""
        lit = self.source.colors[1].download()[..., 0]
        rows = lit.any(axis=1).nonzero()[0]
        if not rows.size:
            return None
        columns = lit.any(axis=0).nonzero()[0]
        return int(columns[0]), int(rows[0]), int(columns[-1]) + 1, int(rows[-1]) + 1

    def draw(self, image, spread):
        """Blur."""
        halve = self._halve_by_axes if self._chain == 'gaussian' else self._halve_at_once
        up = _PASSES[self._chain][1]
        width, height = self.key[0]
        extents = [(width / 2**k, height / 2**k) for k in range(len(self._levels) + 1)]
        for level, extent in zip(self._levels, extents, strict=False):
            halve(level, image, extent)
            image = level.small.colors[0]
        for level, extent in reversed([*zip(self._levels[:-1], extents[2:], strict=False)]):
            images = {'image': level.small.colors[0], 'wide': image}
            level.mixed.draw(self._quads[up], {'share': spread, 'extent': extent}, images)
            image = level.mixed.colors[0]
        return image

    def _halve_by_axes(self, level, image, extent):
        across, along = (extent[0], _ENDLESS), (_ENDLESS, extent[1])
        quad, images = self._quads['halve'], {'image': level.tall.colors[0]}
        level.tall.draw(quad, {'axis': _X, 'extent': across}, {'image': image})
        level.small.draw(quad, {'axis': _Y, 'extent': along}, images)

    def _halve_at_once(self, level, image, extent):
        level.small.draw(self._quads['down13'], {'extent': extent}, {'image': image})

    def blend(self, picture, light, *, intensity=1.0, screen=False, alone=False, tile=None):
        """Apply light to a picture."""
        scale, corner = tile or (1, (0, 0))
        texels = [light.scale * scale * n for n in light.image.size]
        place = [n / t for n, t in zip(picture.size, texels, strict=True)]
        shift = [c / t for c, t in zip(corner, texels, strict=True)]
        uniforms = {'place': place, 'shift': shift, 'intensity': intensity}
        whole = max(abs(p - 1) for p in place) < _TINY and max(abs(s) for s in shift) < _TINY
        text = self._add[whole]
        how = '' if alone else 'screen' if screen else 'add'
        box = _placed(light.box, scale, corner)
        picture.apply(Pointwise('light', text, uniforms, {'light': light.image}, how, box))

    def release(self):
        """Free the GPU's memory; the context must be alive."""
        release(*self._quads.values(), *self._targets())


class _Level:
    def __init__(self, window, size):
        width, height = halves(size)
        sizes = (width, size[1]), (width, height), (width, height)
        self.targets = [Target(window, w, h, _FORMAT) for w, h in sizes]
        self.tall, self.small, self.mixed = self.targets


def _placed(box, scale, corner):
    """Return a box in pixels of a tile."""
    return [round(scale * b) - round(corner[i % 2]) for i, b in enumerate(box)]


def variances(levels, kernel, chain, width=1.0) -> tuple[float, float]:
    """Return those of the widest blur by halving and by doubling, in texels of the first image."""
    down, up = 1.75, 2.75  # of 13 taps, and of a tent between texels
    if chain == 'gaussian':
        texels, weights = _gaussian(kernel, width)
        down, up = (weights * texels**2).sum() / weights.sum(), 0.75
    steps = 4.0 ** np.arange(levels)
    return down * steps.sum(), up * steps[1:].sum()


def _constants(kernel, width):
    places, weights = halving_taps(kernel, width)
    text = f'#define PAIRS {kernel}\n'
    for name, values in (('PLACES', places), ('WEIGHTS', weights)):
        numbers = ', '.join(f'{v:.9f}' for v in values)
        text += f'const float {name}[{kernel}] = float[{kernel}]({numbers});\n'
    return text
