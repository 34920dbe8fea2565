"""A time series with a label that follows it."""

import itertools

import numpy as np
import pyvista as pv

steps = np.random.default_rng(0).uniform(0, 9, (6, 40, 3))
pl = pv.Plotter(window_size=(200, 150))
cells = pl.ibr.add_instances(pv.Cube(), steps[0], scalars=np.zeros(40), clim=(0, 9))
label = pl.add_text('0', name='time')
pictures = []
for time, places in enumerate(steps):
    cells.update(poses=places, scalars=places[:, 2])
    pl.add_text(f't = {time}', name='time')
    pl.render()
    pictures.append(pl.screenshot())
assert all((a != b).any() for a, b in itertools.pairwise(pictures))
assert tuple(cells.clim) == (0, 9)
