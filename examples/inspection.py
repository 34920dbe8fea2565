"""
What draws what
===============

Boulders coloured by the level that draws them, the images in use, and milliseconds: a look at how
a picture came about, on and off in one line.
"""

import numpy as np
import pyvista as pv

import pvibr  # noqa: F401

COUNT = 4000
TRIANGLES = 20_000

# %%
# 1. Something heavy in many places, and a few actors drawn as images of themselves.
rng = np.random.default_rng(2)
sides = int(np.sqrt(TRIANGLES / 2))
stone = pv.Sphere(theta_resolution=sides, phi_resolution=sides + 1)
x, y, z = stone.points.T
stone.points *= (1 + 0.1 * np.sin(5 * x + 3 * y) + 0.08 * np.cos(9 * z + 4 * x))[:, None]
stone = stone.compute_normals()
places = rng.uniform(-130, 130, (COUNT, 3)) * [1, 1, 0]

pl = pv.Plotter(window_size=(960, 540))
pl.add_mesh(pv.Plane(i_size=280, j_size=280), color='#b8b09c')
gray = rng.uniform(0.4, 0.9, (COUNT, 1)).repeat(3, 1)
pl.ibr.add_instances(stone, places, colors=gray, name='stones', max_error=2.0)
rings = []
for turn in np.linspace(0, 2 * np.pi, 5)[:-1]:
    torus = pv.ParametricTorus(u_res=120, v_res=60, w_res=60).rotate_x(70)
    rings.append(pl.add_mesh(torus, color='tan'))
    rings[-1].position = 9 * np.cos(turn), 9 * np.sin(turn), 3
impostor = pl.ibr.add_impostor(rings, only_if_faster=False)  # images at any cost
pl.camera_position = [(-24, -24, 7), (0, 0, 1), (0, 0, 1)]
pl.show(auto_close=False)

# %%
# 2. Hot colours are meshes, cold ones images; boxes are what is drawn or left out together.
view = pl.ibr.inspect()
pl.render()
print(view.report())

# %%
# 3. The images of the impostor instead of those of the stones, and no boxes.
view.thing = impostor
view.cells = False
pl.camera.Azimuth(4)
pl.render()
print(view.report()['new_images'], 'images were taken in this frame')

# %%
# 4. Off: the picture is what it was, to the bit.
pl.ibr.inspect(False)
pl.render()
pl.ibr.inspect()
pl.render()
pl.close()
