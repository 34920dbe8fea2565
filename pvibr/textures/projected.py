"""Images from files, arrays, textures, films and live textures."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import Any

import numpy as np

from pvibr.core.arguments import naming
from pvibr.gl import MipTexture, Texture, release, texture_limit
from pvibr.maths.draping import sample

NO_LIVE_PICTURE = 'its live texture is in no subplot or not rendered yet: add it'
_DRAFT_MODES = ('RGB', 'L', 'YCbCr', 'RGBA', 'P')
_FILMS = ('.avi', '.gif', '.m4v', '.mkv', '.mov', '.mp4', '.mpeg', '.mpg', '.webm')


class Pictures:
    """One picture, or a sequence of them over time."""

    def __init__(self, image, mask=None):
        self.fps = 25.0
        self._film: Path | None = None
        self._reader: Any = None
        self._frames = [image]
        if isinstance(image, str | Path) and Path(image).suffix.lower() in _FILMS:
            self._film = _file('image', image)
            self._open()
        elif isinstance(image, list | tuple) or getattr(image, 'ndim', 0) == 4:
            self._frames = list(image)
        if not self._frames:
            raise ValueError('image must have at least one picture, got an empty sequence')
        self._last: tuple = (-1, None)
        first_picture = self.read(0)
        #: Width and height in pixels.
        self.size = (first_picture.shape[1], first_picture.shape[0])
        self.mask = None if mask is None else _mask(mask, self.size)

    def __len__(self):
        return len(self._frames)

    def at(self, time, fps=None, loop=True) -> int:
        """Return the index of the picture at a time."""
        frame_number = int(np.floor(time * (fps or self.fps) + 1e-9))
        return frame_number % len(self) if loop else min(max(frame_number, 0), len(self) - 1)

    def read(self, index) -> np.ndarray:
        """Return a picture; the last one is cached."""
        if self._last[0] != index:
            self._last = (index, self._decoded(index))
        picture = self._last[1]
        size = (picture.shape[1], picture.shape[0])
        if size != getattr(self, 'size', size):
            raise ValueError(f'image {index} must be {self.size} as the first, got {size}')
        return picture

    def weighted(self, picture_index, alpha=True) -> np.ndarray:
        """Return a picture with the weight of each pixel as alpha."""
        picture = self.read(picture_index)
        if alpha and self.mask is None:
            return picture
        pixel_weights = picture[..., 3] / 255 if alpha else np.ones(picture.shape[:2])
        if self.mask is not None:
            pixel_weights = pixel_weights * self.mask
        return np.dstack([picture[..., :3], np.rint(255 * pixel_weights).astype(np.uint8)])

    def _decoded(self, picture_index):
        if self._film is None:
            return as_rgba(self._frames[picture_index])
        if self._reader is None:
            self._open()
        return as_rgba(np.asarray(self._reader.get_data(picture_index)))

    def _open(self):
        from imageio import v2

        try:
            self._reader = v2.get_reader(self._film)
            metadata = self._reader.get_meta_data()
            frame_count = getattr(self._reader, 'count_frames', self._reader.get_length)()
        except Exception as error:
            raise ValueError(
                f'image must be readable by imageio, got {self._film}: {error}'
            ) from error
        duration = float(metadata.get('duration') or 0)  # of a GIF's frame, milliseconds
        self.fps = float(metadata.get('fps') or (1e3 / duration if duration else 25.0))
        self._frames = [None] * int(frame_count)

    def close(self):
        """Close the film; it is reopened on demand."""
        if self._reader is not None:
            self._reader.close()
            self._reader = None


class LivePictures:
    """A live texture as pictures."""

    def __init__(self, live, mask=None):
        if mask is not None:
            raise ValueError('mask must be None for a live texture: set background alpha to 0')
        self.live, self.size = live, live.size

    def at(self, time, fps=None, loop=True) -> int:
        """Return 0, its only picture."""
        return 0

    def weighted(self, picture_index, alpha=True) -> np.ndarray:
        """Return its current picture."""
        picture = self.live.image()
        if not alpha:
            picture[..., 3] = 255
        return picture

    def close(self):
        """Do nothing, as the live texture is not owned."""


class Shown:
    """An image as a texture for shaders: a picture, sequence or live texture."""

    def __init__(self, image, *, repeat=False, has_coverage=False):
        """Let the alpha of an image be its coverage if told so; else it is any fourth channel."""
        self.live: Any = image if is_live(image) else None
        self.pictures: Any = None if is_live(image) else Pictures(image)
        self._repeat, self._has_coverage = repeat, has_coverage
        self._texture: MipTexture | None = None
        self._shown_index: int | None = None

    @property
    def size(self) -> tuple:
        """Width and height in pixels."""
        return self.pictures.size if self.live is None else self.live.size

    @property
    def missing(self) -> str:
        """Why it cannot be shown now, empty if it can."""
        if self.live is None or self.live.shown is not None:
            return ''
        return NO_LIVE_PICTURE

    @property
    def nbytes(self) -> int:
        """Bytes on the GPU, 0 for a live texture."""
        return self._texture.nbytes if self._texture else 0

    def texture(self, window, time=0.0, fps=None, loop=True) -> Texture:
        """Return the texture at a time, uploaded if the picture changed."""
        if self.live is not None:
            return self.live.shown
        index = self.pictures.at(time, fps, loop)
        if self._texture is None:
            self._texture = MipTexture(window, repeat=self._repeat)
        if self._shown_index != index:
            step = -(-max(self.size) // texture_limit(window))
            picture = self.pictures.read(index)[::step, ::step]
            if self._has_coverage:
                upload(self._texture, picture, keep=len(self.pictures) > 1)
            else:
                self._texture.upload(picture[::-1])
            self._shown_index = index
        return self._texture

    def picture(self, time=0.0, fps=None, loop=True) -> np.ndarray:
        """Return the picture at a time, (h, w, 4) uint8, row 0 at the top."""
        if self.live is not None:
            return self.live.image()
        return self.pictures.read(self.pictures.at(time, fps, loop))

    def release(self):
        """Free what it holds on the GPU and close films; the context is current."""
        release(self._texture)
        self._texture = self._shown_index = None
        if self.pictures is not None:
            self.pictures.close()


def upload(texture, picture, keep):
    """Upload a picture, top row first, of which no mip level shows what is transparent.

    `keep` what this allocates for the next one.
    """
    texture.upload(picture[::-1])
    if picture[..., 3].min() < 255:
        texture.dilate(keep=keep)


def is_live(image) -> bool:
    """Return whether an image is a live texture."""
    return hasattr(type(image), 'shown') and hasattr(image, 'size')


def as_rgba(image, name='image') -> np.ndarray:
    """Return an image argument as RGBA, (h, w, 4) uint8."""
    with naming(name, image):
        return _as_rgba(image)


def _as_rgba(image):
    if isinstance(image, str | Path):
        return _read(_file('image', image))
    if hasattr(image, 'to_array'):
        image = image.to_array() if image.GetInput() is not None else ()
    image, original = np.asarray(image), image
    if image.dtype == object:
        kind = type(original).__name__
        raise TypeError(f'image must be a file, an array or a texture, got {kind}')
    shape = image.shape if image.ndim == 3 else (*image.shape, 1)
    if len(shape) != 3 or not image.size or shape[2] > 4:
        raise ValueError(f'image must have shape (h, w) or (h, w, 1 to 4), got {image.shape}')
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
        raise ValueError(f'image must have dtype uint8, uint16, bool or float, got {image.dtype}')
    lowest, highest = image.min(), image.max()  # NaN if any is
    if not (lowest >= 0 and highest <= 1 + 1e-6):
        raise ValueError(f'image must have floats from 0 to 1, got {lowest} to {highest}')
    return np.rint(np.clip(image, 0, 1) * 255).astype(np.uint8)


def _read(path):
    from imageio import v3

    try:
        with warnings.catch_warnings():  # of image readers
            warnings.simplefilter('ignore')
            hint = {'extension': path.suffix.lower()} if path.suffix else {}
            image = v3.imread(path.read_bytes(), **hint)  # failing readers leave files open
        return _as_rgba(image[0] if image.ndim == 4 else image)  # the first of a GIF
    except Exception as error:
        raise ValueError(f'image must be readable by imageio, got {path}: {error}') from error


def _file(name, path):
    path = Path(path)
    if not path.is_file():
        raise FileNotFoundError(f'{name} must be an existing file, got {path}')
    return path


def _mask(mask, size):
    """Return a mask resampled to a size, (h, w) float, 0 to 1."""
    picture = as_rgba(mask, 'mask')
    gray_mask = picture[..., 0] / 255 * (picture[..., 3] / 255)
    if gray_mask.shape == (size[1], size[0]):
        return gray_mask
    u, v = (np.arange(size[0]) + 0.5) / size[0], 1 - (np.arange(size[1]) + 0.5) / size[1]
    uv = np.stack(np.meshgrid(u, v), -1).reshape(-1, 2)
    return sample(gray_mask, uv).reshape(size[1], size[0])


def resized(picture, size):
    """Return a picture in another size, by area averages weighted by alpha."""
    from PIL import Image

    if picture.shape[1::-1] == tuple(size):
        return picture[..., 0] if picture.shape[2] == 1 else picture

    def mean(values):
        return np.array(Image.fromarray(values).resize(size, Image.Resampling.BOX))

    if picture.shape[2] == 1 or picture[..., 3].min() == 255:
        return mean(picture[..., 0] if picture.shape[2] == 1 else picture)
    # Pillow's own weighting rounds colours times alpha to bytes.
    alpha = picture[..., 3].astype(np.float32)
    mean_alpha = mean(alpha)
    sums = np.stack([mean(picture[..., k] * alpha) for k in range(3)] + [mean_alpha**2], -1)
    return np.rint(sums / np.maximum(mean_alpha, 1e-6)[..., None]).astype(np.uint8)


def decoded(path, full_size, size):
    """Return a picture file in another size, decoding only part of a JPEG; None if unsupported."""
    from PIL import Image

    try:
        with Image.open(path) as file:
            if file.size != tuple(full_size) or file.mode not in _DRAFT_MODES:
                return None
            file.draft('RGB', size)
            return resized(np.array(file.convert('RGBA')), size)
    except OSError:
        return None  # imageio supports more formats
