"""
A gyroid
========

A minimal surface in a cube, coloured by its distance from the middle: a look, contact shadows and
a scalar bar.
"""

import numpy as np
import pyvista as pv

import pvibr  # noqa: F401

SIZE = 900

# %%
# 1. The surface where sin x cos y + sin y cos z + sin z cos x is 0, as a sheet of some thickness.
n = 101
grid = pv.ImageData(dimensions=(n, n, n), spacing=(1 / (n - 1),) * 3)
x, y, z = 5 * np.pi * grid.points.T
level = np.sin(x) * np.cos(y) + np.sin(y) * np.cos(z) + np.sin(z) * np.cos(x)
grid['sheet'] = 0.25 - np.abs(level)
solid = grid.clip_scalar(scalars='sheet', value=0.0, invert=False).extract_largest()
sheet = solid.extract_surface(algorithm='dataset_surface').triangulate()
sheet = sheet.smooth_taubin(n_iter=10, pass_band=0.2)
sheet['radius'] = np.linalg.norm(sheet.points - 0.5, axis=1)

# %%
# 2. It stands in a studio.
pl = pv.Plotter(window_size=(16 * SIZE // 9, SIZE))
pl.add_mesh(
    sheet,
    scalars='radius',
    cmap='plasma',
    smooth_shading=True,
    split_sharp_edges=True,
    specular=0.3,
    specular_power=20,
    scalar_bar_args={'vertical': True, 'position_x': 0.86, 'position_y': 0.25, 'color': 'black'},
)
pl.camera_position = [(2.6, -2.2, 1.55), (0.5, 0.5, 0.42), (0, 0, 1)]
pl.camera.view_angle = 28
pl.ibr.look('studio')
pl.show(auto_close=False)
pl.close()
