"""
A scan draped with photographs
==============================

Six photographs from a drone on the bare scan that they show: each point takes the best of those
that see it.
"""

import numpy as np
import pyvista as pv

import pvibr
from pvibr.scenes.landscape import landscape

SIZE = COUNT = 900
TRIANGLES = 29_000
ANGLE, HEIGHT = 40.0, 170.0

# %%
# 1. Photographs, taken here of a valley with trees: a drone looks straight down, from 170 m.
scene = landscape(COUNT, size=420, triangles=TRIANGLES)
drone = pv.Plotter(off_screen=True, window_size=(900, 600), lighting='none')
sun = {'position': (-0.6, 0.3, 1.3), 'color': (1.0, 0.95, 0.85), 'intensity': 0.9}
drone.add_light(pv.Light(light_type='scene light', **sun))
drone.add_light(pv.Light(light_type='headlight', color=(0.85, 0.93, 1.0), intensity=0.6))
drone.add_mesh(scene.terrain, scalars='color_rgb', rgb=True, smooth_shading=True)
drone.ibr.add_instances(scene.parts()[0], scene.matrices, views='half')
drone.ibr.add(pvibr.Shadows())
drone.camera.view_angle = ANGLE
photos, cameras = [], []
for x, y in np.reshape(np.meshgrid((-112, 0, 112), (-43, 43)), (2, -1)).T:
    drone.camera_position = [(x, y, HEIGHT), (x, y, 0), (0, 1, 0)]
    photos.append(drone.ibr.screenshot())
    cameras.append(drone.camera.copy())
drone.close()

# %%
# 2. The scan, bare as clay and cut out as a block, with what the photographs show of it.
pl = pv.Plotter(window_size=(16 * SIZE // 9, SIZE))
bare = scene.terrain.clip_box((-205, 205, -150, 150, -99, 99), invert=False)
bare = bare.extract_surface(algorithm=None).triangulate()
base = pv.Plane(center=(0, 0, bare.bounds[4] - 12), i_size=900, j_size=900)
block = bare.extrude_trim((0, 0, -1), base)
scan = pl.add_mesh(block, color='#e8e0d4', smooth_shading=True, split_sharp_edges=True)
drape = pvibr.Projector(photos, cameras, actors=[scan], casters=[scan], blend='best')
pl.ibr.add(drape).gain = 0.8, 0.8, 0.8

# %%
# 3. Where the photographs were taken, and they themselves, 30 m below.
high = 2 * 30 * np.tan(np.radians(ANGLE / 2))
for photo, camera in zip(photos, cameras, strict=True):
    print_ = pv.Plane(center=camera.position, i_size=1.5 * high, j_size=high)
    pl.add_mesh(print_.translate((0, 0, -30)), texture=pv.Texture(photo), lighting=False)
    camera.clipping_range = 0.1, 30
    pl.add_mesh(camera.view_frustum(1.5), style='wireframe', color='#33373d', lighting=False)
pl.camera_position, pl.camera.view_angle = [(-230, -540, 350), (0, -8, 30), (0, 0, 1)], 30
look = pl.ibr.look('studio')
look.effects['AmbientOcclusion'].radius, look.effects['Shadows'].casts = 12.0, [scan]
pl.ibr.add(pvibr.Accumulation(16))
pl.show()
