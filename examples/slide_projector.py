"""
A slide projector
=================

A picture thrown onto steps, with a ball in its way: what the projector does not see stays dark.
"""

import numpy as np
import pyvista as pv
from pyvista import examples

import pvibr

# %%
# 1. A staircase, a wall behind it, a ball in the air.
pl = pv.Plotter(window_size=(960, 540), lighting='none')
pl.set_background('#1d2126', top='#3a424c')
looks = {'color': 'white', 'ambient': 0.2, 'diffuse': 0.9}
for k in range(6):
    step = pv.Box((-3, 3, 0.6 * k, 0.6 * (k + 1), -0.1, 0.35 * k))
    pl.add_mesh(step, **looks)
pl.add_mesh(pv.Box((-3, 3, 3.6, 3.8, 0, 5)), **looks)
ball = pv.Sphere(radius=0.45, center=(0.3, -0.6, 2.0), theta_resolution=60, phi_resolution=60)
pl.add_mesh(ball, smooth_shading=True, **looks)
pl.add_light(pv.Light(position=(-4, -6, 6), intensity=0.25, light_type='scene light'))

# %%
# 2. The projector: any camera. It lights what it sees, as light of the picture's colours.
camera = pv.Camera()
camera.position, camera.focal_point, camera.up = (0.5, -7.0, 2.6), (0, 3, 1.7), (0, 0, 1)
camera.view_angle = 24.0
slide = pl.ibr.add(pvibr.Projector(examples.mapfile, camera, mode='modulate', feather=0.02))

# %%
# 3. Seen from the side, the shadow of the ball and the steps bend the picture.
pl.camera_position = [(-7.6, -8.4, 5.6), (0.2, 1.6, 1.75), (0, 0, 1)]
pl.show(auto_close=False)

# %%
# 4. The same as data: which points of the wall the projector reaches.
wall = pv.Plane(center=(0, 3.55, 2.5), direction=(0, -1, 0), i_size=5, j_size=6).triangulate()
reached = pvibr.visible(wall.subdivide(4), camera, casters=[ball], to='cells', size=(960, 540))
print(f'{np.mean(reached):.0%} of the wall is in the picture')
pl.show()
