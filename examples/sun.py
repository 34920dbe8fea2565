"""
Shadows by the hour
===================

A stone circle on a day in June: the sun stands where it stood over Salisbury Plain.
"""

from datetime import datetime, timedelta, timezone

import numpy as np
import pyvista as pv

import pvibr
from pvibr.shadows.sun import sun_direction, sun_position

SIZE = 450
PLACE, rng = (51.18, -1.83), np.random.default_rng(8)

# %%
# 1. A weathered stone, and where stones stand and lie; metres, x to the east, y to the north.
block = pv.Cube().triangulate().subdivide(5)
block.points /= (np.abs(2 * block.points) ** 6).sum(axis=1, keepdims=True) ** (1 / 6)
waves = rng.normal(0, 9, (40, 3))


def stone(x, y, z, degrees, size):
    worn = np.sin((block.points + rng.uniform(0, 9, 3)) @ waves.T).sum(axis=1, keepdims=True)
    mesh = pv.PolyData(block.points * (1 + 0.006 * worn), block.faces).scale(size)
    return mesh.rotate_z(degrees).rotate_x(rng.normal(0, 1.5)).translate((x, y, z))


stones = [stone(-6, 5, 2.6, 130, (1.3, 2.4, 5.6)), stone(-2.4, 8, 2.6, 130, (1.3, 2.4, 5.6))]
stones += [stone(-4.2, 6.5, 5.8, 130, (1.3, 7.0, 1.0)), stone(5, -3, 0.3, 40, (4, 2, 1.0))]
for a in np.delete(np.arange(0, 360, 20), (4, 5, 12)):
    x, y = 15 * np.cos(np.radians((a, a + 10))), 15 * np.sin(np.radians((a, a + 10)))
    stones.append(stone(x[0], y[0], 1.9, a, (1.1, 2.1, 4.2)))
    if a in (0, 20, 120, 140, 160, 280, 300, 320):
        stones.append(stone(x[1], y[1], 4.45, a + 10, (1.1, 5.4, 0.9)))
stones = pv.merge(stones).compute_normals(cell_normals=False, feature_angle=60)

# %%
# 2. The same view at four hours, each with its own sun.
pl = pv.Plotter(shape=(2, 2), window_size=(32 * SIZE // 9, 2 * SIZE), border=False)
for panel, hour in enumerate((6, 9, 13, 19)):
    time = datetime(2026, 6, 21, hour, tzinfo=timezone(timedelta(hours=1)))
    altitude = sun_position(time, *PLACE)[1]
    pl.subplot(*divmod(panel, 2))
    pl.add_mesh(stones, color='#b5aea0', smooth_shading=True)
    pl.camera_position, pl.camera.view_angle = [(-9, -44, 11), (0, 0, 2.2), (0, 0, 1)], 28
    look, low = pl.ibr.look('daylight'), np.clip(altitude / 40, 0, 1)
    sun, above = look.lights[:2]
    above.intensity += 0.3 * (1 - low)
    sun.position, sun.intensity = sun_direction(time, *PLACE), 2.2 - 1.3 * low
    sun.diffuse_color = 1.0, 0.72 + 0.24 * low, 0.5 + 0.4 * low
    sky, pale = look.effects['Sky'], np.array([0.97, 0.76, 0.56])
    sky.horizon, sky.middle = pale + low * (sky.horizon - pale), 20.0
    look.effects['Ground'].color, look.effects['AmbientOcclusion'].radius = '#8f9a62', 1.2
    pl.ibr.add(pvibr.Accumulation(16))
    pl.add_text(f'{hour}:00, sun {altitude:.0f} degrees high', font_size=12, color='black')
pl.show()
