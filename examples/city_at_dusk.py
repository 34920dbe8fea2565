"""
A city at dusk
==============

Thousands of houses whose windows glow: instances, a look, fog and bloom.
"""

import numpy as np
import pyvista as pv

import pvibr

SIZE = 900
COUNT = 2_500

# %%
# 1. A house of 1 x 1 x 1 with windows as quads before its walls.
rng = np.random.default_rng(7)
house = pv.Cube(center=(0, 0, 0.5))


def windows(rows, columns, lit):
    pane = pv.Plane(direction=(1, 0, 0), i_resolution=1, j_resolution=1)
    pane = pane.scale((1, 0.45 / columns, 0.4 / rows))
    panes = []
    for side, j, i in np.ndindex(4, rows, columns):
        if rng.uniform() < lit:
            moved = pane.translate((0.502, (i + 0.5) / columns - 0.5, (j + 0.6) / rows))
            panes.append(moved.rotate_z(90 * side))
    return pv.merge(panes)


# %%
# 2. Blocks and streets; higher toward the middle.
side = int(np.sqrt(COUNT))
i, j = np.divmod(np.arange(side**2), side)
x, y = (16.0 * (k - side / 2) + 5.0 * (k // 4) for k in (i, j))
away = np.hypot(x, y) / (16 * side / 2)
height = rng.uniform(8, 16, side**2) + 90 * np.exp(-9 * away**2) * rng.uniform(0.3, 1, side**2)
poses = np.zeros((side**2, 4, 4))
poses[:, 0, 0], poses[:, 1, 1] = rng.uniform(9, 14, (2, side**2))
poses[:, 2, 2], poses[:, 0, 3], poses[:, 1, 3], poses[:, 3, 3] = height, x, y, 1

# %%
# 3. Walls are lit by the evening; windows give light, more than the picture shows.
pl = pv.Plotter(window_size=(16 * SIZE // 9, SIZE))
pl.ibr.add_instances(house, poses, color='#6f6a7c', name='houses')
kind = np.digitize(height, (14, 30, 60))
for k, (rows, columns) in enumerate(((4, 6), (8, 8), (16, 8), (32, 9))):
    glass = {'color': '#ffcf7a', 'lighting': False, 'name': f'windows {k}'}
    pl.ibr.add_instances(windows(rows, columns, 0.45), poses[kind == k], **glass)
pl.camera_position = [(-235, -400, 48), (25, 0, 46), (0, 0, 1)]
pl.camera.view_angle = 28
look = pl.ibr.look('dusk')
look.effects['AmbientOcclusion'].radius, sky = 4.0, look.effects['Sky']
sky.top, sky.horizon, sky.bottom, sky.middle = '#0c1440', '#ee9a64', '#6a4a58', 4.0
pl.ibr.add(pvibr.Fog(1100.0, begin=250.0))
pl.ibr.add(pvibr.Bloom(0.6, intensity=1.0))
pl.ibr.add(pvibr.Accumulation(16))
pl.show()
