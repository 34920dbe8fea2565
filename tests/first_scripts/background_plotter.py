"""A Qt window has pl.ibr as soon as pvibr is imported."""

import os

os.environ.setdefault('QT_QPA_PLATFORM', 'offscreen')
import pyvista as pv
import pyvistaqt

import pvibr

pl = pyvistaqt.BackgroundPlotter(show=False, off_screen=True)
balls = pl.ibr.add_instances(pv.Sphere(), [(2.0 * x, 0, 0) for x in range(5)], color='red')
pl.ibr.add(pvibr.Outline())
try:
    picture = pl.screenshot()
except pv.plotting.errors.RenderWindowUnavailable:
    pass  # a Qt platform without OpenGL, such as 'offscreen', has no picture of a plain plotter
else:
    assert (picture[..., 0].astype(int) > picture[..., 2] + 40).any()
assert len(balls) == 5
pl.close()
