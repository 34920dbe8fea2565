"""The on-screen sizes at which a card shader draws."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pvibr.instances.card_layers import PATCHES
from pvibr.instances.cards import FADE


@dataclass(frozen=True, eq=False)
class CardSpan:
    """On-screen diameters at which a card shader draws, per patch of view directions."""

    #: As the shader reads it: from, to, whether the mesh is next, 0; shape (PATCHES, 4).
    ranges: np.ndarray
    #: From and to, with the widest of all last, for an unknown patch; shape (PATCHES + 1,).
    low: np.ndarray
    high: np.ndarray

    @classmethod
    def of(cls, span, mesh_from) -> CardSpan:
        """Return a span, shape (2, PATCHES), below the sizes at which meshes begin."""
        low, high = span
        is_empty = high <= low
        low, shown_high = np.where(is_empty, 1e30, low), np.where(is_empty, 0.0, high)
        ranges = np.stack([low, high, high == mesh_from, np.zeros(len(low))], 1)
        return cls(ranges, np.append(low, low.min()), np.append(shown_high, shown_high.max()))

    def fits(self, patches, smallest, largest) -> np.ndarray:
        """Return which blocks, of known patch or -1, may have instances of these sizes."""
        return (largest >= self.low[patches]) & (smallest < self.high[patches] * FADE)

    @property
    def is_empty(self) -> bool:
        """Whether it has no size at all."""
        return bool(self.high[-1] <= 0)


#: The span of a shader that is not used.
NOWHERE = CardSpan.of(np.zeros((2, PATCHES)), np.zeros(PATCHES))
