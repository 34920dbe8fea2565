"""
Orbits with afterglow
=====================

A constellation of 72 satellites around the Earth: each leaves a trail of light that fades.
"""

import numpy as np
import pyvista as pv
from pyvista import examples

import pvibr

SIZE, COUNT = 900, 72
rng = np.random.default_rng(6)

# %%
# 1. The Earth with its map, in the light of the sun, and stars far behind; radii of the Earth.
pl = pv.Plotter(window_size=(16 * SIZE // 9, SIZE), lighting='none')
pl.set_background('#03050b')
lon, lat = np.meshgrid(np.linspace(-np.pi, np.pi, 241), np.linspace(-np.pi, np.pi, 121) / 2)
along = np.exp(1j * (lon - 2.6)) * np.cos(lat)
earth = pv.StructuredGrid(along.real, along.imag, np.sin(lat))
shares = lon / (2 * np.pi) + 0.5, lat / np.pi + 0.5
earth.active_texture_coordinates = np.stack([share.ravel('F') for share in shares], 1)
pl.add_mesh(earth, texture=examples.load_globe_texture(), smooth_shading=True, specular=0.1)
pl.add_light(pv.Light(position=(-3, -2.2, 1.4), light_type='scene light', intensity=1.15))
pl.add_light(pv.Light(light_type='headlight', intensity=0.1))
stars = rng.normal(size=(1500, 3))
stars *= 60 / np.linalg.norm(stars, axis=1, keepdims=True)
pl.add_points(stars, color='white', point_size=1, lighting=False, opacity=0.6)

# %%
# 2. Satellites on inclined circles in eight planes.
plane, seat = np.divmod(np.arange(COUNT), COUNT // 8)
node, tilt = 2 * np.pi * plane / 8, np.radians(53)


def places(time):
    a = 2 * np.pi * (seat / (COUNT // 8) + plane / 20 + time)
    x, y, z = np.cos(a), np.sin(a) * np.cos(tilt), np.sin(a) * np.sin(tilt)
    points = [x * np.cos(node) - y * np.sin(node), x * np.sin(node) + y * np.cos(node), z]
    return 1.32 * np.column_stack(points)


craft = pv.Sphere(radius=0.008, theta_resolution=12, phi_resolution=12)
fleet = pl.ibr.add_instances(craft, places(0), color='#ffd9a0', lighting=False, name='fleet')

# %%
# 3. As time goes on, they draw their trails.
pl.camera_position = [(0.6, -4.0, 1.2), (0.35, 0, -0.05), (0, 0, 1)]
pl.camera.view_angle = 41
pl.ibr.add(pvibr.Afterglow([fleet], 2.5, fade=1.6, downsample=4, spread=0.2))
pl.ibr.add(pvibr.ToneMapping())
pl.show(auto_close=False)
for time in np.linspace(0, 2, 61):
    pl.ibr.time = time
    fleet.poses = pvibr.matrices(places(0.05 * time))
    pl.render()
pl.close()
