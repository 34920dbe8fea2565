"""A gradient and a picture behind instances, with an effect."""

import numpy as np
import pyvista as pv
from pyvista import examples

import pvibr

for set_up in (
    lambda pl: pl.set_background('white', top='navy'),
    lambda pl: pl.add_background_image(examples.mapfile, as_global=True),
):
    pl = pv.Plotter(window_size=(200, 150))
    set_up(pl)
    balls = pl.ibr.add_instances(pv.Sphere(), [(2.0 * x, 0, 0) for x in range(5)], color='red')
    pl.ibr.add(pvibr.Outline())
    picture = pl.screenshot().astype(int)
    balls.visibility = False
    pl.render()
    empty = pl.screenshot().astype(int)
    assert np.abs(picture - empty)[:20].max() <= 1  # behind nothing, as it was
    assert (picture != empty).any()
    pl.close()
