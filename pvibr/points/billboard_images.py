"""The images of billboards: several packed into one texture, or a live texture."""

from __future__ import annotations

import numpy as np

from pvibr.gl import MipTexture
from pvibr.textures.sheet import Sheet


class SheetImages:
    """Images packed into one texture."""

    draws, missing = 0, ''

    def __init__(self, images, cutout):
        self._sheet = Sheet(images, cutout)
        self.sizes = self._sheet.sizes
        self.texture: MipTexture | None = None
        self._skipped = 0  # levels too large for the driver

    def upload(self, window):
        """Upload the texture; the context is current."""
        self.texture, self._skipped = self._sheet.upload(window)

    @property
    def nbytes(self) -> int:
        """Bytes on the GPU."""
        return self.texture.nbytes if self.texture is not None else 0

    def rects(self) -> np.ndarray:
        """Return left, bottom, right and top of each image in texels of the texture."""
        return self._sheet.rects * np.float32(0.5**self._skipped)

    def uniforms(self) -> dict:
        """Return the uniforms of the texture."""
        return {'ibr_smallest': float(max(len(self._sheet.levels) - 1 - self._skipped, 0))}

    def whole(self) -> tuple[np.ndarray, np.ndarray]:
        """Return all images as one, row 0 at the top, and their rectangles, y up."""
        return self._sheet.levels[0][::-1], self._sheet.rects

    def alpha(self, number, uv) -> float:
        """Return the alpha of an image at texture coordinates, 0 to 1 from the lower left."""
        low_x, low_y, high_x, high_y = self._sheet.rects[number].astype(int)
        return _alpha(self._sheet.levels[0][low_y:high_y, low_x:high_x], uv)

    def report(self) -> dict:
        """Return the size of the texture."""
        height, width = self._sheet.levels[self._skipped].shape[:2]
        return {'texture': f'{width} x {height}'}

    def release(self):
        """Free GPU memory; the context is current."""
        if self.texture is not None:
            self.texture.release()
        self.texture = None


class LiveImage:
    """A live texture, which owns its GPU memory."""

    nbytes = 0

    def __init__(self, live):
        self._live = live
        self.sizes = np.array([live.size])

    @property
    def draws(self) -> int:
        """Number of times the texture was drawn."""
        return self._live.draws

    @property
    def missing(self) -> str:
        """Why the image is not available, empty if it is."""
        if self.texture is not None:
            return ''
        return 'its live texture is not drawn yet, or in no subplot: add it to one'

    @property
    def texture(self):
        """The texture as last drawn, or None."""
        return self._live.shown

    def upload(self, window):
        """Do nothing: the texture is on the GPU already."""

    def rects(self) -> np.ndarray:
        """Return left, bottom, right and top of the image in texels."""
        return np.array([[0, 0, *self._live.size]], np.float32)

    def uniforms(self) -> dict:
        """Return the uniforms of the texture."""
        return {'ibr_smallest': float(np.floor(np.log2(max(self._live.size))))}

    def whole(self) -> tuple[np.ndarray, np.ndarray]:
        """Return the image, row 0 at the top, and its rectangle, y up."""
        return self._live.image(), self.rects().astype(float)

    def alpha(self, _number, uv) -> float:
        """Return the alpha at texture coordinates, 0 to 1 from the lower left."""
        return _alpha(self._live.image()[::-1], uv)

    def report(self) -> dict:
        """Return nothing, as a live texture has its own report."""
        return {}

    def release(self):
        """Do nothing: the live texture releases itself."""


def _alpha(image, uv) -> float:
    height, width = image.shape[:2]
    x, y = (min(int(share * n), n - 1) for share, n in zip(uv, (width, height), strict=True))
    return float(image[y, x, 3]) / 255
