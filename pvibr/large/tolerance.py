"""How much of a large mesh a frame shows, by its quality."""

from __future__ import annotations

import math
from typing import NamedTuple

from pvibr.things.frame import STEP

#: Least error below full quality, pixels: less is for stills.
_MOVING_ERROR = 1.0
#: Factor of the error of detail over which it is left out.
_MOST_DETAIL = 16.0


class Tolerance(NamedTuple):
    """Errors that a frame may have."""

    #: Distance from the mesh in pixels.
    error: float
    #: Factor of the sizes of shading that may be lost, infinite if all may.
    detail_factor: float = 1.0

    @classmethod
    def of(cls, quality, max_error) -> Tolerance:
        """Return what a quality allows: first detail is left out, then the surface is coarser."""
        steps = math.log(quality, STEP)
        if steps <= 0:
            return cls(max_error)
        least = max(max_error, _MOVING_ERROR)
        if steps < 1:
            return cls(max_error ** (1 - steps) * least**steps, _MOST_DETAIL**steps)
        return cls(least * STEP / quality, math.inf)
