"""Where a thing made of several actors is: as PyVista's actors say it."""

from __future__ import annotations

import numpy as np
import pyvista as pv


def _of_actor(name, doc):
    def get(self):
        return getattr(self._mover, name)

    def put(self, value):
        values = np.asarray(value, np.float64)
        if not np.isfinite(values).all() or values.shape not in ((3,), ()):
            msg = f'{name} = {value!r}: must be three finite numbers'
            raise ValueError(msg)
        setattr(self._mover, name, value)
        self._moved()

    return property(get, put, doc=doc)


class Placed:
    """What has a place in the world, which can be set in the ways of a PyVista actor.

    Examples
    --------
    >>> from pvibr.scene.placing import Placed
    >>> thing = Placed()
    >>> thing.position = (1.0, 2.0, 3.0)
    >>> thing.matrix[:3, 3].tolist()
    [1.0, 2.0, 3.0]
    """

    position = _of_actor('position', 'Where its origin is, world units.')
    orientation = _of_actor('orientation', 'Degrees about x, y and z, as VTK turns: z, x, y.')
    scale = _of_actor('scale', 'Factors along x, y and z, or one for all.')
    origin = _of_actor('origin', 'About which it is turned and scaled, in its own space.')

    def __init__(self):
        self._mover = pv.Actor()

    @property
    def user_matrix(self) -> np.ndarray:
        """What acts after position, orientation and scale, shape (4, 4)."""
        return np.array(self._mover.user_matrix)

    @user_matrix.setter
    def user_matrix(self, matrix):
        matrix = np.array(matrix, np.float64)
        if matrix.shape != (4, 4) or not np.isfinite(matrix).all():
            msg = f'user_matrix has shape {matrix.shape}: must be finite and (4, 4)'
            raise ValueError(msg)
        self._mover.user_matrix = matrix
        self._moved()

    @property
    def matrix(self) -> np.ndarray:
        """World from what is shown, of all of these, shape (4, 4)."""
        return pv.array_from_vtkmatrix(self._mover.GetMatrix())

    def _moved(self):
        """Follow a new place."""
