"""Pictures of photographs in any reduction, decoded when asked for."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from os import cpu_count
from typing import Any

import numpy as np

from pvibr.cameras.photos import Photo, resampled
from pvibr.images.picture_sheet import halved
from pvibr.images.projected import as_rgba, resized
from pvibr.maths.lens_camera import LensCamera

#: Texels along the longer side of the version on which colours and sharpness are compared.
_SMALL = 768


@dataclass(eq=False)
class PhotoSource:
    """A photograph, or a face of the cube that a wide lens needs, as a pinhole's picture."""

    photo: Photo
    #: Of the photograph in the sequence.
    index: int
    camera: Any
    #: Of the photograph: the camera needs no resampling.
    plain: bool = True
    mask: np.ndarray | None = None
    sharpness: float = 1.0
    small: np.ndarray | None = field(default=None, repr=False)
    survey_mask: np.ndarray | None = field(default=None, repr=False)

    @property
    def size(self) -> tuple:
        """Width and height in pixels."""
        return self.camera.size

    def load(self, times) -> np.ndarray:
        """Return the picture halved so many times, (h, w, 4) uint8, row 0 at the top."""
        size = halved(self.size, times)
        if self.small is not None and self.small.shape[1::-1] == size:
            return self.small
        picture = self.photo.read(size) if self.plain else self._seen(self.photo.read(), size)
        if self.mask is not None:
            mask = resized(self.mask, size) if self.plain else self._seen(self.mask, size)[..., 0]
            picture[..., 3] = np.minimum(picture[..., 3], mask)
        return picture

    def _seen(self, picture, size):
        """Return a picture of the wide lens as the face sees it."""
        return resampled(self.photo.camera, picture, self.camera.resized(size))[0]

    def load_small(self):
        """Load the version on which colours and sharpness are compared."""
        times = max(int(np.ceil(np.log2(max(self.size) / _SMALL))), 0)
        self.small = self.load(times)
        self.survey_mask = None if self.small[..., 3].min() == 255 else self.small[..., 3]
        gray = self.small[..., :3].mean(-1)
        fine = 4 * gray[1:-1, 1:-1] - gray[:-2, 1:-1] - gray[2:, 1:-1]
        fine -= gray[1:-1, :-2] + gray[1:-1, 2:]
        steps = np.abs(np.diff(gray, axis=1)).mean() + np.abs(np.diff(gray, axis=0)).mean()
        self.sharpness = float(np.abs(fine).mean() / max(steps, 1e-6)) if fine.size else 1.0
        return self


def sources_of(photos, masks=None) -> list[PhotoSource]:
    """Return the pictures of photographs; those of wide lenses are several."""
    found = []
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
                found += [PhotoSource(photo, k, face, plain=False, mask=gray) for face in faces]
                continue
        found.append(PhotoSource(photo, k, camera, mask=gray))
    return found


#: Threads that decode: Pillow lets others run meanwhile.
THREADS = max(cpu_count() or 1, 2)


def threads() -> ThreadPoolExecutor:
    """Return a pool of threads that decode."""
    return ThreadPoolExecutor(THREADS, 'pvibr-photos')


def load_small(sources):
    """Load the small versions of all, their sharpness relative to the median; return them."""
    with threads() as pool:
        list(pool.map(PhotoSource.load_small, sources))
    middle = float(np.median([s.sharpness for s in sources])) or 1.0
    for source in sources:
        source.sharpness = float(np.clip(source.sharpness / middle, 0.2, 1.2))
    return sources
