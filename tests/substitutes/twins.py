"""The same actors twice: as they are, and as images; and how far these are off."""

import numpy as np
from scipy.ndimage import distance_transform_edt

from tests.pictures import uncut


class Twins:
    """Plotters of actors and of what stands for them, whose pictures are compared."""

    picture = staticmethod(uncut)

    def pictures(self):
        return [self.picture(pl) for pl in self.plotters]

    def check(self, mean=np.inf, shift=np.inf, share=99.0):
        """Compare new pictures by mean difference and displacement, and return them."""
        plain, drawn = self.pictures()
        assert np.abs(plain - drawn).mean() < mean
        assert displaced(plain, drawn, self.kinds, share) <= shift
        return plain, drawn


def edges(kind):
    """Return the pixels on both sides of where one kind ends and another begins."""
    edge = np.zeros(kind.shape, bool)
    for axis in (0, 1):
        step = np.diff(kind, axis=axis) != 0
        edge |= np.insert(step, 0, False, axis) | np.insert(step, step.shape[axis], False, axis)
    return edge


def displaced(mesh, card, kinds, share=99.0):
    """Return how far outlines and intersections are from where they belong, pixels.

    All but one pixel in a hundred: where surfaces all but touch, a slit ends anywhere.
    """
    wrong = kinds(mesh) != kinds(card)
    if not wrong.any():
        return 0.0
    away = distance_transform_edt(~edges(kinds(mesh)))[wrong]
    return float(np.percentile(away, share, method='lower'))
