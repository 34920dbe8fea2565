"""A legend of what has a label."""

import numpy as np
import pyvista as pv

places = np.random.default_rng(0).uniform(0, 9, (30, 3))
pl = pv.Plotter()
pl.ibr.add_instances(pv.Sphere(), places, color='tomato', label='cells')
pl.ibr.add_spheres(places + 12, radius=0.5, color='steelblue', label='beads')
pl.add_mesh(pv.Cube(), color='green', label='a cube')
legend = pl.add_legend()
pl.screenshot()

assert [legend.GetEntryString(i) for i in range(3)] == ['cells', 'beads', 'a cube']
assert pv.Color(legend.GetEntryColor(0)) == pv.Color('tomato')
assert pv.Color(legend.GetEntryColor(1)) == pv.Color('steelblue')
