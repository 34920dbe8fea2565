"""The atlas: images of an object from all directions, as data."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path

import numpy as np

from pvibr.core.files import replacing
from pvibr.instances.support import SIDE, box_of, table_of
from pvibr.maths import octahedral
from pvibr.maths.views import corners
from pvibr.meshes.turntable import SIDE_ELEVATION, Turntable
from pvibr.things.soft_draws import WHOLE

MARGIN = 1.02  # half side of a tile in radii: silhouettes never touch its border
# Share of covered texels that must be opaque for a separate draw of the core to pay: fine
# details have hardly any.
_OPAQUE_SHARE = 0.6
_ROW_STEP = 3  # one in so many rows of views is looked at
#: Every other byte of a pixel; half a step of each; pixels that stay in a processor's cache.
_EVEN, _ROUNDING, _BLOCK_PIXELS = np.uint32(0x00FF00FF), np.uint32(0x00020002), 2**16


def bounding_sphere(points):
    """Return the sphere around the centre of the bounding box through the farthest point."""
    points = np.asarray(points, float)
    center = (points.min(0) + points.max(0)) / 2
    radius = float(np.sqrt(((points - center) ** 2).sum(1).max()))
    return center, radius if radius > 0 else 1.0


@dataclass
class Atlas:
    """Images of an object on an octahedral grid of views.

    Attributes
    ----------
    geometry : numpy.ndarray, shape (views * tile, views * tile, 4), uint8
        Depth (1 nearest to the camera, over the sphere's diameter), coverage, normal x and y.
    albedo : numpy.ndarray, same shape
        Unlit colour times coverage, normal z.
    center : numpy.ndarray, shape (3,)
        Centre of the bounding sphere, model coordinates.
    radius : float
        Its radius.
    support : numpy.ndarray, shape (33, 33)
        How far the mesh reaches from the centre, in radii, see :mod:`pvibr.instances.support`.
    views, tile : int
        Views along a side; texels along a side of a tile.
    half : bool
        Views cover the upper hemisphere only.
    errors : dict of str to numpy.ndarray
        The measured error table, see :mod:`pvibr.instances.measure`; empty before it is measured.
    seconds : float
        Duration of the bake.
    turntable : Turntable, optional
        Images from around an axis, if asked for.
    """

    geometry: np.ndarray
    albedo: np.ndarray
    center: np.ndarray
    radius: float
    support: np.ndarray
    views: int
    tile: int
    half: bool = False
    errors: dict = field(default_factory=dict)
    seconds: float = 0.0
    turntable: Turntable | None = None
    #: True for views of several poses, see `pose_atlas`.
    animated = False

    @classmethod
    def blank(cls, points, *, half=False) -> Atlas:
        """Return an atlas without images but with the sphere and box of a mesh's points.

        Parameters
        ----------
        points : array_like, shape (n, 3)
            Points of the mesh.
        half : bool, default: False
            True for a mesh that is seen from above only.

        Returns
        -------
        Atlas
            The atlas.
        """
        points = np.asarray(points, float)
        blank_image = np.zeros((8, 8, 4), np.uint8)
        center, radius = bounding_sphere(points)
        # The support of the box will do: hulls of many points take seconds.
        (box_corners,) = corners(np.stack([points.min(0), points.max(0)], 1).ravel())
        support = table_of((box_corners - center) / radius)
        grid = {'views': 2, 'tile': 4, 'half': half}
        return cls(blank_image, blank_image.copy(), center, radius, support, **grid)

    @property
    def n_poses(self) -> int:
        """Number of poses: 1, unless it is animated."""
        return 1

    @property
    def box(self) -> np.ndarray:
        """Lowest and highest coordinates of the mesh, shape (2, 3), model coordinates."""
        return self.center + self.radius * box_of(self.support)

    @property
    def nbytes(self) -> int:
        """Bytes of GPU memory of the images, mip levels included."""
        pictures = [self.geometry, self.albedo]
        if self.turntable is not None:
            pictures += [self.turntable.geometry, self.turntable.albedo]
        return sum(p.nbytes for p in pictures) * 3 // 2

    @cached_property
    def card_uniforms(self) -> dict:
        """What shaders of cards read of it; programs of several sets compare the objects."""
        uniforms = {
            'ibr_views': self.views,
            'ibr_half': int(self.half),
            'ibr_tile': self.tile,
            'ibr_radius': self.radius,
            'ibr_margin': MARGIN,
            'ibr_box_center': tuple((self.box.mean(0) - self.center) / self.radius),
            'ibr_box_half': tuple(np.ptp(self.box, axis=0) / 2 / self.radius),
            'ibr_core_level': float(self.core_level),
        }
        if self.turntable is not None:
            sides = self.turntable.turns.sides()
            uniforms |= {
                'ibr_turn_level': SIDE_ELEVATION,
                'ibr_turn_axis': tuple(map(float, sides[2])),
                'ibr_turn_start': tuple(map(float, sides[0])),
            }
        return uniforms

    @cached_property
    def core_level(self) -> int:
        """Coarsest mip level that is mostly opaque, -1 if none is."""
        alpha = self.geometry[..., 1]
        alpha = alpha.reshape(-1, self.tile, alpha.shape[-1])[::_ROW_STEP].astype(np.float32)
        mip_level = -1
        while (alpha >= 255 * WHOLE).sum() > _OPAQUE_SHARE * (alpha > 0).sum() and len(
            alpha[0]
        ) > 1:
            n_rows, side, width = alpha.shape
            alpha = alpha.reshape(n_rows, side // 2, 2, width // 2, 2).mean((2, 4))
            mip_level += 1
        return mip_level

    @cached_property
    def opaque_share(self) -> float:
        """Share of an image that is opaque, of the square around the bounding sphere."""
        return float((self.geometry[::_ROW_STEP, :, 1] == 255).mean()) * MARGIN**2

    def textures(self):
        """Return geometry and albedo with their mip levels.

        Returns
        -------
        list of numpy.ndarray, shape (side, 3 * side / 2, 4), uint8
            Level 0 at the left, the others stacked at the right; each tile is averaged by itself.
        """
        return [pyramid(image, self.tile) for image in (self.geometry, self.albedo)]

    def to_arrays(self) -> dict:
        """Return everything as named arrays, for a file."""
        numbers = np.array([*self.center, self.radius, self.seconds], float)
        grid = np.array([self.views, self.tile, self.half], np.int64)
        arrays = {
            'geometry': self.geometry,
            'albedo': self.albedo,
            'sphere': numbers,
            'grid': grid,
        }
        arrays['support'] = self.support
        arrays |= self.turntable.to_arrays() if self.turntable is not None else {}
        return arrays | {f'errors.{k}': np.asarray(v) for k, v in self.errors.items()}

    @classmethod
    def from_arrays(cls, arrays) -> Atlas:
        """Return an atlas from named arrays, checked.

        Parameters
        ----------
        arrays : mapping of str to numpy.ndarray
            As :meth:`to_arrays` returns them.

        Returns
        -------
        Atlas
            The atlas.

        Raises
        ------
        ValueError
            If an array is missing or of the wrong shape or type.
        """
        try:
            views, tile, half = (int(v) for v in arrays['grid'])
            sphere = np.asarray(arrays['sphere'], float)
            support = np.asarray(arrays['support'], float)
            images = [np.asarray(arrays[k]) for k in ('geometry', 'albedo')]
        except (KeyError, TypeError, ValueError) as err:
            raise ValueError(f'not an atlas: {err}') from err
        shape = (views * tile, views * tile, 4)
        is_valid = sphere.shape == (5,) and np.isfinite(sphere).all() and sphere[3] > 0
        is_valid = is_valid and support.shape == (SIDE, SIDE) and np.isfinite(support).all()
        if not is_valid or any(p.shape != shape or p.dtype != np.uint8 for p in images):
            raise ValueError(f'not an atlas: images must be {shape} uint8, with a sphere')
        errors = {k[7:]: np.asarray(arrays[k]) for k in arrays if k.startswith('errors.')}
        geometry, albedo = images
        return cls(
            geometry,
            albedo,
            sphere[:3],
            float(sphere[3]),
            support,
            views,
            tile,
            bool(half),
            errors,
            seconds=float(sphere[4]),
            turntable=Turntable.from_arrays(arrays),
        )

    def save(self, path):
        """Write an ``.npz`` file atomically.

        Parameters
        ----------
        path : str or os.PathLike
            File to write; an existing one is replaced.
        """
        with replacing(path) as part, part.open('wb') as file:
            np.savez(file, **self.to_arrays())

    @classmethod
    def load(cls, path) -> Atlas:
        """Read a file written by :meth:`save`.

        Parameters
        ----------
        path : str or os.PathLike
            The file.

        Returns
        -------
        Atlas
            The atlas.

        Raises
        ------
        ValueError
            If the file is not an atlas.
        """
        import zipfile

        try:
            with Path(path).open('rb') as file, np.load(file, allow_pickle=False) as data:
                return cls.from_arrays({k: data[k] for k in data.files})
        except (zipfile.BadZipFile, EOFError, OSError) as err:
            if isinstance(err, FileNotFoundError):
                raise
            raise ValueError(f'{path}: not an atlas: {err}') from err

    def contact_sheet(self, path=None, background=1.0) -> np.ndarray:
        """Return all views side by side as an image, optionally saved.

        Parameters
        ----------
        path : str or os.PathLike, optional
            A PNG to write.
        background : float
            Grey level behind the object.

        Returns
        -------
        numpy.ndarray, shape (2 * views * tile, views * tile, 3), uint8
            Albedo over normals, top row first.
        """
        coverage = self.geometry[..., 1:2] / 255.0
        color = self.albedo[..., :3] / 255.0 + (1 - coverage) * background
        normal = np.concatenate([self.geometry[..., 2:], self.albedo[..., 3:]], -1) / 255.0
        normal = normal + (1 - coverage) * (background - 0.5)
        sheet = np.concatenate([color[::-1], normal[::-1]])
        sheet = np.rint(255 * np.clip(sheet, 0, 1)).astype(np.uint8)
        if path is not None:
            import imageio.v3 as iio

            iio.imwrite(path, sheet)
        return sheet

    def directions(self) -> np.ndarray:
        """Return the unit vectors from the object to the cameras, (views, views, 3)."""
        return octahedral.view_directions(self.views, self.half)


def pyramid(image, tile) -> np.ndarray:
    """Return an image with its mip levels stacked at the right, averaged within each tile."""
    side = len(image)
    pyramid_image = np.zeros((side, side * 3 // 2, 4), np.uint8)
    pyramid_image[:, :side] = image
    mip_image, row = image, 0
    for _ in range(tile.bit_length() - 1):
        mip_image = _halve(mip_image)
        size = len(mip_image)
        pyramid_image[row : row + size, side : side + size] = mip_image
        row += size
    return pyramid_image


def _halve(picture):
    """Return the rounded means of 2 x 2 pixels."""
    # Two channels at a time, as halves of whole numbers, and rows that stay in the cache.
    pixels = np.ascontiguousarray(picture).view(np.uint32)[..., 0]
    halved = np.empty((len(pixels) // 2, pixels.shape[1] // 2), np.uint32)
    step = max(2 * (_BLOCK_PIXELS // pixels.shape[1] // 2), 2)
    for first in range(0, len(pixels), step):
        block = pixels[first : first + step]
        even, odd = _means(block & _EVEN), _means((block >> 8) & _EVEN)
        odd <<= 8
        np.bitwise_or(even, odd, out=halved[first // 2 : (first + step) // 2])
    return halved.view(np.uint8).reshape(*halved.shape, 4)


def _means(channels):
    """Return the rounded means of 2 x 2 pixels of two channels, each in 16 bits of its own."""
    sums = channels[::2] + channels[1::2]
    sums = sums[:, ::2] + sums[:, 1::2]
    sums += _ROUNDING
    sums >>= 2
    sums &= _EVEN
    return sums
