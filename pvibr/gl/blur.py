"""A wide blur built from small blurs of small images."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from pvibr.gl.driver import driver_of
from pvibr.gl.feature import sections
from pvibr.gl.fused import Pointwise
from pvibr.gl.quad import Quad, shader_source
from pvibr.gl.target import Target
from pvibr.gl.texture import Texture, nbytes_of, release

_X, _Y = (1.0, 0.0), (0.0, 1.0)
_ENDLESS = 1e9
_TINY = 1e-6  # of a texel: rounding
# Downsampling by a Gaussian per axis or in one pass of 13 taps, and the matching upsampling.
PASSES = {'gaussian': ('halve', 'mix'), 'tent': ('down13', 'tent')}
CHAINS = tuple(PASSES)


def halving_taps(kernel, width=1.0):
    """Return offsets and weights of the bilinear taps of a Gaussian that halves an image."""
    texels, texel_weights = (a.reshape(-1, 2) for a in _gaussian(kernel, width))
    pair_weights = texel_weights.sum(axis=1)
    offsets = (texels * texel_weights).sum(axis=1) / pair_weights
    return offsets, pair_weights / pair_weights.sum()


def _gaussian(kernel, width):
    texels = np.arange(2 * kernel) - kernel + 0.5
    return texels, np.exp(-0.5 * (texels * 3 / (kernel * width)) ** 2)


def halves(size, times=1) -> tuple[int, int]:
    """Return a size halved a number of times, rounded up."""
    return -(-size[0] // 2**times), -(-size[1] // 2**times)


@dataclass(frozen=True)
class Light:
    """Light to be added to a picture."""

    image: Texture
    scale: float
    box: tuple[int, int, int, int]


class Blur:
    """Blurs an image to half its size, with the same total brightness."""

    def __init__(self, window, extent, levels, kernel, chain='gaussian', width=1.0):
        self.key = extent, levels, kernel, chain, width
        size = math.ceil(extent[0] - _TINY), math.ceil(extent[1] - _TINY)
        shader_sections = texts(kernel, width)
        self._quads = {n: Quad(window, shader_sections[n], f'blur {n}') for n in PASSES[chain]}
        self._blend_sources = [f'#define WHOLE {k}\n' + shader_sections['add'] for k in (0, 1)]
        driver = driver_of(window)
        self._is_software, light_format = driver.is_software, driver.light_format
        self.source = Target(window, size[0], size[1], (light_format, 'r8'))
        self._chain = chain
        self._levels = [_Level(window, halves(size, k), light_format) for k in range(levels)]

    @property
    def nbytes(self) -> int:
        """Bytes on the GPU."""
        return nbytes_of(*self._targets())

    def _targets(self):
        return [self.source, *(t for level in self._levels for t in level.targets)]

    @property
    def sigma(self) -> float:
        """Standard deviation of the widest blur, in texels of `source`."""
        return float(np.sqrt(sum(variances(*self.key[1:]))))

    @property
    def reach(self) -> int:
        """Distance in texels of `source` beyond which a texel does not contribute."""
        # The reach of each halving, of each doubling, and half a texel of the result.
        down_reach, up_reach = (self.key[2], 2) if self._chain == 'gaussian' else (3, 4)
        last_scale = 2 ** len(self._levels)
        return down_reach * (last_scale - 1) + up_reach * (last_scale - 2) + 3

    def lit(self):
        """Return the bounding box of the light in `source`, or None if there is none.

        On a GPU, the whole of it: blurring all takes less time than waiting for the answer.
        """
        if not self._is_software:
            return (0, 0, *self.source.colors[0].size)
        is_lit = self.source.colors[1].download()[..., 0]
        columns, rows = (is_lit.any(axis).nonzero()[0].tolist() for axis in (0, 1))
        return (columns[0], rows[0], columns[-1] + 1, rows[-1] + 1) if rows else None

    def draw(self, image, spread):
        """Blur an image; `spread` weights the wider levels."""
        halve_level = self._halve_by_axes if self._chain == 'gaussian' else self._halve_at_once
        upsample = PASSES[self._chain][1]
        width, height = self.key[0]
        extents = [(width / 2**k, height / 2**k) for k in range(len(self._levels) + 1)]
        for level, extent in zip(self._levels, extents, strict=False):
            halve_level(level, image, extent)
            image = level.small.colors[0]
        for level, extent in reversed([*zip(self._levels[:-1], extents[2:], strict=False)]):
            images = {'image': level.small.colors[0], 'wide': image}
            level.mixed.draw(self._quads[upsample], {'share': spread, 'extent': extent}, images)
            image = level.mixed.colors[0]
        return image

    def _halve_by_axes(self, level, image, extent):
        horizontal, vertical = (extent[0], _ENDLESS), (_ENDLESS, extent[1])
        quad, images = self._quads['halve'], {'image': level.tall.colors[0]}
        level.tall.draw(quad, {'axis': _X, 'extent': horizontal}, {'image': image})
        level.small.draw(quad, {'axis': _Y, 'extent': vertical}, images)

    def _halve_at_once(self, level, image, extent):
        level.small.draw(self._quads['down13'], {'extent': extent}, {'image': image})

    def blend(self, picture, light, *, intensity=1.0, screen=False, alone=False, tile=None):
        """Apply light to a picture."""
        scale, corner = tile or (1, (0, 0))
        light_size = [light.scale * scale * n for n in light.image.size]
        texture_scale = [n / t for n, t in zip(picture.size, light_size, strict=True)]
        texture_shift = [c / t for c, t in zip(corner, light_size, strict=True)]
        uniforms = {'place': texture_scale, 'shift': texture_shift, 'intensity': intensity}
        offsets = *(p - 1 for p in texture_scale), *texture_shift
        fragment = self._blend_sources[max(map(abs, offsets)) < _TINY]
        mode = '' if alone else 'screen' if screen else 'add'
        box, textures = _placed(light.box, scale, corner), {'light': light.image}
        picture.apply(Pointwise('light', fragment, uniforms, textures, mode, box))

    def release(self):
        """Free the GPU's memory; the context must be alive."""
        release(*self._quads.values(), *self._targets())


