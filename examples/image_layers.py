"""
Coherent layers
===============

A heavy town before hills: each layer is drawn again only when its warped picture is wrong.
"""

import time

import numpy as np
import pyvista as pv

SIZE = 400  # points along a side of the hills

# %%
# 1. Hills far away, a town of towers, and rings close by.
x, y = np.meshgrid(np.linspace(-300, 300, SIZE), np.linspace(40, 300, SIZE))
z = 9 * np.sin(x / 23) * np.cos(y / 31) + 4 * np.sin(x / 7 + y / 9) + 0.06 * y - 9
hills = pv.StructuredGrid(x, y, z).elevation()
tower = pv.Superquadric(theta_resolution=SIZE // 3, phi_resolution=SIZE // 3, phi_roundness=0.3)
ring = pv.ParametricTorus(ringradius=0.8, crosssectionradius=0.25, u_res=SIZE, v_res=SIZE // 3)

pl = pv.Plotter(window_size=(960, 540), lighting='none')
pl.add_light(pv.Light(position=(-40, -60, 80), light_type='scene light'))
far = [pl.add_mesh(hills, cmap='gist_earth', smooth_shading=True, show_scalar_bar=False)]
far.append(pl.add_mesh(pv.Plane(center=(0, 10, -1), i_size=600, j_size=120), color='#7d8f5a'))
town, near, rng = [], [], np.random.default_rng(4)
for column, row in np.ndindex(8, 3):
    town.append(pl.add_mesh(tower, color=0.5 + 0.4 * rng.random(3), smooth_shading=True))
    town[-1].position, town[-1].orientation = (5 * column - 18, 9 * row, 2), (0, 0, 40 * column)
    town[-1].scale = 3, 3, 6 + 4 * rng.random()
for k in range(6):
    near.append(pl.add_mesh(ring, color='sienna', smooth_shading=True))
    near[-1].position, near[-1].orientation = (-5 + 0.2 * k, -22, 0.8 * k - 0.5), (0, 0, 30 * k)
pl.set_background('white', top='lightskyblue')
pl.camera_position = [(0, -34, 5), (0, 0, 3), (0, 0, 1)]
pl.show(auto_close=False)


# %%
# 2. Milliseconds of a frame of a slow pan, drawn in full and in layers.
def pan(frames=12):
    start = time.perf_counter()
    for _ in range(frames):
        pl.camera.Yaw(0.1)
        pl.render()
    return 1e3 * (time.perf_counter() - start) / frames


print(f'in full: {pan(3):.0f} ms a frame')
layers = pl.ibr.add_image_layers([near, town, far], max_error=1.0)
pan(3)  # takes the first pictures
print(f'in layers: {pan():.0f} ms a frame')

# %%
# 3. How often each was taken, why, and by how much it is off; then a cheap depth of field.
print(pl.ibr.report())
layers.blur = (2.5, 0, 4)
pl.render()
pl.close()
