"""
Sun over terrain
================

A day in March, at three hours: the sun stands where it stood over Zurich, and hills and trees
throw their shadows.
"""

from datetime import datetime, timedelta, timezone

import pyvista as pv

import pvibr
from pvibr.scenes.landscape import landscape
from pvibr.shadows.sun import sun_direction, sun_position

COUNT = 400
TRIANGLES = 29_000
SIZE = 480
ZURICH = 47.4, 8.5

# %%
# 1. A valley with trees in it; metres, x to the east, y to the north.
scene = landscape(COUNT, triangles=TRIANGLES)
half = scene.size / 2

# %%
# 2. The same view at each hour, with its own sun, and light from the sky that casts none.
pl = pv.Plotter(shape=(1, 3), window_size=(3 * SIZE, SIZE), lighting='none', border=False)
for column, hour in enumerate((9, 12, 16)):
    time = datetime(2026, 3, 20, hour, tzinfo=timezone(timedelta(hours=1)))
    azimuth, altitude = sun_position(time, *ZURICH)
    pl.subplot(0, column)
    pl.background_color = 'lightsteelblue'
    sun = pv.Light(position=sun_direction(time, *ZURICH), color='ivory', light_type='scene light')
    sky = pv.Light(light_type='headlight', intensity=0.5, color='lightcyan')
    for light in (sun, sky):
        pl.add_light(light, only_active=True)
    pl.add_mesh(scene.terrain, scalars='color_rgb', rgb=True).prop.interpolation = 'Phong'
    pl.ibr.add_instances(scene.parts(), scene.matrices, index=scene.index, views='half')
    shadows = pl.ibr.add(pvibr.Shadows(resolution=4096))
    pl.add_text(f'{hour}:00, sun {altitude:.0f} degrees high', font_size=9, color='black')
    pl.camera_position = [(-0.7 * half, -2.2 * half, 1.3 * half), (0, 0.15 * half, 0), (0, 0, 1)]
    pl.camera.view_angle = 26
pl.show(auto_close=False)

# %%
# 3. What the lights of the last picture were seen through.
print(shadows.report())
pl.close()
