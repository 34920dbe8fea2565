"""The place of a thing in the world, which is set as that of any actor."""

from __future__ import annotations

import numpy as np
import pyvista as pv

from pvibr.core.arguments import as_array, checked_numbers, naming
from pvibr.things.appearance import read_only
from pvibr.things.thing import MOVES, Thing

_ALIKE = 1e-6  # of the scale: how far a similarity may be from one


def _vector(name, doc):
    def put(self, value):
        values = as_array(name, value, np.float64)
        shapes = ((3,), ()) if name == 'scale' else ((3,),)
        if not np.isfinite(values).all() or values.shape not in shapes:
            raise ValueError(f'{name} = {value!r}: must be three finite numbers')
        getattr(pv.Actor, name).fset(self, value)

    return property(getattr(pv.Actor, name).fget, put, doc=doc)


class Placed(Thing):
    """A thing that has a place in the world.

    Examples
    --------
    >>> from pvibr.things.placing import Placed
    >>> thing = Placed()
    >>> thing.position = (1.0, 2.0, 3.0)
    >>> thing.matrix[:3, 3].tolist()
    [1.0, 2.0, 3.0]
    """

    FOR_USERS: tuple[str, ...] = ('matrix',)
    #: Changes of the content, and bounds in the last frame, or when it was added.
    _framed: tuple = (-1, (1.0, -1.0) * 3)

    position = _vector('position', 'Position of the origin, world units.')
    orientation = _vector('orientation', 'Degrees about x, y and z, applied in the order z, x, y.')
    scale = _vector('scale', 'Factors along x, y and z, or one for all.')
    origin = _vector('origin', 'Centre of rotation and scale, in its own space.')

    @property
    def user_matrix(self) -> np.ndarray:
        """Matrix that is applied after position, orientation and scale, shape (4, 4)."""
        return read_only(np.array(super().user_matrix))

    @user_matrix.setter
    def user_matrix(self, matrix):
        matrix = pv.Transform(matrix).matrix if _is_transform(matrix) else matrix
        matrix = checked_numbers('user_matrix', matrix, (4, 4))
        self.SetUserMatrix(pv.vtkmatrix_from_array(matrix))

    @property
    def matrix(self) -> np.ndarray:
        """World from model, of all of these, shape (4, 4)."""
        return read_only(pv.array_from_vtkmatrix(self.GetMatrix()))

    def _stay_whole(self, changes):
        """Widen the clipping range if it cut nothing before, and the content has changed."""
        last, before = self._framed
        if last == changes:
            return
        renderer, now = self.pipeline.renderer, self.GetBounds()
        self._framed = changes, now
        if not _is_whole(renderer, now) and _is_whole(renderer, before):
            renderer.ResetCameraClippingRange()


for _name in MOVES:
    setattr(Placed, _name, getattr(pv.Actor, _name))


class PlacedItems(Placed):
    """Items with places of their own, and a place of all of them."""

    #: World from the space of the items' own places, None if both are the same.
    _world: np.ndarray | None = None
    _followed: tuple = tuple(np.eye(4).ravel().tolist())

    def _put(self):
        """Show the items where they are now, after `_world` changed."""
        raise NotImplementedError

    @np.errstate(over='ignore', invalid='ignore')
    def _check_linear(self, linear):
        """Raise a ValueError if the items cannot be drawn so; they need an inverse at least."""
        lengths = np.linalg.norm(linear, axis=0)
        if not np.abs(np.linalg.det(linear)) > 1e-12 * lengths.prod():
            raise ValueError(
                f'scale or user_matrix of {self.name} must have an inverse: none along an axis'
            )

    def _check_similar(self, linear, why):
        """Raise a ValueError unless all lengths are scaled alike."""
        if not is_similar(linear):
            raise ValueError(
                f'scale or user_matrix of {self.name} must scale all axes alike: {why}'
            )

    def follow(self):
        """Take over a place that was set since."""
        data = self.GetMatrix().GetData()
        if data != self._followed:
            matrix = np.reshape(data, (4, 4))
            self._check_linear(matrix[:3, :3])
            self._followed = data
            self._world = None if (matrix == np.eye(4)).all() else matrix
            self._put()

    def _scaled(self, lengths):
        """Return lengths of the items' own space in the world."""
        return lengths if self._world is None else lengths * scale_of(self._world)

    def _in_world(self, points) -> np.ndarray:
        """Return points of the items' own space, shape (n, 3), in the world."""
        if self._world is None:
            return points
        return points @ self._world[:3, :3].T + self._world[:3, 3]

    def _set_checked(self, name, args):
        before = self.GetScale(), self.GetUserMatrix()
        with naming('scale' if name == 'SetScale' else 'user_matrix', args):
            getattr(pv.Actor, name)(self, *args)
        try:
            self._check_linear(np.reshape(self.GetMatrix().GetData(), (4, 4))[:3, :3])
        except ValueError:
            pv.Actor.SetScale(self, before[0])
            pv.Actor.SetUserMatrix(self, before[1])
            raise

    def SetScale(self, *scale):
        """Set factors along x, y and z, or one for all."""
        self._set_checked('SetScale', scale)

    def SetUserMatrix(self, *matrix):
        """Set a vtkMatrix4x4 that is applied last, or None."""
        self._set_checked('SetUserMatrix', matrix)

    def SetUserTransform(self, *transform):
        """Set a vtkLinearTransform that is applied last, or None."""
        self._set_checked('SetUserTransform', transform)


def scale_of(matrix) -> float:
    """Return by how much a matrix scales lengths, in the mean."""
    return abs(float(np.linalg.det(matrix[:3, :3]))) ** (1 / 3)


def is_similar(linear) -> bool:
    """Return True if a matrix, (3, 3), scales all lengths alike."""
    square = linear.T @ linear
    size = np.trace(square) / 3
    return bool(np.abs(square - size * np.eye(3)).max() <= _ALIKE * size)


def _is_transform(matrix) -> bool:
    return hasattr(matrix, 'GetMatrix') or hasattr(matrix, 'GetElement')


def _is_whole(renderer, bounds) -> bool:
    """Return True if bounds are not empty and within the clipping range."""
    if bounds[0] > bounds[1]:
        return False
    camera = renderer.GetActiveCamera()
    near, far = camera.GetClippingRange()
    middle = half = 0.0  # plain numbers: each of many figures is asked in each frame
    pairs = zip(camera.GetDirectionOfProjection(), camera.GetPosition(), strict=True)
    for (axis, eye), low, high in zip(pairs, bounds[::2], bounds[1::2], strict=True):
        middle += axis * ((low + high) / 2 - eye)
        half += abs(axis) * (high - low) / 2
    return near <= middle - half and middle + half <= far
