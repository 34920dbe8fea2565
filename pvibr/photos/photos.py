"""Photographs with their calibrated cameras."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pyvista as pv

from pvibr.core.arguments import checked_numbers, checked_whole, naming
from pvibr.maths._checks import size_of
from pvibr.maths.draping import sample
from pvibr.maths.lens_camera import LensCamera
from pvibr.maths.orthographic import Orthographic
from pvibr.maths.pinhole import Pinhole
from pvibr.photos.camera_parsing import similarity
from pvibr.photos.view_camera import view_camera
from pvibr.textures.projected import as_rgba, decoded, resized

_MAX_THUMBNAIL = 4096  # texels along a side
_ROWS_AT_ONCE = 256  # resampled at once, to save memory


@dataclass(frozen=True, eq=False, repr=False)
class Photo:
    """A photograph and its calibrated camera.

    Camera axes are x right, y down, z ahead, and pixel centres have integer coordinates, as in
    OpenCV, whatever the convention of the file.

    Parameters
    ----------
    name : str
        Name in the file.
    camera : Pinhole, LensCamera or Orthographic
        The calibrated camera, of the picture's size.
    path : pathlib.Path, optional
        The picture, if there is one.
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
                raise TypeError(f'{name} must be a string, got {text!r:.80}')
        if not isinstance(self.camera, Pinhole | LensCamera | Orthographic):
            raise TypeError(
                f'camera must be a Pinhole, LensCamera or Orthographic, got {self.camera!r:.80}'
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
        """Intrinsic matrix, (3, 3); orthophotos have none."""
        return self.camera.K

    @property
    def distortion(self):
        """OpenCV's k1, k2, p1, p2, k3 .. k6 of a pinhole camera, else the :class:`Lens`."""
        return self.camera.lens if isinstance(self.camera, LensCamera) else self.camera.distortion

    @property
    def position(self) -> np.ndarray:
        """Camera position, (3,), world units; the lower left corner of an orthophoto."""
        ortho = isinstance(self.camera, Orthographic)
        return self.camera.origin if ortho else self.camera.position

    @property
    def camera_from_world(self) -> np.ndarray:
        """Matrix from world to camera axes, (4, 4): x right, y down, z ahead."""
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
            Width and height of the result, by default those of the picture; JPEG files decode
            faster to a smaller size.

        Returns
        -------
        numpy.ndarray, shape (h, w, 4), uint8
            Row 0 at the top.

        Raises
        ------
        ValueError
            If the picture is missing, unreadable, or of another size than the camera.
        """
        if self.path is None:
            raise ValueError(f'{self.name!r} has no picture: use read_cameras(..., images=folder)')
        small_picture = None if size is None else decoded(self.path, self.size, size)
        if small_picture is not None:
            return small_picture
        picture = as_rgba(self.path)
        picture_height, picture_width = picture.shape[:2]
        if (picture_width, picture_height) != self.size:
            size_text = f'{picture_width} x {picture_height}'
            raise ValueError(f'{self.path} must be {self.size} pixels, got {size_text}')
        return picture if size is None else resized(picture, size)

    def slides(self) -> list:
        """Return pinhole pictures for a projector.

        A lens that rational distortion cannot match within 0.01 pixels is resampled, to one
        picture up to 120 degrees, beyond that to the faces of a cube.

        Returns
        -------
        list of tuple
            (path or array, Pinhole or Orthographic, mask or None) of each.

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
            opaque_picture = self.read() | np.array([0, 0, 0, 255], np.uint8)
        return [resampled(self.camera, opaque_picture, face) for face in self.camera.faces()]

    def to_pyvista(self, size=None):
        """Return PyVista's camera with this view.

        In a window of the given size it shows the photograph's view, except for the lens and
        skew, which VTK's cameras lack. Panoramas look ahead with a view angle of 90 degrees.
        Pixels that are not square set an explicit aspect ratio, which VTK keeps when the window
        is resized; :meth:`pvibr.api.plotter_component.IBRComponent.fly_to` adapts it.

        Parameters
        ----------
        size : tuple of 2 int, optional
            Width and height of the window in pixels; by default those of the picture. Where its
            aspect ratio differs, the picture fills the height, and is centred.

        Returns
        -------
        pyvista.Camera
            For ``plotter.camera``.

        Raises
        ------
        ValueError
            If the size is not two whole numbers above 0.

        Warns
        -----
        PvibrWarning
            If leaving out the skew moves any of the picture by more than 0.01 pixels.

        Examples
        --------
        >>> import pvibr
        >>> K = [[100.0, 0.0, 49.5], [0.0, 100.0, 49.5], [0.0, 0.0, 1.0]]
        >>> photo = pvibr.Photo('a.jpg', pvibr.Pinhole(K, np.eye(3), [0, 0, 5], (100, 100)))
        >>> camera = photo.to_pyvista()
        >>> camera.position, camera.up, round(camera.view_angle, 3)
        ((0.0, 0.0, -5.0), (0.0, -1.0, 0.0), 53.13)
        """
        return view_camera(self, self.size if size is None else size_of(size))

    def transformed(self, matrix):
        """Return the photograph transformed with the world.

        Parameters
        ----------
        matrix : array_like, shape (4, 4)
            New world from old world: a rotation, a uniform scale and a translation.

        Returns
        -------
        Photo
            The photograph, which sees the new world as this one sees the old.

        Raises
        ------
        ValueError
            If the matrix is not a similarity, or this is an orthophoto.

        Examples
        --------
        >>> import pvibr
        >>> K = [[100.0, 0.0, 49.5], [0.0, 100.0, 49.5], [0.0, 0.0, 1.0]]
        >>> photo = pvibr.Photo('a.jpg', pvibr.Pinhole(K, np.eye(3), [0, 0, 5], (100, 100)))
        >>> photo.transformed(np.diag([2.0, 2.0, 2.0, 1.0])).position.tolist()
        [0.0, 0.0, -10.0]
        """
        matrix = checked_numbers('matrix', matrix, (4, 4))
        rotation, scale = similarity(matrix[:3, :3], 'matrix')
        if isinstance(self.camera, Orthographic) or matrix[3].tolist() != [0, 0, 0, 1]:
            raise ValueError(
                f'matrix must be a similarity of a photograph that is not an orthophoto, got '
                f'{matrix.tolist()} for {self!r}'
            )
        R = self.camera.R @ rotation.T
        t = -R @ (scale * rotation @ self.position + matrix[:3, 3])
        return replace(self, camera=replace(self.camera, R=R, t=t))


def resampled(camera, picture, face):
    """Return the picture of a face at the same position, the face, and its mask or None."""
    centred_camera = replace(camera, t=np.zeros(3))
    width, height = face.size
    face_picture = np.zeros((height, width, 4), np.uint8)
    for first_row in range(0, height, _ROWS_AT_ONCE):
        row_range = np.arange(first_row, min(first_row + _ROWS_AT_ONCE, height))
        u, v = np.meshgrid((np.arange(width) + 0.5) / width, 1 - (row_range + 0.5) / height)
        ray_directions = face.rays(np.c_[u.ravel(), v.ravel()])[1]
        uv = centred_camera.project(ray_directions)[0]
        with np.errstate(invalid='ignore'):
            is_inside = np.flatnonzero(((uv >= 0) & (uv <= 1)).all(axis=1))
        row_pixels = np.zeros((len(uv), 4), np.uint8)
        row_pixels[is_inside] = np.rint(sample(picture, uv[is_inside]))
        face_picture[row_range] = row_pixels.reshape(len(row_range), width, 4)
    mask = face_picture[..., 3].copy()
    return face_picture, face, None if mask.min() == 255 else mask


class Photos(tuple):
    """A tuple of photographs, also indexed by name.

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
            raise KeyError(f'no such photograph: {key!r}; there are {[p.name for p in self][:20]}')
        selected = super().__getitem__(key)
        return Photos(selected) if isinstance(key, slice) else selected

    def transformed(self, matrix):
        """Return the photographs transformed with the world.

        Parameters
        ----------
        matrix : array_like, shape (4, 4)
            See :meth:`Photo.transformed`.

        Returns
        -------
        Photos
            The transformed photographs.
        """
        return Photos(photo.transformed(matrix) for photo in self)

    def positions(self) -> np.ndarray:
        """Return the camera positions.

        Returns
        -------
        numpy.ndarray, shape (n, 3), float64
            World units.
        """
        return np.array([photo.position for photo in self]).reshape(-1, 3)

    def frustums(self, size=None):
        """Return the cameras' frustums as lines.

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
        if size is None:
            positions = self.positions()
            size = 0.1 * float(np.linalg.norm(np.ptp(positions, axis=0))) or 1.0
        points = [np.zeros((0, 3))]
        for photo in self:
            points.append(_outline(photo.camera, size))
        starts = np.arange(len(self))[:, None] * 5
        line_path = np.array([4, 0, 1, 2, 3, 0, 4, 1, 2, 4, 3])
        lines = np.column_stack([np.full(len(self), len(line_path)), starts + line_path])
        frustum_lines = pv.PolyData(np.concatenate(points), lines=lines.ravel().astype(int))
        frustum_lines.cell_data['photo'] = np.arange(len(self))
        return frustum_lines

    def thumbnails(self, size=None, texels=128):
        """Return small pictures at the bases of `frustums`, as one textured mesh.

        Parameters
        ----------
        size : float, optional
            Length of the frustums in world units; by default a tenth of the extent of the
            positions.
        texels : int
            Longer side of each picture.

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
            If no photograph has a picture, or `texels` is not in 1 to 4096.

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
        texels = checked_whole('texels', texels, 1, _MAX_THUMBNAIL)
        indices = [k for k, photo in enumerate(self) if photo.path is not None]
        if not indices:
            raise ValueError('no photograph has a picture: use read_cameras(..., images=folder)')
        sizes = np.array([self[k].size for k in indices])
        sizes = np.maximum(sizes * texels // sizes.max(1, keepdims=True), 1)
        columns = int(np.ceil(np.sqrt(len(indices))))
        cell_width, cell_height = sizes.max(0)
        row_count = -(-len(indices) // columns)
        image = np.zeros((row_count * cell_height, columns * cell_width, 4), np.uint8)
        corners = self.frustums(size).points.reshape(-1, 5, 3)[indices, :4]
        corner_uv = np.zeros((len(indices), 4, 2))
        for k, ((w, h), card_uv) in enumerate(zip(sizes.tolist(), corner_uv, strict=True)):
            row, column = divmod(k, columns)
            x, y = column * cell_width, row * cell_height
            image[y : y + h, x : x + w] = self[indices[k]].read((w, h))
            # From the middle of the outer texels: filters mix in no neighbour.
            left, top, right, bottom = x + 0.5, y + 0.5, x + w - 0.5, y + h - 0.5
            card_uv[:] = [(left, bottom), (right, bottom), (right, top), (left, top)]
        card_faces: np.ndarray = np.arange(4 * len(indices)).reshape(-1, 4)
        cards = pv.PolyData.from_regular_faces(corners.reshape(-1, 3), card_faces)
        corner_uv = corner_uv.reshape(-1, 2) / (image.shape[1], image.shape[0])
        cards.active_texture_coordinates = corner_uv * [1, -1] + [0, 1]
        cards.cell_data['photo'] = indices
        return cards, image


def _outline(camera, size):
    """Return the corners of the field of view and its apex, (5, 3)."""
    origins, rays = camera.rays([[0, 0], [1, 0], [1, 1], [0, 1]])
    if isinstance(camera, Orthographic):
        return np.vstack([origins, origins[:1]])
    forward = -camera.view_from_world[2, :3]
    too_wide = ~np.isfinite(rays).all(axis=1) | (rays @ forward < 0.2)
    fallback_rays = np.array([[-1, 1, 1], [1, 1, 1], [1, -1, 1], [-1, -1, 1]]) @ camera.R
    rays = np.where(too_wide[:, None], fallback_rays, rays)  # of lenses wider than that
    rays = rays / (rays @ forward)[:, None]
    return np.vstack([camera.position + size * rays, camera.position])
