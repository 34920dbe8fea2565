"""Hide and show by mask: assigned, and in place."""

import numpy as np
import pyvista as pv

places = [(x, 0, 0) for x in range(10)]
pl = pv.Plotter()
balls = pl.ibr.add_instances(pv.Sphere(radius=0.3), places, color='red')
pl.camera_position = 'xz'
everything = pl.screenshot()


def red():
    pl.render()
    picture = pl.screenshot().astype(int)
    return (picture[..., 0] > picture[..., 2] + 40).sum()


every = red()
balls.visible = np.arange(10) < 5
assert abs(red() / every - 0.5) < 0.05
balls.visible = [0, 1] * 5
assert abs(red() / every - 0.5) < 0.05
try:
    balls.visible[:] = True
except ValueError:
    balls.visible = True
pl.render()
assert (pl.screenshot() == everything).all()
