"""The levels of detail of one mesh, and which is good enough at which size."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pvibr.actors.atlas import Atlas
from pvibr.actors.bake import bake
from pvibr.actors.meshes import MeshLevel


@dataclass(frozen=True)
class Limits:
    """On-screen diameters, in pixels, at which levels change.

    Attributes
    ----------
    cards : tuple of (str, float, float)
        Program, from, to.
    mesh : float
        From here on meshes are drawn.
    meshes : tuple of float
        For each mesh level the largest diameter at which it is good enough; the first is inf.
    """

    cards: tuple
    mesh: float
    meshes: tuple


@dataclass
class Model:
    """A mesh with everything that stands for it.

    Attributes
    ----------
    levels : list of MeshLevel
        The mesh first, then ever lighter ones.
    atlas : Atlas
        Its pictures, with the error table.
    """

    levels: list
    atlas: Atlas

    def describe(self, max_error) -> str:
        """Return size, bake time and switch distances in one line."""
        limits = limits_of(self, max_error)
        cards = ', '.join(f'{n} to {h:.0f} px' for n, lo, h in limits.cards if h > lo)
        meshes = ', '.join(
            f'{level.triangles} triangles to {limit:.0f} px'
            for level, limit in zip(reversed(self.levels), reversed(limits.meshes), strict=True)
        )
        a = self.atlas
        return f'{a.views} x {a.views} views of {a.tile} texels; {cards}, {meshes}'


def make_model(parts, *, half=False, cache=True, progress=None) -> Model:
    """Bake."""
    return Model([MeshLevel(parts)], bake(parts, half=half))


def limits_of(model, max_error) -> Limits:
    """Return the sizes at which levels change."""
    return Limits((('far', 0, 8), ('middle', 8, 24), ('near', 24, 64)), 64, (np.inf,))
