"""interactive_update, and a report after show() has closed the window."""

import numpy as np
import pyvista as pv

pl = pv.Plotter()
balls = pl.ibr.add_instances(pv.Sphere(), [(2.0 * x, 0, 0) for x in range(5)])
pl.show(interactive_update=True, auto_close=False)
for _ in range(3):
    balls.poses = balls.poses + np.array([1, 0, 0])
    pl.update()
assert 'Instances' in str(pl.ibr.report())
pl.close()
assert 'Instances' in str(pl.ibr.report())
