"""A bar: of values that change, of a new range, of two sets with one title; and none at last."""

import numpy as np
import pyvista as pv

places = np.random.default_rng(0).uniform(0, 9, (60, 3))
pl = pv.Plotter()
one = pl.ibr.add_instances(
    pv.Sphere(), places, scalars=np.arange(60.0), cmap='plasma', scalar_bar_args={'title': 'age'}
)
assert pl.scalar_bars['age'].GetLookupTable().GetRange() == (0, 59)
one.scalars = np.arange(60.0) * 2  # values play on, their range stays
assert pl.scalar_bars['age'].GetLookupTable().GetRange() == tuple(one.clim)
one.clim = 10, 20
assert pl.scalar_bars['age'].GetLookupTable().GetRange() == (10, 20)
pl.update_scalar_bar_range((0, 60), 'age')
assert tuple(one.clim) == (0, 60)

two = pl.ibr.add_instances(
    pv.Cube(), places + 20, scalars=np.arange(60.0) + 100, scalar_bar_args={'title': 'age'}
)
assert len(pl.scalar_bars) == 1
assert tuple(two.clim) == tuple(one.clim)
pl.remove_actor(one)
assert len(pl.scalar_bars) == 1
pl.remove_actor(two)
assert len(pl.scalar_bars) == 0
