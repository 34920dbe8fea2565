"""Images from files, arrays, textures, films and live textures."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import Any

import numpy as np

from pvibr.gl import MipTexture, Texture, texture_limit
from pvibr.maths.arguments import naming
from pvibr.maths.draping import sample

_FILMS = ('.avi', '.gif', '.m4v', '.mkv', '.mov', '.mp4', '.mpeg', '.mpg', '.webm')


class Pictures:
    """One picture, or a sequence of them by time."""

    def __init__(self, image, mask=None):
        self.fps = 25.0
        self._film: Path | None = None
        self._reader: Any = None
        self._frames = [image]
        if _is_film(image):
            self._film = _file('image', image)
            self._open()
        elif isinstance(image, list | tuple) or getattr(image, 'ndim', 0) == 4:
            self._frames = list(image)
        if not self._frames:
            raise ValueError('image is an empty sequence; it must have at least one picture.')
        self._last: tuple = (-1, None)
        first = self.read(0)
        #: Width and height in pixels.
        self.size = (first.shape[1], first.shape[0])
        self.mask = None if mask is None else _mask(mask, self.size)

    def __len__(self):
        return len(self._frames)

    def at(self, time, fps=None, loop=True) -> int:
        """Return which picture is shown at a time."""
        number = int(np.floor(time * (fps or self.fps) + 1e-9))
        return number % len(self) if loop else min(max(number, 0), len(self) - 1)

    def read(self, k) -> np.ndarray:
        """Return a picture; the last one is cached."""
        if self._last[0] != k:
            self._last = (k, self._decoded(k))
        picture = self._last[1]
        size = (picture.shape[1], picture.shape[0])
        if size != getattr(self, 'size', size):
            raise ValueError(
                f'image {k} of the sequence has {size} pixels; the first has {self.size}.'
            )
        return picture

    def weighted(self, k, alpha=True) -> np.ndarray:
        """Return a picture with the weight of each pixel as alpha."""
        picture = self.read(k)
        if alpha and self.mask is None:
            return picture
        weight = picture[..., 3] / 255 if alpha else np.ones(picture.shape[:2])
        if self.mask is not None:
            weight = weight * self.mask
        return np.dstack([picture[..., :3], np.rint(255 * weight).astype(np.uint8)])

    def _decoded(self, k):
        if self._film is None:
            return as_rgba(self._frames[k])
        if self._reader is None:
            self._open()
        return as_rgba(np.asarray(self._reader.get_data(k)))

    def _open(self):
        from imageio import v2

        try:
            self._reader = v2.get_reader(self._film)
            meta = self._reader.get_meta_data()
            count = getattr(self._reader, 'count_frames', self._reader.get_length)()
        except Exception as error:
            raise ValueError(
                f'image = {self._film}: imageio cannot read it as a film: {error}'
            ) from error
        shown = float(meta.get('duration') or 0)  # of a GIF's picture, in milliseconds
        self.fps = float(meta.get('fps') or (1e3 / shown if shown else 25.0))
        self._frames = [None] * int(count)

    def close(self):
        """Close the film; it is reopened on demand."""
        if self._reader is not None:
            self._reader.close()
            self._reader = None


class LivePictures:
    """A live texture as pictures."""

    def __init__(self, live, mask=None):
        if mask is not None:
            raise ValueError(
                'mask is given with a live texture: give it a background with alpha 0 instead'
            )
        self.live, self.size = live, live.size

    def at(self, time, fps=None, loop=True) -> int:
        """Return 0: it is one picture that changes."""
        return 0

    def weighted(self, k, alpha=True) -> np.ndarray:
        """Return its current picture."""
        picture = self.live.image()
        if not alpha:
            picture[..., 3] = 255
        return picture

    def close(self):
        """Do nothing: the live texture is not owned."""


class Shown:
    """An image as a texture that shaders sample: a picture, a sequence by time, a live texture."""

    def __init__(self, image, *, repeat=False):
        self.live: Any = image if is_live(image) else None
        self.pictures: Any = None if is_live(image) else Pictures(image)
        self._repeat = repeat
        self._texture: MipTexture | None = None
        self._at: int | None = None

    @property
    def size(self) -> tuple:
        """Width and height in pixels."""
        return self.pictures.size if self.live is None else self.live.size

    @property
    def missing(self) -> str:
        """Why it cannot be shown now, else empty."""
        if self.live is None or self.live.shown is not None:
            return ''
        return 'its live texture is in no subplot, or not drawn yet: add it'

    @property
    def nbytes(self) -> int:
        """Bytes on the GPU; those of a live texture are its own."""
        return self._texture.nbytes if self._texture else 0

    def texture(self, window, time=0.0, fps=None, loop=True) -> Texture:
        """Return the texture of a time, uploaded if the picture changed."""
        if self.live is not None:
            return self.live.shown
        k = self.pictures.at(time, fps, loop)
        if self._texture is None:
            self._texture = MipTexture(window, repeat=self._repeat)
        if self._at != k:
            step = -(-max(self.size) // texture_limit(window))
            self._texture.upload(self.pictures.read(k)[::step, ::step][::-1])
            self._at = k
        return self._texture

    def picture(self, time=0.0, fps=None, loop=True) -> np.ndarray:
        """Return the picture of a time, (h, w, 4) uint8, row 0 at the top."""
        if self.live is not None:
            return self.live.image()
        return self.pictures.read(self.pictures.at(time, fps, loop))

    def release(self):
        """Free what it holds on the GPU and close films; the context is current."""
        if self._texture is not None:
            self._texture.release()
        self._texture = self._at = None
        if self.pictures is not None:
            self.pictures.close()


def is_live(image) -> bool:
    """Return whether an image is a live texture."""
    return hasattr(type(image), 'shown') and hasattr(image, 'size')


def as_rgba(image, name='image') -> np.ndarray:
    """Return a picture, the value of an argument, as colours with alpha."""
    with naming(name, image):
        return _as_rgba(image)


def _as_rgba(image):
    if isinstance(image, str | Path):
        return _read(_file('image', image))
    if hasattr(image, 'to_array'):
        image = image.to_array() if image.GetInput() is not None else ()
    image, given = np.asarray(image), image
    if image.dtype == object:
        raise TypeError(
            f'image must be a file, an array or a texture, not {type(given).__name__}.'
        )
    shape = image.shape if image.ndim == 3 else (*image.shape, 1)
    if len(shape) != 3 or not image.size or shape[2] > 4:
        raise ValueError(
            f'image has the shape {image.shape}; it must be (h, w) or (h, w, 1 to 4), not empty.'
        )
    image = _bytes(image).reshape(shape)
    if shape[2] in (1, 2):
        image = np.concatenate([image[..., :1]] * 3 + [image[..., 1:]], -1)
    if image.shape[2] == 3:
        image = np.dstack([image, np.full(shape[:2], 255, np.uint8)])
    return np.ascontiguousarray(image)


def _bytes(image):
    if image.dtype == np.uint8:
        return image
    if image.dtype == bool:
        return image.astype(np.uint8) * 255
    if image.dtype == np.uint16:
        return np.rint(image / 257.0).astype(np.uint8)
    if not np.issubdtype(image.dtype, np.floating):
        raise ValueError(
            f'image is of dtype {image.dtype}; it must be uint8, uint16, bool or float.'
        )
    low, high = image.min(), image.max()  # NaN where any is
    if not (low >= 0 and high <= 1 + 1e-6):
        raise ValueError(f'image has values from {low} to {high}; floats must be from 0 to 1.')
    return np.rint(np.clip(image, 0, 1) * 255).astype(np.uint8)


def _read(path):
    from imageio import v3

    try:
        with warnings.catch_warnings():  # of readers, which tell of damage and of each other
            warnings.simplefilter('ignore')
            hint = {'extension': path.suffix.lower()} if path.suffix else {}
            image = v3.imread(path.read_bytes(), **hint)  # readers that fail leave files open
        return _as_rgba(image[0] if image.ndim == 4 else image)  # of a GIF the first
    except Exception as error:
        raise ValueError(
            f'image = {path}: imageio cannot read it as a picture: {error}'
        ) from error


def _file(name, path):
    path = Path(path)
    if not path.is_file():
        raise FileNotFoundError(f'{name} = {path}: there is no such file.')
    return path


def _is_film(image):
    return isinstance(image, str | Path) and Path(image).suffix.lower() in _FILMS


def _mask(mask, size):
    """Return a mask as (h, w) float, 0 to 1, of the picture's size."""
    picture = as_rgba(mask, 'mask')
    gray = picture[..., 0] / 255 * (picture[..., 3] / 255)
    if gray.shape == (size[1], size[0]):
        return gray
    u, v = (np.arange(size[0]) + 0.5) / size[0], 1 - (np.arange(size[1]) + 0.5) / size[1]
    uv = np.stack(np.meshgrid(u, v), -1).reshape(-1, 2)
    return sample(gray, uv).reshape(size[1], size[0])


def resized(picture, size):
    """Return a picture in another size, averaged by areas."""
    from PIL import Image

    if picture.shape[1::-1] == tuple(size):
        return picture[..., 0] if picture.shape[2] == 1 else picture
    flat = Image.fromarray(picture[..., 0] if picture.shape[2] == 1 else picture)
    return np.array(flat.resize(size, Image.Resampling.BOX))


def decoded(path, whole, size):
    """Return a picture in another size, of JPEG without decoding all of it; None if it cannot."""
    from PIL import Image

    try:
        with Image.open(path) as file:
            if file.size != tuple(whole) or file.mode not in ('RGB', 'L', 'YCbCr', 'RGBA', 'P'):
                return None
            file.draft('RGB', size)
            return resized(np.array(file.convert('RGBA')), size)
    except OSError:
        return None  # imageio reads more
