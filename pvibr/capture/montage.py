"""Images side by side with captions, and error maps in colour."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from pvibr.core.files import replacing

_CAPTION, _PER_WIDTH = 26, 32  # height of a caption: minimum, and image width per height


def error_colors(error) -> np.ndarray:
    """Return an error map as colours: 0 black, over red to pale yellow."""
    from matplotlib import colormaps

    return colormaps['magma'](np.clip(error, 0, 1))[..., :3]


def as_bytes(picture) -> np.ndarray:
    """Return an image with values from 0 to 1 as uint8."""
    return np.rint(np.clip(picture, 0, 1) * 255).astype(np.uint8)


#: Endings of the files that :func:`save` writes.
IMAGES = ('.png', '.jpg', '.jpeg', '.tif', '.tiff', '.webp', '.bmp')


def check_image(path):
    """Raise if :func:`save` cannot write a file of this ending."""
    if Path(path).suffix.lower() not in IMAGES:
        raise ValueError(f'{path} must end in one of {", ".join(IMAGES)}.')


def save(path, picture):
    """Write an image in the format of its ending."""
    from PIL import Image

    picture = picture if picture.dtype == np.uint8 else as_bytes(picture)
    with replacing(path) as file:
        Image.fromarray(picture).save(file)


def compose(pictures, columns=3) -> np.ndarray:
    """Return images of the same size side by side, each below its caption."""
    tiles = [_captioned(picture, text) for picture, text in pictures]
    rows = [tiles[k : k + columns] for k in range(0, len(tiles), columns)]
    blank = np.full_like(tiles[0], 255)
    width = min(columns, len(tiles))
    return np.concatenate([_beside(row + [blank] * (width - len(row))) for row in rows])


def _beside(tiles):
    gap = np.full((tiles[0].shape[0], 4, 3), 255, np.uint8)
    parts = [tiles[0]]
    for tile in tiles[1:]:
        parts += [gap, tile]
    return np.concatenate(parts, axis=1)


def _captioned(picture, text):
    from PIL import Image, ImageDraw, ImageFont

    height = max(_CAPTION, picture.shape[1] // _PER_WIDTH)
    line = Image.new('RGB', (picture.shape[1], height), 'white')
    font = ImageFont.load_default(size=height * 0.66)
    ImageDraw.Draw(line).text((4, 3), text, fill='black', font=font)
    return np.concatenate([np.asarray(line), as_bytes(picture)])
