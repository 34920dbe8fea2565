"""The transform of a thing, set as on any actor where it has one."""

from __future__ import annotations

import numpy as np
import pyvista as pv

from pvibr.core.arguments import as_array, checked_numbers
from pvibr.things.appearance import read_only

#: Methods of actors that change their transform.
MOVES = (
    *('SetPosition', 'AddPosition', 'SetOrigin', 'SetOrientation', 'AddOrientation', 'SetScale'),
    *('RotateX', 'RotateY', 'RotateZ', 'RotateWXYZ', 'SetUserMatrix', 'SetUserTransform'),
)
_SIMILAR = 1e-6  # relative tolerance of a uniform scale


def vector_property(name, doc):
    """Return a vector of the transform as a property, which a thing without one refuses to set."""
    actor_property = getattr(pv.Actor, name)

    def set_vector(thing, value):
        _check_has_transform(thing, name)
        values = as_array(name, value, np.float64)
        valid_shapes = ((3,), ()) if name == 'scale' else ((3,),)
        if not np.isfinite(values).all() or values.shape not in valid_shapes:
            raise ValueError(f'{name} must be three finite numbers, got {value!r}')
        actor_property.fset(thing, value)

    return property(actor_property.fget, set_vector, doc=doc)


def user_matrix_property():
    """Return the matrix that is applied last as a property, likewise."""

    def set_matrix(thing, matrix):
        _check_has_transform(thing, 'user_matrix')
        matrix = pv.Transform(matrix).matrix if _is_transform(matrix) else matrix
        matrix = checked_numbers('user_matrix', matrix, (4, 4))
        thing.SetUserMatrix(pv.vtkmatrix_from_array(matrix))

    def user_matrix(thing):
        """Matrix applied after position, orientation and scale, shape (4, 4)."""
        return read_only(np.array(super(pv.Actor, thing).user_matrix))

    return property(user_matrix, set_matrix)


def move_method(name):
    """Return an actor's method that changes the transform, which raises where there is none."""
    actor_method = getattr(pv.Actor, name)

    def move(thing, *args):
        if thing.moved_by is None:
            actor_method(thing, *args)
        elif name != 'SetScale':  # plotters scale everything they list
            raise AttributeError(f'{thing.name}.{name} has no effect: {thing.moved_by}')

    move.__name__ = name
    move.__doc__ = 'Change the transform, or raise an error if the thing has none.'
    return move


def _check_has_transform(thing, name):
    if thing.moved_by is not None:
        raise AttributeError(f'{thing.name}.{name} cannot be set: {thing.moved_by}')


def scale_of(matrix) -> float:
    """Return the mean scale factor of a matrix."""
    return abs(float(np.linalg.det(matrix[:3, :3]))) ** (1 / 3)


def lengths_in(world, lengths):
    """Return lengths transformed by a matrix, unless it is None."""
    return lengths if world is None else lengths * scale_of(world)


def points_in(world, points) -> np.ndarray:
    """Return points, shape (n, 3), transformed by a matrix, unless it is None."""
    return points if world is None else points @ world[:3, :3].T + world[:3, 3]


def is_similar(linear) -> bool:
    """Return True if a linear map, (3, 3), scales uniformly."""
    gram_matrix = linear.T @ linear
    mean_square = np.trace(gram_matrix) / 3
    return bool(np.abs(gram_matrix - mean_square * np.eye(3)).max() <= _SIMILAR * mean_square)


def _is_transform(matrix) -> bool:
    return hasattr(matrix, 'GetMatrix') or hasattr(matrix, 'GetElement')
