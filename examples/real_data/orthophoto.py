"""
An orthophoto on a terrain model
================================

An aerial photograph by its extent on 256 x 256 heights, lit by the afternoon sun with shadows.
"""

from pathlib import Path

import numpy as np
import pyvista as pv

import pvibr

FOLDER = Path('../shared/data/projection/vtkjs_dem')

# %%
# 1. Heights on a grid, the first row in the north.
heights = np.loadtxt(FOLDER / 'dem.csv', delimiter=',')
y, x = np.mgrid[10 : -10 : heights.shape[0] * 1j, -10 : 10 : heights.shape[1] * 1j]
terrain = pv.StructuredGrid(x, y, 0.5 * heights)

# %%
# 2. The photograph by its extent, lit as the ground is.
pl = pv.Plotter(window_size=(1280, 720), lighting='none')
pl.add_mesh(terrain, color='white', smooth_shading=True, ambient=0.25, diffuse=0.9)
pl.add_light(pv.Light(position=(-12, 4, 7), light_type='scene light'))
extent = pvibr.Orthographic.from_extent(-10, 10, -10, 10)
photo = pl.ibr.add(pvibr.Projector(str(FOLDER / 'dem.jpg'), extent, lit=True))
pl.ibr.add(pvibr.Shadows())

# %%
# 3. From the south.
pl.camera_position = [(3, -24, 13), (0, 0, 0), (0, 0, 1)]
pl.show()
