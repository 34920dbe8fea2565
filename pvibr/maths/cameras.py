"""Calibrated cameras: where a point of the world lies in a picture, and back.

Pictures are addressed by ``uv``: u from 0 at the left edge to 1 at the right edge, v from 0 at
the *bottom* edge to 1 at the top edge, as textures are. OpenCV counts pixels from the top and
puts whole numbers at their centres, so ``u = (x + 0.5) / width`` and
``v = 1 - (y + 0.5) / height``.

The lens is that of Brown, "Decentering Distortion of Lenses", Photogrammetric Engineering
32(3), 1966, with the rational radial term and the order of coefficients of OpenCV.
"""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.polynomial import Polynomial

#: How far R may be from a rotation; float32 and seven printed digits pass.
ROTATION_TOLERANCE = 1e-6
#: Where the principal point may lie, as a share of the picture's size, if the size that K is for
#: was said, and if it has to be guessed: twice or half as large a picture must be noticed.
SAID, GUESSED = (-1.0, 2.0), (0.3, 0.7)
_TERMS = (0, 4, 5, 8)
_BORDER = 257  # points on each side of a picture whose rays bound what the lens sees
_CV_FROM_GL = np.diag([1.0, -1.0, -1.0])


def distort(xy, distortion):
    """Return where a lens puts points of the ideal image plane.

    Parameters
    ----------
    xy : array_like, shape (n, 2)
        Points on the plane one unit ahead (x right, y down).
    distortion : array_like, 0, 4, 5 or 8 numbers
        k1, k2, p1, p2[, k3[, k4, k5, k6]].

    Returns
    -------
    numpy.ndarray, shape (n, 2), float64
        Points on the same plane; NaN at :func:`valid_radius` and beyond, where the formula folds
        the plane back into the picture.

    Examples
    --------
    >>> from pvibr.maths.cameras import distort
    >>> distort([[0.5, 0.0], [9.0, 0.0]], [-0.2, 0.0, 0.0, 0.0]).tolist()
    [[0.475, 0.0], [nan, nan]]
    """
    lens = _lens(distortion)
    xy = np.asarray(xy, dtype=np.float64)
    if not lens.any():
        return xy.copy()
    inside = np.hypot(*xy.T) < valid_radius(lens)
    moved = np.full_like(xy, np.nan)
    with np.errstate(over='ignore', invalid='ignore'):  # far out is outside, whatever it is
        moved[inside] = _distorted(xy[inside], lens)
    return moved


def undistort(xy, distortion):
    """Return the points of the ideal image plane that a lens puts at given points.

    Parameters
    ----------
    xy : array_like, shape (n, 2)
        Points on the plane one unit ahead, as :func:`distort` returns them.
    distortion : array_like, 0, 4, 5 or 8 numbers
        k1, k2, p1, p2[, k3[, k4, k5, k6]].

    Returns
    -------
    numpy.ndarray, shape (n, 2), float64
        Points nearer than :func:`valid_radius`; NaN where there is none.

    Notes
    -----
    Newton's method with halved steps. The Jacobian is symmetric and, within the valid radius,
    positive definite, so each step goes down and the point found is the only one.

    Examples
    --------
    >>> from pvibr.maths.cameras import undistort
    >>> undistort([[0.475, 0.0], [9.0, 0.0]], [-0.2, 0.0, 0.0, 0.0]).tolist()
    [[0.5, 0.0], [nan, nan]]
    """
    lens = _lens(distortion)
    wanted = np.asarray(xy, dtype=np.float64)
    if not lens.any():
        return wanted.copy()
    limit = valid_radius(lens)
    radius = np.hypot(*wanted.T)
    with np.errstate(divide='ignore', over='ignore', invalid='ignore'):
        found = wanted * np.fmin(1.0, 0.5 * limit / radius)[:, None]
        miss = wanted - _distorted(found, lens)
        length, tolerance = np.ones(len(found)), 4 * np.finfo(float).eps * (1 + radius)
        for _ in range(100):
            todo = np.flatnonzero((np.hypot(*miss.T) > tolerance) & (length > 1e-12))
            if not len(todo):
                break
            tried = found[todo] + length[todo, None] * _newton(found[todo], miss[todo], lens)
            rest = wanted[todo] - _distorted(tried, lens)
            better = np.hypot(*rest.T) < np.hypot(*miss[todo].T)
            better &= np.hypot(*tried.T) < limit
            found[todo[better]], miss[todo[better]] = tried[better], rest[better]
            length[todo] = np.where(better, np.fmin(1.0, 2 * length[todo]), 0.5 * length[todo])
    return np.where((np.hypot(*miss.T) <= 1e-9 * (1 + radius))[:, None], found, np.nan)


