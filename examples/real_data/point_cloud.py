"""
A cloud of points
=================

110 000 points of an aerial laser scan (LAZ), as spheres in their own colours.
"""

from pathlib import Path

import pyvista as pv

import pvibr

FILE = Path('../shared/data/instances/autzen_trim.laz')

points, columns = pvibr.read_poses(FILE, others=['rgb', 'intensity'])
pl = pv.Plotter(window_size=(1280, 720), lighting='none')
pl.ibr.add_spheres(points, 1.2, colors=columns['rgb'], lighting=False)
pl.enable_eye_dome_lighting()
pl.view_isometric()
pl.camera.zoom(1.4)
pl.set_background('slategray', top='lightsteelblue')
pl.show()
