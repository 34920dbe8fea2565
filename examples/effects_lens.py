"""
A lens
======

What a pinhole sees, and a lens that is sharp at one of a row of figures: the focus is an actor.
"""

import numpy as np
import pyvista as pv

import pvibr

# %%
# 1. The same row of pawns, four times.
radius = np.array([0.34, 0.34, 0.2, 0.13, 0.22, 0.1, 0.2, 0.0])
height = np.array([0.0, 0.12, 0.2, 0.6, 0.66, 0.7, 0.86, 1.05])
line = pv.Spline(np.column_stack([radius, 0 * radius, height]), 80)
pawn = line.extrude_rotate(resolution=48, capping=False, rotation_axis=(0, 0, 1))
pawn = pawn.compute_normals(split_vertices=True, feature_angle=40)

pl = pv.Plotter(shape=(2, 2), window_size=(1100, 680), border=False)
colors = ('#b23a48', '#e9c46a', '#2a9d8f', '#e9ecef', '#5e548e')
rows = []
for k in range(4):
    pl.subplot(*divmod(k, 2))
    pl.set_background('#20262e', top='#525c69')
    pl.add_mesh(pv.Plane(i_size=20, j_size=20, i_resolution=20, j_resolution=20), color='#8a8f98',
                show_edges=True, edge_color='#70757e')  # fmt: skip
    name = ('a pinhole', 'focus on the second', 'focus on the fourth', 'circles')[k]
    pl.add_text(name, font_size=10, color='white')
    row = [pawn.translate((0.75 * i - 1.2, 1.3 * i, 0)) for i in range(len(colors))]
    rows.append([pl.add_mesh(one, color=c) for one, c in zip(row, colors, strict=True)])
    pl.camera_position = [(-1.0, -3.6, 1.5), (-0.1, 2.2, 0.45), (0, 0, 1)]

# %%
# 2. Off; focus on the second and on the fourth; and how wide each point is spread: red before
# the plane in focus, green behind it.
lenses = {1: (1, ''), 2: (3, ''), 3: (1, 'coc')}
for k, (number, stage) in lenses.items():
    pl.subplot(*divmod(k, 2))
    pl.ibr.add(pvibr.DepthOfField(rows[k][number], radius=0.09, limit=0.08, debug=stage))
pl.show(auto_close=False)
print(pl.ibr.report())
pl.close()
