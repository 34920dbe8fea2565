"""The atlas: images of an object from all sides, as data."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path

import numpy as np

from pvibr.core.files import replacing
from pvibr.maths import octahedral
from pvibr.maths.support import SIDE, box_of, support_table
from pvibr.maths.views import corners
from pvibr.meshes.turntable import Turntable
from pvibr.scene.soft_draws import WHOLE

MARGIN = 1.02  # half side of a tile in radii: the silhouette never touches its border
# Share of what is covered below which two draws of it cost more than they mend: what is small and
# scattered has hardly an opaque pixel.
_MOST = 0.6
_SOME = 3  # rows of views, of which one is asked


def bounding_sphere(points):
    """Return a sphere that holds all points: the box's centre and the farthest point from it."""
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
        How far the mesh reaches from the centre, in radii, see :mod:`pvibr.maths.support`.
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
        """Return an atlas without images, for a driver that cannot render them.

        Parameters
        ----------
        points : array_like, shape (n, 3)
            Those of the mesh.
        half : bool, default: False
            True for a mesh that is seen from above only.

        Returns
        -------
        Atlas
            With the right sphere and box.
        """
        points = np.asarray(points, float)
        picture = np.zeros((8, 8, 4), np.uint8)
        center, radius = bounding_sphere(points)
        # Without cards its box will do: hulls of many points take seconds.
        (ends,) = corners(np.stack([points.min(0), points.max(0)], 1).ravel())
        support = support_table((ends - center) / radius)
        grid = {'views': 2, 'tile': 4, 'half': half}
        return cls(picture, picture.copy(), center, radius, support, **grid)

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
        """GPU memory of the images, mip levels included."""
        pictures = [self.geometry, self.albedo]
        if self.turntable is not None:
            pictures += [self.turntable.geometry, self.turntable.albedo]
        return sum(p.nbytes for p in pictures) * 3 // 2

    @cached_property
    def core_level(self) -> int:
        """Coarsest level of which most is opaque, -1 if none is."""
        tile, covered = self.tile, self.geometry[..., 1]
        some = covered.reshape(-1, tile, covered.shape[-1])[::_SOME].astype(np.float32)
        level = -1
        while (some >= 255 * WHOLE).sum() > _MOST * (some > 0).sum() and some.shape[1] > 1:
            rows, side, width = some.shape
            some = some.reshape(rows, side // 2, 2, width // 2, 2).mean((2, 4))
            level += 1
        return level

    def textures(self):
        """Return geometry and albedo with all mip levels beside them.

        Returns
        -------
        list of numpy.ndarray, shape (side, 3 * side / 2, 4), uint8
            Level 0 at the left, the others stacked at the right; tiles are averaged separately,
            which mip levels of a driver do not guarantee.
        """
        return [pyramid(p, self.tile) for p in (self.geometry, self.albedo)]

    def to_arrays(self) -> dict:
        """Return everything as named arrays, for a file."""
        numbers = np.array([*self.center, self.radius, self.seconds], float)
        grid = np.array([self.views, self.tile, self.half], np.int64)
        out = {'geometry': self.geometry, 'albedo': self.albedo, 'sphere': numbers, 'grid': grid}
        out['support'] = self.support
        out |= self.turntable.to_arrays() if self.turntable is not None else {}
        return out | {f'errors.{k}': np.asarray(v) for k, v in self.errors.items()}

    @classmethod
    def from_arrays(cls, arrays) -> Atlas:
        """Return an atlas of named arrays, checked.

        Parameters
        ----------
        arrays : mapping of str to numpy.ndarray
            As :meth:`to_arrays` gives.

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
            pictures = [np.asarray(arrays[k]) for k in ('geometry', 'albedo')]
        except (KeyError, TypeError, ValueError) as err:
            raise ValueError(f'not an atlas: {err}') from err
        side = views * tile
        good = sphere.shape == (5,) and np.isfinite(sphere).all() and sphere[3] > 0
        good = good and support.shape == (SIDE, SIDE) and np.isfinite(support).all()
        if not good or any(p.shape != (side, side, 4) or p.dtype != np.uint8 for p in pictures):
            raise ValueError(
                f'not an atlas: pictures must be ({side}, {side}, 4) uint8 with a sphere'
            )
        errors = {k[7:]: np.asarray(arrays[k]) for k in arrays if k.startswith('errors.')}
        geometry, albedo = pictures
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
        """Read from a file written by :meth:`save`.

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


def pyramid(picture, tile) -> np.ndarray:
    """Return an image with all mip levels beside it."""
    side = len(picture)
    out = np.zeros((side, side * 3 // 2, 4), np.uint8)
    out[:, :side] = picture
    level, row = picture, 0
    for _ in range(tile.bit_length() - 1):
        level = _halve(level)
        out[row : row + len(level), side : side + len(level)] = level
        row += len(level)
    return out


def _halve(picture):
    rows = picture[0::2].astype(np.uint16) + picture[1::2]
    return ((rows[:, 0::2] + rows[:, 1::2] + 2) >> 2).astype(np.uint8)
