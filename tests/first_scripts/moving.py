"""Positions in each frame; more of them, and fewer."""

import numpy as np
import pyvista as pv

rng = np.random.default_rng(0)
pl = pv.Plotter()
cells = pl.ibr.add_instances(pv.Sphere(theta_resolution=9, phi_resolution=9), rng.random((80, 3)))
pl.show(auto_close=False, interactive_update=True)
for frame in range(5):
    cells.poses = rng.uniform(0, 9, (60 + 20 * frame, 3))
    pl.reset_camera()
    pl.update()
    seen = pl.screenshot(return_img=True)
    assert len(cells) == 60 + 20 * frame
    assert (seen != seen[0, 0]).any()
cells.poses = cells.poses[:7]
assert len(cells) == 7
np.testing.assert_allclose(np.ptp(cells.bounds[:2]) > 0, True)
pl.close()
