"""Arrays that things return: changing them in place is an error; masks may be of 0 and 1."""

from __future__ import annotations

import numpy as np
import pytest
import pyvista as pv

from tests.things.test_scalar_bars import THINGS, VALUES


@pytest.mark.parametrize('kind', THINGS)
def test_arrays_are_read_only_or_masks(kind):
    pl = pv.Plotter(off_screen=True, window_size=(60, 40))
    mask = np.random.default_rng(4).integers(0, 2, 7)
    thing = THINGS[kind](pl.ibr, scalars=VALUES)
    for given in (mask, mask.tolist(), mask.astype(float), mask.astype(np.uint8)):
        thing.visible = given
        assert thing.visible.tolist() == mask.astype(bool).tolist()
        with pytest.raises(ValueError, match='read-only'):
            thing.visible[0] = False
        thing.visible = True
    for wrong in (2 * mask + 1, mask - 0.5, ['yes'] * 7, mask[:3]):
        with pytest.raises(ValueError, match='visible'):
            thing.visible = wrong
    values = [getattr(thing, name, None) for name in dir(thing) if not name.startswith('_')]
    arrays = [value for value in values if isinstance(value, np.ndarray)]
    assert len(arrays) >= 4
    for array in arrays:
        with pytest.raises(ValueError, match='read-only'):
            array[...] = 0
    pl.close()
