"""Captioned images side by side, and error maps in colour."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from pvibr.core.files import replacing

_CAPTION, _PER_WIDTH = 26, 32  # caption height: minimum in pixels; image width over height


def error_colors(error) -> np.ndarray:
    """Return an error map as colours, from black at 0 over red to pale yellow."""
    from matplotlib import colormaps

    return colormaps['magma'](np.clip(error, 0, 1))[..., :3]


def as_bytes(picture) -> np.ndarray:
    """Return an image with values in [0, 1] as uint8."""
    return np.rint(np.clip(picture, 0, 1) * 255).astype(np.uint8)


#: Suffixes that :func:`save` writes.
IMAGES = ('.png', '.jpg', '.jpeg', '.tif', '.tiff', '.webp', '.bmp')


def check_image(path):
    """Raise if :func:`save` cannot write a file with this suffix."""
    if Path(path).suffix.lower() not in IMAGES:
        raise ValueError(f'path must end in one of {", ".join(IMAGES)}, got {str(path)!r}')


def save(path, picture):
    """Write an image in the format of its suffix."""
    from PIL import Image

    picture = picture if picture.dtype == np.uint8 else as_bytes(picture)
    with replacing(path) as file:
        Image.fromarray(picture).save(file)


def compose(captioned_pictures, columns=3) -> np.ndarray:
    """Return a montage of images of one size, each below its caption."""
    captioned_tiles = [_captioned(picture, text) for picture, text in captioned_pictures]
    tile_rows = [captioned_tiles[k : k + columns] for k in range(0, len(captioned_tiles), columns)]
    blank_tile = np.full_like(captioned_tiles[0], 255)
    row_length = min(columns, len(captioned_tiles))
    return np.concatenate(
        [_beside(row + [blank_tile] * (row_length - len(row))) for row in tile_rows]
    )


def _beside(tiles):
    padded = [np.pad(tile, ((0, 0), (4, 0), (0, 0)), constant_values=255) for tile in tiles[1:]]
    return np.concatenate([tiles[0], *padded], axis=1)


def _captioned(picture, text):
    from PIL import Image, ImageDraw, ImageFont

    caption_height = max(_CAPTION, picture.shape[1] // _PER_WIDTH)
    caption_line = Image.new('RGB', (picture.shape[1], caption_height), 'white')
    font = ImageFont.load_default(size=caption_height * 0.66)
    ImageDraw.Draw(caption_line).text((4, 3), text, fill='black', font=font)
    return np.concatenate([np.asarray(caption_line), as_bytes(picture)])
