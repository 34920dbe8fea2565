"""Turntables: views from around an axis, for eyes near its horizon."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from pvibr.maths.facing import CLOSE

#: Sine of the largest elevation, up or down, at which side views are used.
SIDE_ELEVATION = 0.34


class Turns(NamedTuple):
    """Axis and number of views of a turntable."""

    axis: tuple[float, float, float]
    views: int

    @property
    def columns(self) -> int:
        """Views along a side of the square image."""
        return int(np.ceil(np.sqrt(self.views)))

    def sides(self) -> np.ndarray:
        """Return two reference axes of azimuth and the turntable's axis, shape (3, 3)."""
        axis = np.array(self.axis)
        side_vector = np.array([1.0, 0, 0] if abs(axis[0]) < CLOSE else [0, 1.0, 0])
        first_axis = side_vector - axis * (axis @ side_vector)
        first_axis /= np.linalg.norm(first_axis)
        return np.stack([first_axis, np.cross(axis, first_axis), axis])

    def frames(self) -> np.ndarray:
        """Return right, up and toward-the-eye of each view, shape (columns, columns, 3, 3)."""
        first_axis, second_axis, axis = self.sides()
        azimuths = 2 * np.pi * np.arange(self.columns**2)[:, None] / self.views
        toward = np.cos(azimuths) * first_axis + np.sin(azimuths) * second_axis
        up = np.broadcast_to(axis, toward.shape)
        axes = np.stack([np.cross(up, toward), up, toward], 1)
        return axes.reshape(self.columns, self.columns, 3, 3)


@dataclass
class Turntable:
    """Views from around an axis."""

    turns: Turns
    geometry: np.ndarray
    albedo: np.ndarray

    @property
    def tile(self) -> int:
        """Texels along a side of a view."""
        return len(self.geometry) // self.turns.columns

    def to_arrays(self) -> dict:
        """Return named arrays, for a file."""
        turns = np.array([*self.turns.axis, self.turns.views], float)
        return {'turns': turns, 'turns.geometry': self.geometry, 'turns.albedo': self.albedo}

    @classmethod
    def from_arrays(cls, arrays) -> Turntable | None:
        """Return a turntable from named arrays, None if there is none."""
        if 'turns' not in arrays:
            return None
        numbers = np.asarray(arrays['turns'], float)
        images = [np.asarray(arrays.get(f'turns.{k}')) for k in ('geometry', 'albedo')]
        if numbers.shape != (4,) or not (np.isfinite(numbers).all() and numbers[3] >= 1):
            raise ValueError(f'not a turntable: {numbers.tolist()}')
        turns = Turns(tuple(numbers[:3].tolist()), int(numbers[3]))
        image_side = len(images[0]) if images[0].ndim else 0
        is_valid = image_side and image_side % turns.columns == 0
        shape = (image_side, image_side, 4)
        if not is_valid or any(p.shape != shape or p.dtype != np.uint8 for p in images):
            raise ValueError(
                f'not a turntable of {turns.views} views: images must be square, uint8'
            )
        return cls(turns, *images)
