"""Orthographic cameras: orthophotos, plans, sections."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pvibr.core.arguments import checked_direction, checked_numbers, checked_positive, naming
from pvibr.maths import _checks
from pvibr.maths.camera import Camera
from pvibr.maths.vectors import products


@dataclass(frozen=True, eq=False)
class Orthographic(Camera):
    """A camera whose rays are parallel: an orthophoto, a plan, a section.

    Parameters
    ----------
    origin : array_like, shape (3,)
        Lower left corner of the lower left pixel, at depth 0, world units.
    right, up : array_like, shape (3,)
        Perpendicular directions of the picture's sides; the camera looks along ``up x right``.
    width, height : float
        The picture's sides in world units.
    near, far : float
        Clipping range of depth in world units.
    size : tuple of 2 int, optional
        Width and height in pixels.

    Raises
    ------
    ValueError
        If an argument is not as above or not finite.

    Examples
    --------
    >>> from pvibr.maths.orthographic import Orthographic
    >>> camera = Orthographic([0, 0, 9], [1, 0, 0], [0, 1, 0], width=4.0, height=2.0)
    >>> uv, depth = camera.project([[1.0, 0.5, 2.0]])
    >>> uv.tolist(), depth.tolist()
    ([[0.25, 0.25]], [7.0])
    """

    origin: np.ndarray
    right: np.ndarray
    up: np.ndarray
    width: float
    height: float
    near: float = -np.inf
    far: float = np.inf
    size: tuple[int, int] | None = None

    def __post_init__(self):
        right, up = checked_direction('right', self.right), checked_direction('up', self.up)
        if abs(right @ up) > _checks.ROTATION_TOLERANCE:
            raise ValueError(
                f'right and up must be perpendicular, got {right.tolist()}, {up.tolist()}'
            )
        with naming('near', self.near), naming('far', self.far):
            is_increasing = bool(float(self.near) < float(self.far))
        if not is_increasing:
            raise ValueError(f'near must be below far, got {self.near}, {self.far}')
        _checks.freeze(
            self,
            origin=checked_numbers('origin', self.origin, (3,)),
            right=right,
            up=up,
            width=checked_positive('width', self.width),
            height=checked_positive('height', self.height),
            size=None if self.size is None else _checks.size_of(self.size),
        )

    @classmethod
    def from_extent(cls, xmin, xmax, ymin, ymax, zmin=-np.inf, zmax=np.inf, size=None):
        """Return the camera of an orthophoto: x to the right, y up, looking along -z.

        Parameters
        ----------
        xmin, xmax, ymin, ymax : float
            World coordinates of the picture's edges (of pixels, not of their centres).
        zmin, zmax : float
            Heights between which the picture is shown; all by default.
        size : tuple of 2 int, optional
            Width and height in pixels.

        Returns
        -------
        Orthographic
            Depth is counted from `zmax`, or from 0 without one.

        Raises
        ------
        ValueError
            If a lower limit is not below its upper limit, or not finite.

        Examples
        --------
        >>> from pvibr.maths.orthographic import Orthographic
        >>> camera = Orthographic.from_extent(100.0, 200.0, 0.0, 50.0, zmax=30.0)
        >>> uv, depth = camera.project([[150.0, 50.0, 10.0], [150.0, 50.0, 31.0]])
        >>> uv.tolist(), depth.tolist()
        ([[0.5, 1.0], [nan, nan]], [20.0, -1.0])
        """
        for axis, low, high in ('x', xmin, xmax), ('y', ymin, ymax), ('z', zmin, zmax):
            if not low < high:
                raise ValueError(f'{axis}min must be below {axis}max, got {low}, {high}')
        top = zmax if np.isfinite(zmax) else 0.0
        return cls(
            np.array((xmin, ymin, top)),
            np.array((1.0, 0.0, 0.0)),
            np.array((0.0, 1.0, 0.0)),
            width=xmax - xmin,
            height=ymax - ymin,
            near=top - zmax,
            far=top - zmin,
            size=size,
        )

    @property
    def _axes(self):
        return np.array([self.right, self.up, np.cross(self.right, self.up)])

    @property
    def view_from_world(self):
        """The 4x4 matrix into OpenGL's view axes (x right, y up, -z ahead)."""
        matrix = np.eye(4)
        matrix[:3, :3] = self._axes
        matrix[:3, 3] = -self._axes @ self.origin
        return matrix

    def project(self, points):
        """Project points into the picture; NaN before near or beyond far."""
        view_points = products(self._axes, _checks.points_of(points) - self.origin)
        depth = -view_points[:, 2] + 0.0
        uv = view_points[:, :2] / (self.width, self.height)
        uv[~((depth >= self.near) & (depth <= self.far))] = np.nan
        return uv, depth

    def rays(self, uv):
        """Return the rays through points of the picture, from depth 0."""
        plane_offsets = np.asarray(uv, float) * (self.width, self.height)
        origins = self.origin + plane_offsets @ self._axes[:2]
        return origins, -self.toward(origins)

    def toward(self, points):
        """Return unit vectors from points to the camera, the same for all."""
        return np.broadcast_to(self._axes[2], _checks.points_of(points).shape).copy()

    def texel(self, points):
        """Return the size of a pixel at points, the same for all."""
        if self.size is None:
            raise ValueError(
                'size must be (width, height) in pixels for the size of one, got None'
            )
        pixel_size = np.sqrt(self.width / self.size[0] * self.height / self.size[1])
        return np.full(len(_checks.points_of(points)), pixel_size)

    def clip_from_view(self, near, far, margin=0.0):
        """Return the projection matrix."""
        if not (near < far and np.isfinite(far - near)):
            raise ValueError(f'near must be below far, both finite, got {near}, {far}')
        uv_from_view = np.diag([1 / self.width, 1 / self.height, 0.0, 0.0])[:2]
        unit_row = np.array([0.0, 0.0, 0.0, 1.0])
        matrix = np.zeros((4, 4))
        matrix[:2] = self.clip_rows(uv_from_view, unit_row, margin)
        matrix[2, 2:] = -2 / (far - near), -(far + near) / (far - near)
        matrix[3, 3] = 1.0
        return matrix
