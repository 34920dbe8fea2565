"""Transparent, larger, of another size."""

import numpy as np
import pyvista as pv

pl = pv.Plotter(window_size=(200, 150))
pl.ibr.add_instances(pv.Sphere(), [(2.0 * x, 0, 0) for x in range(5)], color='red')
plain = pl.screenshot()
clear = pl.screenshot(transparent_background=True)
assert clear.shape == (150, 200, 4)
assert set(np.unique(clear[0])) == {0} or clear[0, 0, 3] == 0
assert (clear[..., 3] == 255).any()
assert pl.screenshot(scale=2).shape[:2] == (300, 400)
assert pl.screenshot(window_size=(100, 90)).shape[:2] == (90, 100)
pl.render()
assert (pl.screenshot() == plain).all()
assert pl.ibr.screenshot(scale=3).shape[:2] == (450, 600)
assert (pl.screenshot() == plain).all()