def valid_radius(distortion):
    """Return the radius on the ideal image plane up to which a lens maps one to one.

    Parameters
    ----------
    distortion : array_like, 0, 4, 5 or 8 numbers
        k1, k2, p1, p2[, k3[, k4, k5, k6]].

    Returns
    -------
    float
        Where the distorted radius stops growing; infinite if it never does.

    Notes
    -----
    With g(r) the distorted radius without the tangential terms and q = (p2, p1), the Jacobian at
    a distance r is, along and across the radius and with c, s the cosine and sine of the angle
    to q, ``[[g' + 6|q|rc, 2|q|rs], [2|q|rs, g/r + 2|q|rc]]``. It is positive definite for every
    angle while g' and g/r are above 6|q|r, and first singular where g' meets it. A map whose
    Jacobian is symmetric and positive definite on a disc takes no value twice there.

    Examples
    --------
    >>> from pvibr.maths.cameras import valid_radius
    >>> round(valid_radius([-1 / 3, 0.0, 0.0, 0.0]), 12), valid_radius([0.1, 0.0, 0.0, 0.0])
    (1.0, inf)
    """
    k1, k2, p1, p2, k3, k4, k5, k6 = _lens(distortion)
    above = Polynomial([1, 0, k1, 0, k2, 0, k3])
    below = Polynomial([1, 0, k4, 0, k5, 0, k6])
    radius = Polynomial([0, 1])
    growth = (radius * above).deriv() * below - radius * above * below.deriv()
    tangential = 6 * np.hypot(p1, p2) * radius
    ends = below, growth - tangential * below * below, above - tangential * below
    # All three start with 1, so in 1/r they are monic: tiny last terms do no harm.
    inverse = np.concatenate([np.roots(end.trim().coef) for end in ends])
    real = inverse.real[np.abs(inverse.imag) <= 1e-9 * np.abs(inverse)]
    with np.errstate(divide='ignore', over='ignore'):
        return float(1 / real.max(initial=0.0))


class _ByValue:
    """Compared by value: arrays in a dataclass cannot be by themselves."""

    def __eq__(self, other):
        if type(self) is not type(other):
            return NotImplemented
        names = [field.name for field in fields(self)]  # type: ignore[arg-type]
        return all(np.array_equal(getattr(self, n), getattr(other, n)) for n in names)


