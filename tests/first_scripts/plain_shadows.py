"""README's shadow lines on a plain plotter: no white floor, no black shadow."""

import numpy as np
import pyvista as pv

import pvibr

pl = pv.Plotter(window_size=(400, 300))
pl.add_mesh(pv.Plane(i_size=10, j_size=10), color='white')
pl.add_mesh(pv.Sphere(center=(0, 0, 1)), color='tomato')
pl.camera_position = [(8, -8, 6), (0, 0, 0), (0, 0, 1)]
before = pl.screenshot().astype(float).mean(-1)
pl.ibr.add(pvibr.Shadows())
pl.render()
after = pl.screenshot().astype(float).mean(-1)

floor = after[180:280, 120:280]
assert floor.max() < 254
assert floor.min() > 20
darker = (before - after) > 15
assert 0.002 < darker.mean() < 0.2
assert abs(np.median(after) - np.median(before)) < 40
