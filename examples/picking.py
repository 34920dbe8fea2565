"""
Which one is it?
================

A pixel or a click gives the number of the instance and the point on its mesh, also where the
instance is drawn as an image. Here what is in the middle of the window is marked; in a window, so
is what you click.
"""

import numpy as np
import pyvista as pv

COUNT = 2_000

# %%
# 1. Many rings of 4 000 triangles.
ring = pv.ParametricTorus(u_res=50, v_res=40)
places = np.random.default_rng(2).uniform(-50, 50, (COUNT, 3)) * [1, 1, 0.3]
pl = pv.Plotter(window_size=(960, 540))
rings = pl.ibr.add_instances(ring, places, color='lightsteelblue', smooth_shading=True)
pl.camera_position = [(-60, -60, 40), (0, 0, -5), (0, 0, 1)]
pl.camera.zoom(2)
pl.ibr.look('studio')


# %%
# 2. What to do with a hit: colour that instance, and put a dot where it was hit.
def mark(hit):
    print(f'instance {hit.index} at {np.round(hit.point, 2)}')
    rings.update([hit.index], colors=[220, 20, 60])
    pl.add_points(np.array(hit.point), color='black', point_size=8, render_points_as_spheres=True)


# %%
# 3. By a pixel, counted from the lower left corner: the middle, or the nearest beside it that
# shows a ring.
pl.screenshot(return_img=True)
width, height = pl.window_size
hits = (rings.pick(x, height // 2) for x in range(width // 2, width))
mark(next(hit for hit in hits if hit))

# %%
# 4. By the mouse.
pl.ibr.enable_picking(mark, left_clicking=True, show=False)
pl.show()