@dataclass(frozen=True, eq=False)
class Pinhole(_ByValue):
    """A calibrated photograph's camera, as OpenCV describes it.

    The camera's axes are x right, y down, z ahead; ``x_camera = R @ x_world + t``.

    Parameters
    ----------
    K : array_like, shape (3, 3)
        Focal lengths, skew and principal point in pixels: ``[[fx, s, cx], [0, fy, cy],
        [0, 0, 1]]``.
    R : array_like, shape (3, 3)
        Rotation from world to camera.
    t : array_like, shape (3,)
        World units.
    size : tuple of 2 int
        Width and height in pixels of the picture that K is for.
    distortion : array_like, optional
        k1, k2, p1, p2[, k3[, k4, k5, k6]]; see :func:`distort`.

    Raises
    ------
    ValueError
        If K is singular, not upper triangular or for a picture of another size, R is no rotation,
        the distortion has another number of terms or leaves nothing to see, or a number is not
        finite.

    Examples
    --------
    >>> import numpy as np
    >>> from pvibr.maths.cameras import Pinhole
    >>> K = [[100.0, 0.0, 49.5], [0.0, 100.0, 24.5], [0.0, 0.0, 1.0]]
    >>> camera = Pinhole(K, np.eye(3), np.zeros(3), (100, 50))
    >>> uv, depth = camera.project([[0.0, 0.0, 4.0], [1.0, 0.5, 4.0], [0.0, 0.0, -4.0]])
    >>> uv.tolist(), depth.tolist()
    ([[0.5, 0.5], [0.75, 0.25], [nan, nan]], [4.0, 4.0, -4.0])
    """

    # Any: array_like is given, float64 that cannot be written to is kept.
    K: Any
    R: Any
    t: Any
    size: tuple[int, int]
    distortion: Any = ()

    def __post_init__(self):
        _freeze(
            self,
            size=_size(self.size),
            K=_intrinsics(self.K),
            R=_rotation(self.R),
            t=_numbers('t', self.t, (3,)),
            distortion=_lens(self.distortion),
        )
        _check_principal_point(self.K, self.size, SAID)
        self.undistorted_bounds()

    @property
    def position(self):
        """The centre of projection, shape (3,), in world units."""
        # Not R transposed: far from the origin even an R of seven digits must give the same place.
        return -np.linalg.solve(self.R, self.t)

    @property
    def view_from_world(self):
        """The 4x4 matrix into OpenGL's view axes (x right, y up, -z ahead)."""
        matrix = np.eye(4)
        matrix[:3, :3] = _CV_FROM_GL @ self.R
        matrix[:3, 3] = _CV_FROM_GL @ self.t
        return matrix

    @property
    def uv_from_plane(self):
        """The affine 2x3 matrix from the (distorted) plane one unit ahead, y down, to uv."""
        width, height = self.size
        (fx, skew, cx), (_, fy, cy) = self.K[:2]
        return np.array(
            [
                [fx / width, skew / width, (cx + 0.5) / width],
                [0.0, -fy / height, 1.0 - (cy + 0.5) / height],
            ]
        )

    @cached_property
    def valid_radius(self):
        """See :func:`valid_radius`."""
        return valid_radius(self.distortion)

    def project(self, points):
        """Return where points lie in the picture.

        Parameters
        ----------
        points : array_like, shape (n, 3)
            World units.

        Returns
        -------
        uv : numpy.ndarray, shape (n, 2), float64
            In [0, 1] if in the picture, v = 0 at the bottom; NaN behind the camera, where the
            depth is zero within the rounding of the points' type, and where the lens would fold
            the point back into the picture.
        depth : numpy.ndarray, shape (n,), float64
            Distance along the camera's axis in world units, positive ahead.
        """
        moved = _points(points) @ self.R.T + self.t
        depth = moved[:, 2]
        ahead = (depth > self._rounding(points))[:, None]
        plane = np.full((len(moved), 2), np.nan)
        with np.errstate(over='ignore'):
            np.divide(moved[:, :2], depth[:, None], out=plane, where=ahead)
        return _affine(self.uv_from_plane, distort(plane, self.distortion)), depth

    def _rounding(self, points):
        """Return the depth that rounding alone may give a point in the plane of the camera."""
        kind = getattr(points, 'dtype', np.dtype(np.float64))
        eps = np.finfo(kind if kind.kind == 'f' else np.float64).eps
        return 4 * eps * (np.abs(_points(points)) @ np.abs(self.R[2]) + abs(self.t[2]))

    def rays(self, uv):
        """Return the rays through places of the picture.

        Parameters
        ----------
        uv : array_like, shape (n, 2)
            v = 0 at the bottom.

        Returns
        -------
        origins : numpy.ndarray, shape (n, 3), float64
            World units.
        directions : numpy.ndarray, shape (n, 3), float64
            Unit vectors; NaN where nothing is seen through the lens.
        """
        matrix = self.uv_from_plane
        plane = np.linalg.solve(matrix[:, :2], (np.asarray(uv, float) - matrix[:, 2]).T).T
        plane = undistort(plane, self.distortion)
        ahead = np.column_stack([plane, np.ones(len(plane))]) @ np.linalg.inv(self.R).T
        return np.broadcast_to(self.position, ahead.shape).copy(), _unit(ahead)

    def toward(self, points):
        """Return unit vectors from points to the camera.

        Parameters
        ----------
        points : array_like, shape (n, 3)
            World units.

        Returns
        -------
        numpy.ndarray, shape (n, 3), float64
            NaN for a point in the camera itself.
        """
        return _unit(self.position - _points(points))

    def texel(self, points):
        """Return how wide a pixel is at points, across the view; the lens is left out.

        Parameters
        ----------
        points : array_like, shape (n, 3)
            World units.

        Returns
        -------
        numpy.ndarray, shape (n,), float64
            World units; not positive behind the camera.
        """
        depth = _points(points) @ self.R[2] + self.t[2]
        return depth / np.sqrt(self.K[0, 0] * self.K[1, 1])

    def undistorted_bounds(self):
        """Return the box around all that the lens sees, in the uv of the camera without its lens.

        Returns
        -------
        tuple of 4 float
            Least u, greatest u, least v, greatest v; exactly 0, 1, 0, 1 without distortion.
        """
        return self._bounds

    @cached_property
    def _bounds(self):
        if not self.distortion.any():
            return 0.0, 1.0, 0.0, 1.0
        matrix = self.uv_from_plane
        plane = np.linalg.solve(matrix[:, :2], (_border() - matrix[:, 2]).T).T
        seen = undistort(plane, self.distortion)
        if np.isfinite(self.valid_radius):
            # Where the lens ends within the picture, the edge of what it sees is this circle.
            angles = np.linspace(0, 2 * np.pi, 4 * _BORDER)
            circle = (1 - 1e-9) * self.valid_radius * np.c_[np.cos(angles), np.sin(angles)]
            uv = _affine(matrix, distort(circle, self.distortion))
            seen = np.concatenate([seen, circle[((uv >= 0) & (uv <= 1)).all(axis=1)]])
        seen = _affine(matrix, seen[np.isfinite(seen).all(axis=1)])
        if not len(seen):
            msg = (
                f'distortion is {self.distortion.tolist()}; with K {self.K.tolist()} no ray goes '
                f'through a picture of {self.size[0]} x {self.size[1]} pixels.'
            )
            raise ValueError(msg)
        low, high = seen.min(axis=0), seen.max(axis=0)
        return float(low[0]), float(high[0]), float(low[1]), float(high[1])

    def clip_from_view(self, near, far, margin=0.0):
        """Return the projection of the camera without its lens, wide enough for all it sees.

        Parameters
        ----------
        near : float
            World units, above 0.
        far : float
            World units, above `near`; may be infinite.
        margin : float
            How much wider on each side, as a share of the size.

        Returns
        -------
        numpy.ndarray, shape (4, 4), float64
            For OpenGL: what is seen is between -w and w on each axis, near at -w.

        Raises
        ------
        ValueError
            If not 0 < near < far.

        Examples
        --------
        >>> from pvibr.maths.cameras import Pinhole
        >>> K = [[50.0, 0.0, 49.5], [0.0, 50.0, 49.5], [0.0, 0.0, 1.0]]
        >>> camera = Pinhole(K, [[1, 0, 0], [0, 1, 0], [0, 0, 1]], [0, 0, 0], (100, 100))
        >>> camera.clip_from_view(1.0, 3.0).tolist()
        [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, -2.0, -3.0], [0.0, 0.0, -1.0, 0.0]]
        """
        if not 0 < near < far:
            msg = f'near, far are {near}, {far}; 0 < near < far is needed.'
            raise ValueError(msg)
        ahead = np.array([0.0, 0.0, 1.0])
        lines = _to_box(self.uv_from_plane, ahead, self.undistorted_bounds(), margin)
        ratio = near / far
        matrix = np.zeros((4, 4))
        matrix[:2, :3] = lines @ _CV_FROM_GL
        matrix[2, 2:] = -(1 + ratio) / (1 - ratio), -2 * near / (1 - ratio)
        matrix[3, 2] = -1.0
        return matrix + 0.0

    def resized(self, size):
        """Return the camera of the same picture with other pixels.

        Parameters
        ----------
        size : tuple of 2 int
            Width and height in pixels of the scaled picture.

        Returns
        -------
        Pinhole
            Every point keeps its uv.

        Examples
        --------
        >>> import numpy as np
        >>> from pvibr.maths.cameras import Pinhole
        >>> K = [[100.0, 0.0, 49.5], [0.0, 100.0, 24.5], [0.0, 0.0, 1.0]]
        >>> Pinhole(K, np.eye(3), np.zeros(3), (100, 50)).resized((200, 100)).K.tolist()
        [[200.0, 0.0, 99.5], [0.0, 200.0, 49.5], [0.0, 0.0, 1.0]]
        """
        size = _size(size)
        K = self.K.copy()
        K[:2, 2] += 0.5
        K[:2] *= (np.array(size) / self.size)[:, None]
        K[:2, 2] -= 0.5
        return replace(self, K=K, size=size)


