"""Pictures of photographs at any reduction, decoded on demand."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from os import cpu_count
from typing import Any

import numpy as np

from pvibr.maths.filled_texels import filled
from pvibr.maths.lens_camera import LensCamera
from pvibr.photos.photos import Photo, resampled
from pvibr.photos.picture_sheet import halved
from pvibr.textures.projected import as_rgba, resized

#: Longest side of the version used to compare colours and sharpness, texels.
_SMALL_SIDE = 768


@dataclass(eq=False)
class PhotoSource:
    """A photograph, or one cube face of a wide-angle photograph, as a pinhole picture."""

    photo: Photo
    #: Index of the photograph in the sequence.
    index: int
    camera: Any
    #: Whether the photograph needs no resampling.
    plain: bool = True
    mask: np.ndarray | None = None
    sharpness: float = 1.0
    small: np.ndarray | None = field(default=None, repr=False)
    survey_mask: np.ndarray | None = field(default=None, repr=False)

    @property
    def size(self) -> tuple:
        """Width and height in pixels."""
        return self.camera.size

    def load(self, halving_count) -> np.ndarray:
        """Return the picture after a number of halvings, (h, w, 4) uint8, row 0 at the top."""
        size = halved(self.size, halving_count)
        if self.small is not None and self.small.shape[1::-1] == size:
            return self.small
        if self.plain and self.mask is None:
            return filled(self.photo.read(size))
        picture = self.photo.read()
        if self.mask is not None:
            mask = resized(self.mask, picture.shape[1::-1])
            picture[..., 3] = np.minimum(picture[..., 3], mask)
        return filled(resized(picture, size) if self.plain else self._resampled(picture, size))

    def _resampled(self, picture, size):
        """Return the part of a wide-angle picture that the cube face sees."""
        return resampled(self.photo.camera, picture, self.camera.resized(size))[0]

    def load_small(self):
        """Load the version used to compare colours and sharpness."""
        self.small = self.load(max(int(np.ceil(np.log2(max(self.size) / _SMALL_SIDE))), 0))
        self.survey_mask = None if self.small[..., 3].min() == 255 else self.small[..., 3]
        gray = self.small[..., :3].mean(-1)
        laplacian = 4 * gray[1:-1, 1:-1] - gray[:-2, 1:-1] - gray[2:, 1:-1]
        laplacian -= gray[1:-1, :-2] + gray[1:-1, 2:]
        gradient = np.abs(np.diff(gray, axis=1)).mean() + np.abs(np.diff(gray, axis=0)).mean()
        self.sharpness = (
            float(np.abs(laplacian).mean() / max(gradient, 1e-6)) if laplacian.size else 1.0
        )
        return self


def sources_of(photos, masks=None) -> list[PhotoSource]:
    """Return the pictures of photographs, several for each wide lens."""
    sources = []
    for k, (photo, mask) in enumerate(zip(photos, masks or [None] * len(photos), strict=True)):
        if photo.path is None:
            photo.read()  # raises
        gray = None if mask is None else as_rgba(mask, 'masks')[..., :1].copy()
        camera = photo.camera
        if isinstance(camera, LensCamera):
            try:
                camera = camera.as_pinhole()
            except ValueError:
                faces = camera.faces()
                sources += [PhotoSource(photo, k, face, plain=False, mask=gray) for face in faces]
                continue
        sources.append(PhotoSource(photo, k, camera, mask=gray))
    return sources


#: Decoding threads: Pillow releases the GIL.
THREADS = max(cpu_count() or 1, 2)


def threads() -> ThreadPoolExecutor:
    """Return a pool of decoding threads."""
    return ThreadPoolExecutor(THREADS, 'pvibr-photos')


def load_small(sources):
    """Load all small versions; make sharpness relative to the median; return the sources."""
    with threads() as pool:
        list(pool.map(PhotoSource.load_small, sources))
    median_sharpness = float(np.median([s.sharpness for s in sources])) or 1.0
    for source in sources:
        source.sharpness = float(np.clip(source.sharpness / median_sharpness, 0.2, 1.2))
    return sources
