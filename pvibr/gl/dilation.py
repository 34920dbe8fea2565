"""Mip levels of straight RGBA whose filters mix in nothing transparent."""

from __future__ import annotations

from pvibr.gl.quad import quads_of
from pvibr.gl.target import Target
from pvibr.gl.texture import nbytes_of, release


class Dilation:
    """Computes all mip levels of one size: means weighted by alpha, colours dilated."""

    def __init__(self, window, width, height):
        level_count = max(width, height).bit_length()
        sizes = [(max(width >> k, 1), max(height >> k, 1)) for k in range(level_count)]
        self._quads = quads_of(window, __file__, 'head')
        self._pulled = [Target(window, *size, ('rgba16f',)) for size in sizes[1:]]
        self._pushed = [Target(window, *size) for size in sizes]

    def levels(self, image, *, premultiplied) -> list[Target]:
        """Return the levels of a texture, largest first, with straight colours."""
        images, is_straight = [image], [int(not premultiplied)] + [0] * len(self._pulled)
        for target, straight in zip(self._pulled, is_straight, strict=False):
            target.draw(self._quads['pull'], {'from_straight': straight}, {'image': images[-1]})
            images.append(target.colors[0])
        smaller = images[-1]
        levels = list(zip(self._pushed, images, is_straight, strict=True))
        for target, own, straight in reversed(levels):
            textures = {'image': own, 'smaller': smaller}
            target.draw(self._quads['push'], {'from_straight': straight}, textures)
            smaller = target.colors[0]
        return self._pushed

    @property
    def nbytes(self) -> int:
        """Bytes on the GPU."""
        return nbytes_of(*self._pulled, *self._pushed)

    def release(self):
        """Free the GPU's memory; the context must be alive."""
        release(*self._quads.values(), *self._pulled, *self._pushed)