@dataclass(frozen=True, eq=False)
class Orthographic(_ByValue):
    """A camera whose rays are parallel: an orthophoto, a plan, a section.

    Parameters
    ----------
    origin : array_like, shape (3,)
        Where the picture's lower left corner is (the corner of its pixel, not the centre); depth
        is counted from here. World units.
    right, up : array_like, shape (3,)
        Directions of the picture's sides; perpendicular, of any length. The camera looks along
        ``up x right``.
    width, height : float
        The picture's sides in world units.
    near, far : float
        Depth in world units from which and up to which the picture shows something.
    size : tuple of 2 int, optional
        Width and height in pixels.

    Raises
    ------
    ValueError
        If a direction is zero, the two are not perpendicular, a side is not positive, near is not
        below far, or a number is not finite.

    Examples
    --------
    >>> from pvibr.maths.cameras import Orthographic
    >>> camera = Orthographic([0, 0, 9], [1, 0, 0], [0, 1, 0], width=4.0, height=2.0)
    >>> uv, depth = camera.project([[1.0, 0.5, 2.0]])
    >>> uv.tolist(), depth.tolist()
    ([[0.25, 0.25]], [7.0])
    """

    origin: Any
    right: Any
    up: Any
    width: float
    height: float
    near: float = -np.inf
    far: float = np.inf
    size: tuple[int, int] | None = None

    def __post_init__(self):
        right, up = _direction('right', self.right), _direction('up', self.up)
        if abs(right @ up) > ROTATION_TOLERANCE:
            msg = f'right {right.tolist()} and up {up.tolist()} must be perpendicular.'
            raise ValueError(msg)
        if not self.near < self.far:
            msg = f'near, far are {self.near}, {self.far}; near must be below far.'
            raise ValueError(msg)
        _freeze(
            self,
            origin=_numbers('origin', self.origin, (3,)),
            right=right,
            up=up,
            width=_positive('width', self.width),
            height=_positive('height', self.height),
            size=None if self.size is None else _size(self.size),
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
        >>> from pvibr.maths.cameras import Orthographic
        >>> camera = Orthographic.from_extent(100.0, 200.0, 0.0, 50.0, zmax=30.0)
        >>> uv, depth = camera.project([[150.0, 50.0, 10.0], [150.0, 50.0, 31.0]])
        >>> uv.tolist(), depth.tolist()
        ([[0.5, 1.0], [nan, nan]], [20.0, -1.0])
        """
        for axis, low, high in ('x', xmin, xmax), ('y', ymin, ymax), ('z', zmin, zmax):
            if not low < high:
                msg = f'{axis}min, {axis}max are {low}, {high}; {axis}min must be below.'
                raise ValueError(msg)
        top = zmax if np.isfinite(zmax) else 0.0
        return cls(
            (xmin, ymin, top),
            (1.0, 0.0, 0.0),
            (0.0, 1.0, 0.0),
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
        """Return where points lie in the picture.

        Parameters
        ----------
        points : array_like, shape (n, 3)
            World units.

        Returns
        -------
        uv : numpy.ndarray, shape (n, 2), float64
            In [0, 1] if in the picture, v = 0 at the bottom; NaN before near or beyond far.
        depth : numpy.ndarray, shape (n,), float64
            Distance from `origin` along the camera's axis in world units, positive ahead.
        """
        moved = (_points(points) - self.origin) @ self._axes.T
        depth = -moved[:, 2] + 0.0
        uv = moved[:, :2] / (self.width, self.height)
        uv[~((depth >= self.near) & (depth <= self.far))] = np.nan
        return uv, depth

    def rays(self, uv):
        """Return the rays through places of the picture.

        Parameters
        ----------
        uv : array_like, shape (n, 2)
            v = 0 at the bottom.

        Returns
        -------
        origins : numpy.ndarray, shape (n, 3), float64
            At depth 0; world units.
        directions : numpy.ndarray, shape (n, 3), float64
            Unit vectors.
        """
        across = np.asarray(uv, float) * (self.width, self.height)
        origins = self.origin + across @ self._axes[:2]
        return origins, -self.toward(origins)

    def toward(self, points):
        """Return unit vectors from points to the camera.

        Parameters
        ----------
        points : array_like, shape (n, 3)
            World units.

        Returns
        -------
        numpy.ndarray, shape (n, 3), float64
            The same for all.
        """
        return np.broadcast_to(self._axes[2], _points(points).shape).copy()

    def texel(self, points):
        """Return how wide a pixel is at points, across the view.

        Parameters
        ----------
        points : array_like, shape (n, 3)
            World units.

        Returns
        -------
        numpy.ndarray, shape (n,), float64
            World units; the same for all.

        Raises
        ------
        ValueError
            If `size` is not known.
        """
        if self.size is None:
            msg = 'size is None; the width and height in pixels are needed for the size of one.'
            raise ValueError(msg)
        side = np.sqrt(self.width / self.size[0] * self.height / self.size[1])
        return np.full(len(_points(points)), side)

    def undistorted_bounds(self):
        """Return the box around all that is seen, in uv.

        Returns
        -------
        tuple of 4 float
            Always 0, 1, 0, 1: there is no lens.
        """
        return 0.0, 1.0, 0.0, 1.0

    def clip_from_view(self, near, far, margin=0.0):
        """Return the projection.

        Parameters
        ----------
        near, far : float
            Depths in world units, finite.
        margin : float
            How much wider on each side, as a share of the size.

        Returns
        -------
        numpy.ndarray, shape (4, 4), float64
            For OpenGL: what is seen is between -1 and 1 on each axis, near at -1.

        Raises
        ------
        ValueError
            If near is not below far, or one is not finite.

        Examples
        --------
        >>> from pvibr.maths.cameras import Orthographic
        >>> camera = Orthographic.from_extent(0.0, 4.0, 0.0, 2.0)
        >>> (camera.clip_from_view(0.0, 8.0) @ [4.0, 1.0, -8.0, 1.0]).tolist()
        [1.0, 0.0, 1.0, 1.0]
        """
        if not (near < far and np.isfinite(far - near)):
            msg = f'near, far are {near}, {far}; both must be finite, near below far.'
            raise ValueError(msg)
        uv_from_view = np.diag([1 / self.width, 1 / self.height, 0.0, 0.0])[:2]
        one = np.array([0.0, 0.0, 0.0, 1.0])
        matrix = np.zeros((4, 4))
        matrix[:2] = _to_box(uv_from_view, one, self.undistorted_bounds(), margin)
        matrix[2, 2:] = -2 / (far - near), -(far + near) / (far - near)
        matrix[3, 3] = 1.0
        return matrix


def as_camera(camera, size):
    """Return the camera of a picture from what users have.

    Parameters
    ----------
    camera : pyvista.Camera, Pinhole, Orthographic, dict or tuple
        A dict has the keys of :class:`Pinhole` (``size`` may be left out); a tuple is
        ``(K, R, t)`` or ``(K, R, t, distortion)``. Of a ``pyvista.Camera`` the place, direction,
        angle (or parallel scale) and window centre count; the picture's size gives the aspect,
        and what is behind the camera is never seen.
    size : tuple of 2 int
        Width and height of the picture in pixels.

    Returns
    -------
    Pinhole or Orthographic
        With this size.

    Raises
    ------
    ValueError
        If the camera is for a picture of another size, is degenerate, or something else.

    Examples
    --------
    >>> import pyvista as pv
    >>> from pvibr.maths.cameras import as_camera
    >>> camera = pv.Camera()
    >>> camera.position, camera.focal_point, camera.up = (0, 0, 5), (0, 0, 0), (0, 1, 0)
    >>> uv, depth = as_camera(camera, (640, 480)).project([[0.0, 0.0, 0.0]])
    >>> uv.tolist(), depth.tolist()
    ([[0.5, 0.5]], [5.0])
    """
    size = _size(size)
    if isinstance(camera, Orthographic) and camera.size is None:
        return replace(camera, size=size)
    if isinstance(camera, Pinhole | Orthographic):
        return _of_size(camera, size)
    if hasattr(camera, 'focal_point'):
        return _from_view(camera, size)
    given = _named(camera)
    if 'size' in given:
        return _of_size(Pinhole(**given), size)
    found = Pinhole(size=size, **given)
    _check_principal_point(found.K, size, GUESSED)
    return found


def _from_view(camera, size):
    """Return what a ``pyvista.Camera`` sees, read by its attributes."""
    position = _numbers('camera.position', camera.position, (3,))
    focal = _numbers('camera.focal_point', camera.focal_point, (3,))
    ahead = _direction('camera.focal_point - camera.position', focal - position)
    up = _direction('camera.up', camera.up)
    right = np.cross(ahead, up)
    if np.linalg.norm(right) < ROTATION_TOLERANCE:
        msg = f'camera.up is {up.tolist()}; it must not be along the view {ahead.tolist()}.'
        raise ValueError(msg)
    right /= np.linalg.norm(right)
    up = np.cross(right, ahead)
    _check_plain(camera)
    width, height = size
    shift = np.array(camera.GetWindowCenter() if hasattr(camera, 'GetWindowCenter') else (0, 0))
    if camera.parallel_projection:
        half = _positive('camera.parallel_scale', camera.parallel_scale)
        half = half * np.array([width / height, 1.0])
        corner = position + ((shift - 1) * half) @ [right, up]
        return Orthographic(corner, right, up, 2 * half[0], 2 * half[1], near=0.0, size=size)
    angle = _positive('camera.view_angle', camera.view_angle)
    if angle >= 180:
        msg = f'camera.view_angle is {angle}; it must be below 180 degrees.'
        raise ValueError(msg)
    sideways = hasattr(camera, 'GetUseHorizontalViewAngle') and camera.GetUseHorizontalViewAngle()
    focus = 0.5 * (width if sideways else height) / np.tan(np.radians(angle) / 2)
    centre = 0.5 * np.array(size) * (1 + shift * [-1, 1]) - 0.5
    K = [[focus, 0.0, centre[0]], [0.0, focus, centre[1]], [0.0, 0.0, 1.0]]
    R = np.array([right, -up, ahead])
    return Pinhole(K, R, -R @ position, size)


def _check_plain(camera):
    """Raise for what VTK's cameras can do beyond a pinhole: their picture would not be ours."""
    identity = [float(i == j) for i in range(4) for j in range(4)]
    plain = {
        'ModelTransformMatrix': identity,
        'UserTransform': None,
        'UserViewTransform': None,
        'UseExplicitProjectionTransformMatrix': 0,
        'UseOffAxisProjection': 0,
        'ViewShear': (0.0, 0.0, 1.0),
    }
    for name, expected in plain.items():
        found = getattr(camera, f'Get{name}', lambda expected=expected: expected)()
        if hasattr(found, 'GetElement'):
            found = [found.GetElement(i, j) for i in range(4) for j in range(4)]
        if found != expected:
            msg = f'camera.Get{name}() is {found}; only {expected} can be used.'
            raise ValueError(msg)


def _named(camera):
    """Return the arguments of a Pinhole from a dict or a tuple."""
    names = ('K', 'R', 't', 'distortion')
    if isinstance(camera, tuple | list) and len(camera) in (3, 4):
        return dict(zip(names, camera, strict=False))
    if isinstance(camera, dict):
        if {'K', 'R', 't'} <= set(camera) <= {*names, 'size'}:
            return camera
        msg = f'camera has the keys {sorted(camera)}; K, R, t, and if known distortion and size.'
        raise ValueError(msg)
    msg = (
        f'camera is {camera!r:.200}; it must be a pyvista.Camera, a Pinhole, an Orthographic, '
        '(K, R, t), (K, R, t, distortion), or a dict of these.'
    )
    raise ValueError(msg)


def _of_size(camera, size):
    if camera.size == size:
        return camera
    remedy = ' camera.resized(size) is that of the scaled picture.'
    msg = (
        f'camera.size is {camera.size}; the picture has {size[0]} x {size[1]} pixels.'
        f'{remedy if isinstance(camera, Pinhole) else ""}'
    )
    raise ValueError(msg)


def _lens(distortion):
    """Return all eight coefficients."""
    terms = np.ravel(np.asarray(distortion, dtype=np.float64))
    if len(terms) not in _TERMS:
        msg = f'distortion has {len(terms)} numbers; it must have 0, 4, 5 or 8: k1, k2, p1, p2, ..'
        raise ValueError(msg)
    return _finite('distortion', np.pad(terms, (0, 8 - len(terms))))


def _distorted(xy, lens):
    k1, k2, p1, p2, k3, k4, k5, k6 = lens
    x, y = xy.T
    s = x * x + y * y
    radial = (1 + s * (k1 + s * (k2 + s * k3))) / (1 + s * (k4 + s * (k5 + s * k6)))
    return np.stack(
        [
            x * radial + 2 * p1 * x * y + p2 * (s + 2 * x * x),
            y * radial + p1 * (s + 2 * y * y) + 2 * p2 * x * y,
        ],
        axis=1,
    )


def _newton(xy, miss, lens):
    """Return the steps that would mend the misses if the lens were linear."""
    k1, k2, p1, p2, k3, k4, k5, k6 = lens
    x, y = xy.T
    s = x * x + y * y
    above, below = 1 + s * (k1 + s * (k2 + s * k3)), 1 + s * (k4 + s * (k5 + s * k6))
    slope = (k1 + s * (2 * k2 + 3 * k3 * s)) * below - above * (k4 + s * (2 * k5 + 3 * k6 * s))
    radial, slope = above / below, 2 * slope / (below * below)
    xx = radial + slope * x * x + 2 * p1 * y + 6 * p2 * x
    xy_ = slope * x * y + 2 * p1 * x + 2 * p2 * y
    yy = radial + slope * y * y + 6 * p1 * y + 2 * p2 * x
    a, b = miss.T
    return np.stack([yy * a - xy_ * b, xx * b - xy_ * a], axis=1) / (xx * yy - xy_ * xy_)[:, None]


def _to_box(uv, one, bounds, margin):
    """Return the two rows that take a box of uv, so much wider, to -1 .. 1."""
    rows = []
    for row, (low, high) in zip(uv, (bounds[:2], bounds[2:]), strict=True):
        half = (0.5 + margin) * (high - low)
        rows.append((row - 0.5 * (low + high) * one) / half)
    return np.array(rows)


def _border():
    """Return points along the four sides of a picture, corners included."""
    along = np.linspace(0, 1, _BORDER)
    zero, one = np.zeros_like(along), np.ones_like(along)
    sides = (along, zero), (along, one), (zero, along), (one, along)
    return np.concatenate([np.column_stack(side) for side in sides])


def _affine(matrix, xy):
    return xy @ matrix[:, :2].T + matrix[:, 2]


def _unit(vectors):
    with np.errstate(invalid='ignore'):
        return vectors / np.linalg.norm(vectors, axis=1, keepdims=True)


def _points(points):
    points = np.asarray(points, dtype=np.float64)
    if points.ndim != 2 or points.shape[1] != 3:
        msg = f'points have the shape {points.shape}; it must be (n, 3).'
        raise ValueError(msg)
    return points


def _freeze(camera, **values):
    for name, value in values.items():
        if isinstance(value, np.ndarray):
            value.setflags(write=False)
        object.__setattr__(camera, name, value)


def _finite(name, values):
    if not np.isfinite(values).all():
        msg = f'{name} is {values.tolist()}; all numbers must be finite.'
        raise ValueError(msg)
    return values


def _numbers(name, values, shape):
    try:
        found = np.array(values, dtype=np.float64)
    except (TypeError, ValueError) as error:
        msg = f'{name} is {values!r:.200}; it must be numbers of the shape {shape}.'
        raise ValueError(msg) from error
    # OpenCV hands vectors out as columns.
    found = found.reshape(shape) if found.size == np.prod(shape) else found
    if found.shape != shape:
        msg = f'{name} has the shape {found.shape}; it must be {shape}.'
        raise ValueError(msg)
    return _finite(name, found)


def _direction(name, vector):
    vector = _numbers(name, vector, (3,))
    largest = np.abs(vector).max()
    if not largest:
        msg = f'{name} is zero; it must have a direction.'
        raise ValueError(msg)
    vector = vector / largest
    return vector / np.linalg.norm(vector)


def _positive(name, value):
    if not 0 < value < np.inf:
        msg = f'{name} is {value}; it must be above 0 and finite.'
        raise ValueError(msg)
    return float(value)


def _size(size):
    found = np.asarray(size)
    if found.shape != (2,) or not (found > 0).all() or (found != np.floor(found)).any():
        msg = f'size is {size!r}; it must be (width, height) in pixels, whole numbers above 0.'
        raise ValueError(msg)
    return int(found[0]), int(found[1])


def _intrinsics(K):
    K = _numbers('K', K, (3, 3))
    if K[1, 0] or K[2, 0] or K[2, 1]:
        msg = f'K is {K.tolist()}; it must be upper triangular: below the diagonal all is 0.'
        raise ValueError(msg)
    if not (K.diagonal() > 0).all():
        msg = f'K has the diagonal {K.diagonal().tolist()}; focal lengths and 1 must be above 0.'
        raise ValueError(msg)
    return K / K[2, 2]


def _rotation(R):
    R = _numbers('R', R, (3, 3))
    off, det = np.abs(R @ R.T - np.eye(3)).max(), np.linalg.det(R)
    if off > ROTATION_TOLERANCE or det < 0:
        msg = (
            f'R is {R.tolist()}; it must be a rotation: R @ R.T is off the identity by {off:.2g} '
            f'(allowed: {ROTATION_TOLERANCE}), its determinant is {det:.6g} (allowed: +1).'
        )
        raise ValueError(msg)
    return R


def _check_principal_point(K, size, allowed):
    share = (K[:2, 2] + 0.5) / size
    if (share < allowed[0]).any() or (share > allowed[1]).any():
        msg = (
            f'K has its principal point at {K[:2, 2].tolist()}, for a picture of '
            f'{size[0]} x {size[1]} pixels; between {allowed[0]} and {allowed[1]} of the size is '
            'allowed. K seems to be for another size: scale it (Pinhole.resized); if the picture '
            'is a part of a larger one, say the size that K is for (Pinhole(..., size=size)).'
        )
        raise ValueError(msg)
