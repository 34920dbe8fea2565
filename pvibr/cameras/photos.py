"""Photographs with their calibrated cameras."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from pvibr.cameras.files import Place
from pvibr.images.projected import as_rgba, decoded, resized
from pvibr.maths.arguments import checked_numbers, checked_whole, naming
from pvibr.maths.draping import sample
from pvibr.maths.lens_camera import LensCamera
from pvibr.maths.lenses import Lens
from pvibr.maths.orthographic import Orthographic
from pvibr.maths.pinhole import Pinhole

_MOST_TEXELS = 4096  # of a thumbnail
_ROWS = 256  # of a picture that are resampled at once


@dataclass(frozen=True, eq=False, repr=False)
class Photo:
    """A photograph and its calibrated camera.

    The camera's axes are x right, y down, z ahead; integer coordinates are pixel centres, as in
    OpenCV, whatever the convention of the file.

    Parameters
    ----------
    name : str
        As the file names it.
    camera : Pinhole, LensCamera or Orthographic
        The calibrated camera, whose size is that of the picture.
    path : pathlib.Path, optional
        The picture, if it was found.
    crs : str, optional
        Coordinate reference system, if the file gives one.

    Examples
    --------
    >>> import pvibr
    >>> K = [[100.0, 0.0, 49.5], [0.0, 100.0, 24.5], [0.0, 0.0, 1.0]]
    >>> camera = pvibr.Pinhole(K, np.eye(3), [0.0, 0.0, 5.0], (100, 50))
    >>> photo = pvibr.Photo('a.jpg', camera)
    >>> photo
    Photo('a.jpg', 100 x 50, at [0, 0, -5], no picture)
    >>> photo.world_from_camera[2].tolist()
    [0.0, 0.0, 1.0, -5.0]
    """

    name: str
    camera: Any
    path: Path | None = None
    crs: str | None = None

    def __post_init__(self):
        for name in ('name', 'crs'):
            text: object = getattr(self, name)
            if not isinstance(text, str) and (text is not None or name == 'name'):
                raise TypeError(f'{name} = {text!r:.80}: must be text')
        if not isinstance(self.camera, Pinhole | LensCamera | Orthographic):
            raise TypeError(
                f'camera = {self.camera!r:.80}: must be a Pinhole, LensCamera or Orthographic'
            )
        if self.path is not None:
            with naming('path', self.path):
                object.__setattr__(self, 'path', Path(self.path))

    def __repr__(self):
        width, height = self.size
        place = ', '.join(f'{x:.6g}' for x in self.position + 0.0)
        end = '' if self.path else ', no picture'
        return f'Photo({self.name!r}, {width} x {height}, at [{place}]{end})'

    @property
    def size(self) -> tuple:
        """Width and height in pixels."""
        return self.camera.size

    @property
    def width(self) -> int:
        """In pixels."""
        return self.size[0]

    @property
    def height(self) -> int:
        """In pixels."""
        return self.size[1]

    @property
    def model(self) -> str:
        """Name of the projection, such as ``'pinhole'``, ``'equidistant'``, ``'orthographic'``."""
        lens = getattr(self.camera, 'lens', None)
        return type(self.camera).__name__.lower() if lens is None else lens.kind

    @property
    def K(self) -> np.ndarray:
        """Focal lengths, skew and principal point, (3, 3); not of an orthophoto."""
        return self.camera.K

    @property
    def distortion(self):
        """OpenCV's k1, k2, p1, p2, k3 .. k6 of a pinhole, else the :class:`Lens`."""
        return self.camera.lens if isinstance(self.camera, LensCamera) else self.camera.distortion

    @property
    def position(self) -> np.ndarray:
        """Where the camera is, (3,), in world units; of an orthophoto, its lower left corner."""
        ortho = isinstance(self.camera, Orthographic)
        return self.camera.origin if ortho else self.camera.position

    @property
    def camera_from_world(self) -> np.ndarray:
        """The matrix into the camera's axes, (4, 4): x right, y down, z ahead."""
        return np.diag([1.0, -1.0, -1.0, 1.0]) @ self.camera.view_from_world

    @property
    def world_from_camera(self) -> np.ndarray:
        """The inverse of `camera_from_world`, (4, 4)."""
        return np.linalg.inv(self.camera_from_world)

    def read(self, size=None) -> np.ndarray:
        """Read the picture.

        Parameters
        ----------
        size : tuple of 2 int, optional
            Width and height of the result; by default those of the picture. Smaller JPEG images
            are decoded faster.

        Returns
        -------
        numpy.ndarray, shape (h, w, 4), uint8
            Row 0 at the top.

        Raises
        ------
        ValueError
            If there is no picture, it cannot be read, or its size is not the camera's.
        """
        if self.path is None:
            raise ValueError(
                f'{self.name!r} has no picture: read_cameras(..., images=) names their folder'
            )
        small = None if size is None else decoded(self.path, self.size, size)
        if small is not None:
            return small
        picture = as_rgba(self.path)
        high, wide = picture.shape[:2]
        if (wide, high) != self.size:
            raise ValueError(
                f'{self.path} has {wide} x {high} pixels; its camera has {self.size}.'
            )
        return picture if size is None else resized(picture, size)

    def slides(self) -> list:
        """Return what a projector takes: pictures, pinhole cameras and masks.

        A lens that a pinhole with rational distortion cannot follow by 0.01 pixels is resampled:
        to one picture up to 120 degrees, beyond that to faces of a cube.

        Returns
        -------
        list of tuple
            (path or array, Pinhole or Orthographic, None or array) of each.

        Raises
        ------
        ValueError
            If there is no picture.
        """
        if self.path is None:
            self.read()
        if not isinstance(self.camera, LensCamera):
            return [(self.path, self.camera, None)]
        try:
            return [(self.path, self.camera.as_pinhole(), None)]
        except ValueError:
            picture = self.read()
        return [resampled(self.camera, picture, face) for face in self.camera.faces()]

    def to_pyvista(self):
        """Return PyVista's camera with this view.

        In a window of the picture's aspect ratio it shows what the photograph shows, except for
        the lens: VTK has no distortion, one focal length (the vertical one) and no skew. Panoramas
        look ahead with a view angle of 90 degrees.

        Returns
        -------
        pyvista.Camera
            For ``plotter.camera``.

        Examples
        --------
        >>> import pvibr
        >>> K = [[100.0, 0.0, 49.5], [0.0, 100.0, 49.5], [0.0, 0.0, 1.0]]
        >>> photo = pvibr.Photo('a.jpg', pvibr.Pinhole(K, np.eye(3), [0, 0, 5], (100, 100)))
        >>> camera = photo.to_pyvista()
        >>> camera.position, camera.up, round(camera.view_angle, 3)
        ((0.0, 0.0, -5.0), (0.0, -1.0, 0.0), 53.13)
        """
        import pyvista as pv

        found, height = pv.Camera(), self.height
        right, down, ahead = self.camera_from_world[:3, :3]
        found.up = -down
        if isinstance(self.camera, Orthographic):
            found.parallel_projection = True
            found.parallel_scale = self.camera.height / 2
            middle = self.position + (self.camera.width * right - self.camera.height * down) / 2
            found.position, found.focal_point = middle - self.camera.height * ahead, middle
            return found
        found.position, found.focal_point = self.position, self.position + ahead
        K = self.camera.K * getattr(getattr(self.camera, 'lens', None), 'focus', 1.0)
        if self.model in ('spherical', 'cylindrical'):
            found.view_angle = 90.0
            return found
        found.view_angle = np.degrees(2 * np.arctan(height / (2 * K[1, 1])))
        shift = (2 * self.camera.K[:2, 2] + 1) / self.size - 1
        found.SetWindowCenter(-shift[0], shift[1])
        return found

    def transformed(self, matrix):
        """Return the photograph moved, turned and scaled with the world.

        Parameters
        ----------
        matrix : array_like, shape (4, 4)
            New world from old world: a rotation, a uniform scale and a translation.

        Returns
        -------
        Photo
            The photograph, which sees the moved world as this one sees the old.

        Raises
        ------
        ValueError
            If the matrix is no similarity, or this is an orthophoto.

        Examples
        --------
        >>> import pvibr
        >>> K = [[100.0, 0.0, 49.5], [0.0, 100.0, 49.5], [0.0, 0.0, 1.0]]
        >>> photo = pvibr.Photo('a.jpg', pvibr.Pinhole(K, np.eye(3), [0, 0, 5], (100, 100)))
        >>> photo.transformed(np.diag([2.0, 2.0, 2.0, 1.0])).position.tolist()
        [0.0, 0.0, -10.0]
        """
        matrix = checked_numbers('matrix', matrix, (4, 4))
        turn, scale = similarity(matrix[:3, :3], 'matrix')
        if isinstance(self.camera, Orthographic) or matrix[3].tolist() != [0, 0, 0, 1]:
            raise ValueError(
                f'matrix is {matrix.tolist()}, of {self!r}; perspective and orthophotos are not '
                'transformed.'
            )
        R = self.camera.R @ turn.T
        t = -R @ (scale * turn @ self.position + matrix[:3, 3])
        return replace(self, camera=replace(self.camera, R=R, t=t))