class _Level:
    def __init__(self, window, size, light_format):
        width, height = halves(size)
        target_sizes = (width, size[1]), (width, height), (width, height)
        self.targets = [Target(window, w, h, (light_format,)) for w, h in target_sizes]
        self.tall, self.small, self.mixed = self.targets


def _placed(box, scale, corner):
    """Return a box in pixels of a tile."""
    return [round(scale * b) - round(corner[i % 2]) for i, b in enumerate(box)]


def variances(levels, kernel, chain, width=1.0) -> tuple[float, float]:
    """Return the variances of the halvings and of the doublings, in texels of the source."""
    down_variance, up_variance = 1.75, 2.75  # of the 13 taps, and of the tent
    if chain == 'gaussian':
        texels, weights = _gaussian(kernel, width)
        down_variance, up_variance = (weights * texels**2).sum() / weights.sum(), 0.75
    scale_steps = 4.0 ** np.arange(levels)
    return down_variance * scale_steps.sum(), up_variance * scale_steps[1:].sum()


def texts(kernel, width=1.0) -> dict[str, str]:
    """Return the programs by name, with the kernel of halving."""
    programs = sections(shader_source(__file__))
    return programs | {'halve': _constants(kernel, width) + programs['halve']}


def _constants(kernel, width):
    offsets, weights = halving_taps(kernel, width)
    constants = f'#define PAIRS {kernel}\n'
    for name, values in (('PLACES', offsets), ('WEIGHTS', weights)):
        literals = ', '.join(f'{v:.9f}' for v in values)
        constants += f'const float {name}[{kernel}] = float[{kernel}]({literals});\n'
    return constants
