"""
A mirror and a monitor
======================

What other cameras see: a flat mirror, a monitor that looks from the side, an inset from above.
"""

import numpy as np
import pyvista as pv

import pvibr

# %%
# 1. A few things on a table.
pl = pv.Plotter(window_size=(960, 540))
pl.set_background('#203040')
pl.add_mesh(pv.Plane(i_size=8, j_size=6), color='#a08c78')
ball = pv.Sphere(radius=0.5, center=(-0.7, 0, 0.5))
pl.add_mesh(ball, color='tomato', smooth_shading=True)
pl.add_mesh(pv.Cone(center=(0.6, -0.4, 0.5), direction=(0, 0, 1), resolution=40), color='gold')
pl.add_mesh(
    pv.Cube(center=(0.2, 1.0, 0.3), x_length=0.6, y_length=0.6, z_length=0.6), color='teal'
)


def upright(x, y, width, height):
    """Return a plate that faces the camera, with texture coordinates from its lower left."""
    plate = pv.Plane(
        center=(x + width / 2, y, height / 2), direction=(0, -1, 0), i_size=height, j_size=width
    )
    uv = (plate.points[:, [0, 2]] - [x, 0]) / [width, height]
    plate.active_texture_coordinates = uv.astype(np.float32)
    return plate


# %%
# 2. The mirror: a rectangle by its corner and its sides.
mirror = pl.ibr.add(pvibr.Mirror((-2.2, 2.2, 0), (3.2, 0, 0), (0, 0, 1.8)))
pl.add_mesh(upright(-2.2, 2.2, 3.2, 1.8), color='white', lighting=False).texture = mirror.texture

# %%
# 3. The monitor: any camera.
camera = pv.Camera()
camera.position, camera.focal_point, camera.up = (-5, -1, 3), (0, 0.3, 0.4), (0, 0, 1)
live = pl.ibr.add(pvibr.LiveTexture(camera, size=(480, 360)))
pl.add_mesh(upright(1.3, 1.6, 2.0, 1.5), color='white', lighting=False).texture = live.texture

# %%
# 4. A live texture is an image too, wherever one is taken: here as an inset over the picture.
above = pv.Camera()
above.position, above.focal_point, above.up = (0, 0.3, 9), (0, 0.3, 0), (0, 1, 0)
plan = pl.ibr.add(pvibr.LiveTexture(above, size=(240, 180)))
pl.ibr.add(pvibr.ImageOverlay(plan, place=(0.02, 0.66, 0.26, 0.98)))

# %%
# 5. All are drawn again only when what they show changes.
pl.camera_position = [(0.4, -6.5, 2.4), (0.4, 0.6, 0.6), (0, 0, 1)]
pl.show(auto_close=False)
print(pl.ibr.report())
pl.close()
