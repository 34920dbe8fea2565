"""The place of a thing in the world, which is set as that of any actor."""

from __future__ import annotations

import numpy as np
import pyvista as pv

from pvibr.scene.looks import read_only
from pvibr.scene.thing import Thing


def _vector(name, doc):
    def put(self, value):
        values = np.asarray(value, np.float64)
        if not np.isfinite(values).all() or values.shape not in ((3,), ()):
            msg = f'{name} = {value!r}: must be three finite numbers'
            raise ValueError(msg)
        getattr(pv.Actor, name).fset(self, value)

    return property(getattr(pv.Actor, name).fget, put, doc=doc)


class Placed(Thing):
    """A thing that has a place in the world.

    Examples
    --------
    >>> from pvibr.scene.placing import Placed
    >>> thing = Placed()
    >>> thing.position = (1.0, 2.0, 3.0)
    >>> thing.matrix[:3, 3].tolist()
    [1.0, 2.0, 3.0]
    """

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
        matrix = np.array(matrix, np.float64)
        if matrix.shape != (4, 4) or not np.isfinite(matrix).all():
            msg = f'user_matrix has shape {matrix.shape}: must be finite and (4, 4)'
            raise ValueError(msg)
        self.SetUserMatrix(pv.vtkmatrix_from_array(matrix))

    @property
    def matrix(self) -> np.ndarray:
        """World from model, of all of these, shape (4, 4)."""
        return read_only(pv.array_from_vtkmatrix(self.GetMatrix()))
