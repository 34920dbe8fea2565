"""
Lines
=====

Outlines as a draughtsman draws them, around a selection, through what hides it, and as data.
"""

import pyvista as pv

import pvibr

# %%
# 1. The same machine part, four times.
pl = pv.Plotter(shape=(2, 2), window_size=(1100, 720), border=False)
parts = []
for k in range(4):
    pl.subplot(*divmod(k, 2))
    pl.set_background('white')
    name = ('off', 'all lines', 'one part', 'its hidden parts, dashed')[k]
    pl.add_text(name, font_size=10, color='black')
    ring = pv.CylinderStructured(
        radius=[0.35, 1.0], height=0.4, direction=(0, 0, 1), theta_resolution=80
    )
    wheel = pl.add_mesh(ring.extract_surface(algorithm=None), color='#c9d6df')
    rod = pv.Cylinder(direction=(0, 0, 1), radius=0.33, height=2.4, resolution=60)
    shaft = pl.add_mesh(rod, color='#f0b67f')
    box = pv.Cube(center=(0, -1.3, 0), x_length=1.1, y_length=0.5, z_length=0.9)
    block = pl.add_mesh(box, color='#d6d1b1')
    parts.append((wheel, shaft, block))
    pl.camera_position = [(2.6, -5.2, 3.2), (0, 0, 0), (0, 0, 1)]

# %%
# 2. Off; all lines; one part chosen; the parts of it that are hidden, dashed.
pl.subplot(0, 1)
pl.ibr.add(pvibr.Outline(width=2))
pl.subplot(1, 0)
pl.ibr.add(pvibr.Outline(actors=[parts[2][0]], color=(0.85, 0.1, 0.1), width=4))
pl.subplot(1, 1)
pl.ibr.add(pvibr.Outline(actors=[parts[3][0]], hidden='dashed', color=(0.1, 0.3, 0.9), width=2))
pl.show(auto_close=False)

# %%
# 3. The same as data: polylines of the shaft's silhouette, for a vector drawing.
lines = pvibr.silhouette_lines(rod, pl.camera)
print(lines.n_cells, 'polylines')
pl.close()
