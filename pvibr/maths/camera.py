"""The interface of calibrated cameras.

Pictures are addressed by ``uv``: u from 0 at the left edge to 1 at the right edge, v from 0 at
the *bottom* edge to 1 at the top edge, as textures are. OpenCV counts pixels from the top and
puts whole numbers at their centres, so ``u = (x + 0.5) / width`` and
``v = 1 - (y + 0.5) / height``.
"""

from __future__ import annotations

from dataclasses import fields, replace

import numpy as np

from pvibr.maths import _checks

#: From the axes of OpenGL's views, y up and -z ahead, to OpenCV's, y down and z ahead, and back.
CV_FROM_GL = np.diag([1.0, -1.0, -1.0])


class Camera:
    """A calibrated camera; a dataclass with an optional ``size`` in pixels."""

    def __eq__(self, other):
        if type(self) is not type(other):
            return NotImplemented
        # Arrays in a dataclass cannot be compared by themselves.
        field_names = [field.name for field in fields(self)]  # type: ignore[arg-type]
        return all(np.array_equal(getattr(self, n), getattr(other, n)) for n in field_names)

    @property
    def view_from_world(self):
        """The 4x4 matrix into OpenGL's view axes (x right, y up, -z ahead)."""
        raise NotImplementedError

    def project(self, points):
        """Project points into the picture.

        Parameters
        ----------
        points : array_like, shape (n, 3)
            World units.

        Returns
        -------
        uv : numpy.ndarray, shape (n, 2), float64
            In [0, 1] inside the picture, v = 0 at the bottom; NaN if not visible.
        depth : numpy.ndarray, shape (n,), float64
            Distance along the camera's axis in world units, positive ahead.
        """
        raise NotImplementedError

    def rays(self, uv):
        """Return the rays through points of the picture.

        Parameters
        ----------
        uv : array_like, shape (n, 2)
            Positions in the picture, v = 0 at the bottom.

        Returns
        -------
        tuple of 2 numpy.ndarray, shape (n, 3), float64
            Origins at depth 0, world units, and unit vectors; NaN where the lens sees nothing.
        """
        raise NotImplementedError

    def toward(self, points):
        """Return unit vectors from points to the camera.

        Parameters
        ----------
        points : array_like, shape (n, 3)
            World units.

        Returns
        -------
        numpy.ndarray, shape (n, 3), float64
            NaN for a point at the camera itself.
        """
        raise NotImplementedError

    def texel(self, points):
        """Return the size of a pixel at points, parallel to the image plane, undistorted.

        Parameters
        ----------
        points : array_like, shape (n, 3)
            World units.

        Returns
        -------
        numpy.ndarray, shape (n,), float64
            World units; not positive behind the camera.

        Raises
        ------
        ValueError
            If the size of the picture is unknown.
        """
        raise NotImplementedError

    def undistorted_bounds(self):
        """Return the bounds of the field of view, in uv of the camera without its lens.

        Returns
        -------
        tuple of 4 float
            Minimum and maximum u, minimum and maximum v; (0, 1, 0, 1) without distortion.
        """
        return 0.0, 1.0, 0.0, 1.0

    def clip_from_view(self, near, far, margin=0.0):
        """Return the projection matrix of the whole field of view, without lens distortion.

        Parameters
        ----------
        near, far : float
            Depths in world units; of a pinhole near is positive and far may be infinite.
        margin : float
            Additional width on each side, as a fraction of the size.

        Returns
        -------
        numpy.ndarray, shape (4, 4), float64
            For OpenGL: visible points are between -w and w on each axis, near at -w.

        Raises
        ------
        ValueError
            If `near` or `far` is out of range.
        """
        raise NotImplementedError

    def clip_rows(self, uv, denominator, margin):
        """Return the first two rows of a projection matrix, from those that give uv.

        Parameters
        ----------
        uv, denominator : numpy.ndarray, shape (2, n) and (n,)
            Rows of the numerators of u and v, and of the common denominator.
        margin : float
            Additional width on each side, as a fraction of the size.

        Returns
        -------
        numpy.ndarray, shape (2, n), float64
            Rows that take the bounds to -1 and 1.
        """
        bounds = self.undistorted_bounds()
        clip_rows = []
        for uv_row, (low, high) in zip(uv, (bounds[:2], bounds[2:]), strict=True):
            half_size = (0.5 + margin) * (high - low)
            clip_rows.append((uv_row - 0.5 * (low + high) * denominator) / half_size)
        return np.array(clip_rows)


class PosedCamera(Camera):
    """A camera at one place, as OpenCV describes it: a dataclass with K, R, t and size."""

    K: np.ndarray
    R: np.ndarray
    t: np.ndarray
    size: tuple[int, int]

    @property
    def position(self):
        """The centre of projection, shape (3,), in world units."""
        # Not by R transposed: far from the origin, an R of seven digits would move the camera.
        return -np.linalg.solve(self.R, self.t)

    @property
    def view_from_world(self):
        """The 4x4 matrix into OpenGL's view axes."""
        view_matrix = np.eye(4)
        view_matrix[:3, :3] = CV_FROM_GL @ self.R
        view_matrix[:3, 3] = CV_FROM_GL @ self.t
        return view_matrix

    def toward(self, points):
        """Return unit vectors from points to the camera."""
        return unit_or_nan(self.position - _checks.points_of(points))

    def resized(self, size):
        """Return the camera of a resized picture.

        Parameters
        ----------
        size : tuple of 2 int
            Width and height in pixels of the scaled picture.

        Returns
        -------
        PosedCamera
            Of the same class; every point keeps its uv.

        Examples
        --------
        >>> from pvibr.maths.pinhole import Pinhole
        >>> K = [[100.0, 0.0, 49.5], [0.0, 100.0, 24.5], [0.0, 0.0, 1.0]]
        >>> Pinhole(K, np.eye(3), np.zeros(3), (100, 50)).resized((200, 100)).K.tolist()
        [[200.0, 0.0, 99.5], [0.0, 200.0, 49.5], [0.0, 0.0, 1.0]]
        """
        size = _checks.size_of(size)
        K = self.K.copy()
        K[:2, 2] += 0.5
        K[:2] *= (np.array(size) / self.size)[:, None]
        K[:2, 2] -= 0.5
        return replace(self, K=K, size=size)  # type: ignore[type-var]


def unit_or_nan(vectors):
    """Return unit vectors (n, 3), NaN for zero vectors."""
    with np.errstate(invalid='ignore'):
        return vectors / np.linalg.norm(vectors, axis=1, keepdims=True)