def resampled(camera, picture, face):
    """Return the picture of another camera at the same place, that camera, and a mask."""
    here = replace(camera, t=np.zeros(3))
    width, height = face.size
    found = np.zeros((height, width, 4), np.uint8)
    for top in range(0, height, _ROWS):
        rows = np.arange(top, min(top + _ROWS, height))
        u, v = np.meshgrid((np.arange(width) + 0.5) / width, 1 - (rows + 0.5) / height)
        ahead = face.rays(np.c_[u.ravel(), v.ravel()])[1]
        uv = here.project(ahead)[0]
        with np.errstate(invalid='ignore'):
            seen = np.flatnonzero(((uv >= 0) & (uv <= 1)).all(axis=1))
        flat = np.zeros((len(uv), 4), np.uint8)
        flat[seen] = np.rint(sample(picture, uv[seen]))
        flat[seen, 3] = 255
        found[rows] = flat.reshape(len(rows), width, 4)
    mask = found[..., 3].copy()
    return found, face, None if mask.all() else mask


class Photos(tuple):
    """A sequence of photographs, a tuple that finds them by name too.

    Parameters
    ----------
    iterable : iterable of Photo, optional
        The photographs.

    Examples
    --------
    >>> import pvibr
    >>> K = [[100.0, 0.0, 49.5], [0.0, 100.0, 49.5], [0.0, 0.0, 1.0]]
    >>> camera = pvibr.Pinhole(K, np.eye(3), [0, 0, 5], (100, 100))
    >>> photos = pvibr.Photos([pvibr.Photo('a.jpg', camera), pvibr.Photo('b.jpg', camera)])
    >>> photos['b.jpg'].width, len(photos[:1])
    (100, 1)
    """

    __slots__ = ()

    def __getitem__(self, key):
        if isinstance(key, str):
            for photo in self:
                if photo.name == key:
                    return photo
            raise KeyError(
                f'{key!r}: there is no such photograph; there are {[p.name for p in self][:20]}'
            )
        found = super().__getitem__(key)
        return Photos(found) if isinstance(key, slice) else found

    def transformed(self, matrix):
        """Return the photographs moved, turned and scaled with the world.

        Parameters
        ----------
        matrix : array_like, shape (4, 4)
            See :meth:`Photo.transformed`.

        Returns
        -------
        Photos
            As many.
        """
        return Photos(photo.transformed(matrix) for photo in self)

    def positions(self) -> np.ndarray:
        """Return where the cameras are.

        Returns
        -------
        numpy.ndarray, shape (n, 3), float64
            World units.
        """
        return np.array([photo.position for photo in self]).reshape(-1, 3)

    def frustums(self, size=None):
        """Return the cameras' frustums as lines, to show where photographs were taken from.

        Parameters
        ----------
        size : float, optional
            Length of the frustums in world units; by default a tenth of the extent of the
            positions.

        Returns
        -------
        pyvista.PolyData
            A pyramid per camera, or the rectangle of an orthophoto; the cell array ``'photo'`` is
            the index of the photograph.

        Examples
        --------
        >>> import pvibr
        >>> K = [[100.0, 0.0, 49.5], [0.0, 100.0, 49.5], [0.0, 0.0, 1.0]]
        >>> camera = pvibr.Pinhole(K, np.eye(3), [0, 0, 5], (100, 100))
        >>> pvibr.Photos([pvibr.Photo('a.jpg', camera)]).frustums(2.0).bounds[4:]
        (-5.0, -3.0)
        """
        import pyvista as pv

        if size is None:
            places = self.positions()
            size = 0.1 * float(np.linalg.norm(np.ptp(places, axis=0))) or 1.0
        points = [np.zeros((0, 3))]
        for photo in self:
            points.append(_outline(photo.camera, size))
        starts = np.arange(len(self))[:, None] * 5
        ways = np.array([4, 0, 1, 2, 3, 0, 4, 1, 2, 4, 3])
        lines = np.column_stack([np.full(len(self), len(ways)), starts + ways])
        found = pv.PolyData(np.concatenate(points), lines=lines.ravel().astype(int))
        found.cell_data['photo'] = np.arange(len(self))
        return found

    def thumbnails(self, size=None, texels=128):
        """Return small pictures where `frustums` end, as one mesh and its texture.

        Parameters
        ----------
        size : float, optional
            Length of the frustums in world units; by default a tenth of the extent of the
            positions.
        texels : int
            Along the longer side of each picture.

        Returns
        -------
        pyvista.PolyData
            A rectangle per photograph that has a picture; the cell array ``'photo'`` is the index
            of the photograph.
        numpy.ndarray, shape (h, w, 4), uint8
            The texture, row 0 at the top.

        Raises
        ------
        ValueError
            If no photograph has a picture, or `texels` is not from 1 to 4096.

        Examples
        --------
        >>> import pyvista as pv
        >>> from pyvista import examples
        >>> import pvibr
        >>> K = [[900.0, 0, 1023.5], [0, 900.0, 511.5], [0, 0, 1]]
        >>> camera = pvibr.Pinhole(K, np.eye(3), [0, 0, 5], (2048, 1024))
        >>> photos = pvibr.Photos([pvibr.Photo('a.jpg', camera, examples.mapfile)])
        >>> cards, image = photos.thumbnails(1.0, texels=64)
        >>> cards.n_cells, image.shape
        (1, (32, 64, 4))
        >>> pl = pv.Plotter(off_screen=True)
        >>> actor = pl.add_mesh(cards, texture=pv.Texture(image), lighting=False)
        >>> pl.close()
        """
        import pyvista as pv

        texels = checked_whole('texels', texels, 1, _MOST_TEXELS)
        shown = [k for k, photo in enumerate(self) if photo.path is not None]
        if not shown:
            raise ValueError(
                'no photograph has a picture: read_cameras(..., images=) names their folder'
            )
        sizes = np.array([self[k].size for k in shown])
        sizes = np.maximum(sizes * texels // sizes.max(1, keepdims=True), 1)
        columns = int(np.ceil(np.sqrt(len(shown))))
        wide, high = sizes.max(0)
        image = np.zeros((-(-len(shown) // columns) * high, columns * wide, 4), np.uint8)
        corners = self.frustums(size).points.reshape(-1, 5, 3)[shown, :4]
        places = np.zeros((len(shown), 4, 2))
        for k, ((w, h), place) in enumerate(zip(sizes.tolist(), places, strict=True)):
            row, column = divmod(k, columns)
            x, y = column * wide, row * high
            image[y : y + h, x : x + w] = self[shown[k]].read((w, h))
            place[:] = [(x, y + h), (x + w, y + h), (x + w, y), (x, y)]
        rows: np.ndarray = np.arange(4 * len(shown)).reshape(-1, 4)
        found = pv.PolyData.from_regular_faces(corners.reshape(-1, 3), rows)
        places = places.reshape(-1, 2) / (image.shape[1], image.shape[0])
        found.active_texture_coordinates = places * [1, -1] + [0, 1]
        found.cell_data['photo'] = shown
        return found, image


def _outline(camera, size):
    """Return the corners of a field of view and its apex, (5, 3)."""
    origins, ahead = camera.rays([[0, 0], [1, 0], [1, 1], [0, 1]])
    if isinstance(camera, Orthographic):
        return np.vstack([origins, origins[:1]])
    forward = -camera.view_from_world[2, :3]
    lost = ~np.isfinite(ahead).all(axis=1) | (ahead @ forward < 0.2)
    corners = np.array([[-1, 1, 1], [1, 1, 1], [1, -1, 1], [-1, -1, 1]]) @ camera.R
    ahead = np.where(lost[:, None], corners, ahead)  # of lenses wider than that
    ahead = ahead / (ahead @ forward)[:, None]
    return np.vstack([camera.position + size * ahead, camera.position])


def similarity(matrix, name):
    """Return the rotation next to a matrix, and its uniform scale."""
    u, s, vt = np.linalg.svd(matrix)
    if not s[2] > 0 or s[0] / s[2] - 1 > 2e-3 or np.linalg.det(u @ vt) < 0:
        raise ValueError(
            f'{name} is {np.asarray(matrix).tolist()}; it must be a rotation, perhaps scaled.'
        )
    return u @ vt, float(np.cbrt(s.prod()))


def camera_of(place, K, pose, size, distortion=(), lens: Lens | None = None):
    """Return the camera of a file's numbers; errors name their place."""
    R, t = pose
    with place.named():
        R, _ = similarity(R, 'the rotation')
        if lens is None:
            return Pinhole(K, R, t, size, distortion)
        return LensCamera(K, R, t, size, lens)


def pinhole_matrix(fx, fy, cx, cy, skew=0.0) -> np.ndarray:
    """Return K."""
    return np.array([[fx, skew, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]])


def posed(place, R, position):
    """Return the rotation and translation of a camera at a position; errors name their place."""
    with place.named():
        R, _ = similarity(np.reshape(R, (3, 3)), 'the rotation')
    return R, -R @ np.asarray(position, float)


@dataclass(frozen=True)
class Entry:
    """A camera of a file: where it says so, the picture's name, its size if known, the rest."""

    place: Place
    name: str
    size: tuple | None
    make: Callable[[tuple], Any]
    crs: str | None = None
