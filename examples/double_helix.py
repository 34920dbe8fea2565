"""
A double helix
==============

Atoms as exact spheres, bonds as cylinders, and ambient occlusion, which shows how they lie.
"""

import numpy as np
import pyvista as pv

import pvibr  # noqa: F401

SIZE = 900
COUNT = 46

# %%
# 1. Two backbones of phosphates and sugars around base pairs; in angstroms, schematic.
step, twist = 3.4, np.radians(36)
k = np.arange(COUNT)
rng = np.random.default_rng(2)
points, radii, colors = [], [], []


def add(radius, angle, height, size, color):
    x, y = radius * np.cos(angle), radius * np.sin(angle)
    points.append(np.stack([x, y, height + 0 * angle], 1))
    radii.append(np.full(len(angle), size))
    colors.append(np.broadcast_to(pv.Color(color).float_rgb, (len(angle), 3)))


for strand, shift in enumerate((0.0, np.radians(150))):
    angle, height = k * twist + shift, k * step
    add(9.3, angle, height, 2.0, '#f2a33a')  # phosphorus and its oxygens
    add(8.6, angle + 0.16, height + 1.6, 1.5, '#c8402f')
    add(8.6, angle - 0.16, height + 1.5, 1.5, '#c8402f')
    add(7.0, angle + 0.22, height + 0.4, 1.8, '#9aa3ad')  # sugar
    add(6.6, angle - 0.05, height + 0.2, 1.8, '#9aa3ad')
    for inner in (4.6, 3.1, 1.6):  # bases, flat and stacked
        turn = np.radians(75 - 12 * inner) * (1 - 2 * strand)
        color = '#3d6fb5' if inner == 3.1 else '#5d8f6a'
        add(inner, angle + turn * 0.35, height, 1.65, color)
points, radii, colors = map(np.concatenate, (points, radii, colors))

# %%
# 2. It lies on paper-white ground, a little turned.
turn = pv.Transform().rotate_y(90).rotate_x(20).matrix
points = points @ turn[:3, :3].T
pl = pv.Plotter(window_size=(16 * SIZE // 9, SIZE))
pl.ibr.add_spheres(points, radius=radii, colors=colors, name='atoms')
pl.camera_position = [(-14, -125, 62), (78, 0, -1), (0, 0, 1)]
pl.camera.view_angle = 30
look = pl.ibr.look('studio')
look.effects['AmbientOcclusion'].radius = 6.0
pl.show(auto_close=False)
pl.close()
