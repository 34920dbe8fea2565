"""The transform of a thing, set as on any actor."""

from __future__ import annotations

import numpy as np
import pyvista as pv

from pvibr.core.arguments import as_array, checked_numbers, naming
from pvibr.things.appearance import read_only
from pvibr.things.thing import MOVES, Thing

_SIMILAR = 1e-6  # relative tolerance of a uniform scale


def _vector(name, doc):
    def set_vector(self, value):
        values = as_array(name, value, np.float64)
        valid_shapes = ((3,), ()) if name == 'scale' else ((3,),)
        if not np.isfinite(values).all() or values.shape not in valid_shapes:
            raise ValueError(f'{name} must be three finite numbers, got {value!r}')
        getattr(pv.Actor, name).fset(self, value)

    return property(getattr(pv.Actor, name).fget, set_vector, doc=doc)


class Placed(Thing):
    """A thing with a transform."""

    FOR_USERS: tuple[str, ...] = ('matrix',)
    #: Change count and bounds of the last frame, or when it was added.
    _framed: tuple = (-1, (1.0, -1.0) * 3)

    position = _vector('position', 'Translation, world units.')
    orientation = _vector('orientation', 'Degrees about x, y and z, applied in the order z, x, y.')
    scale = _vector('scale', 'Scale factors along x, y and z, or one for all.')
    origin = _vector('origin', 'Centre of rotation and scale, in model space.')

    @property
    def user_matrix(self) -> np.ndarray:
        """Matrix applied after position, orientation and scale, shape (4, 4)."""
        return read_only(np.array(super().user_matrix))

    @user_matrix.setter
    def user_matrix(self, matrix):
        matrix = pv.Transform(matrix).matrix if _is_transform(matrix) else matrix
        matrix = checked_numbers('user_matrix', matrix, (4, 4))
        self.SetUserMatrix(pv.vtkmatrix_from_array(matrix))

    @property
    def matrix(self) -> np.ndarray:
        """World from model, the whole transform, shape (4, 4)."""
        return read_only(pv.array_from_vtkmatrix(self.GetMatrix()))

    def _stay_whole(self, changes):
        """Reset the clipping range if changed content left it, unless it cut the bounds before."""
        last_changes, last_bounds = self._framed
        if last_changes == changes:
            return
        renderer, bounds = self.pipeline.renderer, self.GetBounds()
        self._framed = changes, bounds
        if not _is_whole(renderer, bounds) and _is_whole(renderer, last_bounds):
            renderer.ResetCameraClippingRange()


for _name in MOVES:
    setattr(Placed, _name, getattr(pv.Actor, _name))


class PlacedItems(Placed):
    """Items with individual positions, and a transform of the whole."""

    #: World from item space, None for the identity.
    _world: np.ndarray | None = None
    _matrix_data: tuple = tuple(np.eye(4).ravel().tolist())

    def _put(self):
        """Move the items after `_world` changed."""
        raise NotImplementedError

    @np.errstate(over='ignore', invalid='ignore')
    def _check_linear(self, linear):
        """Raise a ValueError unless a linear map, (3, 3), has an inverse."""
        axis_lengths = np.linalg.norm(linear, axis=0)
        if not np.abs(np.linalg.det(linear)) > 1e-12 * axis_lengths.prod():
            raise ValueError(f'scale or user_matrix of {self.name} must be invertible')

    def _check_similar(self, linear, why):
        """Raise a ValueError unless a linear map, (3, 3), scales uniformly."""
        if not is_similar(linear):
            raise ValueError(f'scale or user_matrix of {self.name} must be uniform: {why}')

    def follow(self):
        """Adopt a transform set in the meantime."""
        matrix_data = self.GetMatrix().GetData()
        if matrix_data != self._matrix_data:
            matrix = np.reshape(matrix_data, (4, 4))
            self._check_linear(matrix[:3, :3])
            self._matrix_data = matrix_data
            self._world = None if (matrix == np.eye(4)).all() else matrix
            self._put()

    def _scaled(self, lengths):
        """Return item-space lengths in world units."""
        return lengths if self._world is None else lengths * scale_of(self._world)

    def _in_world(self, points) -> np.ndarray:
        """Return item-space points, shape (n, 3), in the world."""
        if self._world is None:
            return points
        return points @ self._world[:3, :3].T + self._world[:3, 3]

    def _set_checked(self, name, args):
        old_transform = self.GetScale(), self.GetUserMatrix()
        with naming('scale' if name == 'SetScale' else 'user_matrix', args):
            getattr(pv.Actor, name)(self, *args)
        try:
            self._check_linear(np.reshape(self.GetMatrix().GetData(), (4, 4))[:3, :3])
        except ValueError:
            pv.Actor.SetScale(self, old_transform[0])
            pv.Actor.SetUserMatrix(self, old_transform[1])
            raise

    def SetScale(self, *scale):
        """Set scale factors along x, y and z, or one for all."""
        self._set_checked('SetScale', scale)

    def SetUserMatrix(self, *matrix):
        """Set the vtkMatrix4x4 that is applied last, or None."""
        self._set_checked('SetUserMatrix', matrix)

    def SetUserTransform(self, *transform):
        """Set the vtkLinearTransform that is applied last, or None."""
        self._set_checked('SetUserTransform', transform)


def scale_of(matrix) -> float:
    """Return the mean scale factor of a matrix."""
    return abs(float(np.linalg.det(matrix[:3, :3]))) ** (1 / 3)


def is_similar(linear) -> bool:
    """Return True if a linear map, (3, 3), scales uniformly."""
    gram_matrix = linear.T @ linear
    mean_square = np.trace(gram_matrix) / 3
    return bool(np.abs(gram_matrix - mean_square * np.eye(3)).max() <= _SIMILAR * mean_square)


def _is_transform(matrix) -> bool:
    return hasattr(matrix, 'GetMatrix') or hasattr(matrix, 'GetElement')


def _is_whole(renderer, bounds) -> bool:
    """Return True if bounds are not empty and lie within the clipping range."""
    if bounds[0] > bounds[1]:
        return False
    camera = renderer.GetActiveCamera()
    near, far = camera.GetClippingRange()
    middle_depth = half_depth = 0.0  # plain floats: many figures ask in each frame
    pairs = zip(camera.GetDirectionOfProjection(), camera.GetPosition(), strict=True)
    for (axis, eye), low, high in zip(pairs, bounds[::2], bounds[1::2], strict=True):
        middle_depth += axis * ((low + high) / 2 - eye)
        half_depth += abs(axis) * (high - low) / 2
    return near <= middle_depth - half_depth and middle_depth + half_depth <= far
