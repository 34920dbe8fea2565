"""
Molecules
=========

Caffeine as balls and sticks, its thermal ellipsoids, and a crowd of it: spheres, cylinders and
ellipsoids without a triangle, exact at any distance.
"""

import numpy as np
import pyvista as pv

import pvibr

COUNT = 1_500
rng = np.random.default_rng(0)

# %%
# 1. Caffeine: atoms, in angstroms, and which of them are bonded.
ELEMENTS = {
    'C': ((90, 90, 95), 0.7),
    'H': ((235, 235, 235), 0.31),
    'N': ((60, 90, 220), 0.71),
    'O': ((220, 50, 40), 0.66),
}
symbols = list('CNCNCCNCNCOCCO') + ['H'] * 10
atoms = np.array([
    [-3.38, -1.13, 0.57], [-2.14, -0.93, -0.15], [-1.81, -1.65, -1.26], [-0.61, -1.26, -1.71],
    [-0.20, -0.27, -0.87], [-1.12, -0.05, 0.11], [-0.82, 0.94, 1.00], [0.39, 1.64, 0.86],
    [1.30, 1.39, -0.14], [0.98, 0.42, -1.03], [1.77, 0.14, -1.95], [-1.74, 1.23, 2.09],
    [2.56, 2.14, -0.25], [0.63, 2.52, 1.67], [-3.19, -1.65, 1.50], [-4.05, -1.70, -0.06],
    [-3.82, -0.17, 0.82], [-2.43, -2.43, -1.68], [-2.62, 0.59, 1.99], [-1.21, 1.02, 3.02],
    [-2.07, 2.27, 2.05], [3.40, 1.45, -0.23], [2.58, 2.70, -1.18], [2.63, 2.84, 0.58],
])  # fmt: skip
colors = np.array([ELEMENTS[s][0] for s in symbols], np.uint8)
size = np.array([ELEMENTS[s][1] for s in symbols])
gaps = np.linalg.norm(atoms[:, None] - atoms, axis=2)
first, second = np.nonzero(np.triu(gaps < 1.2 * (size[:, None] + size), 1))
heavy = np.array(symbols) != 'H'

# %%
# 2. Thermal motion: a tensor for each atom, whose eigenvectors are the axes of its ellipsoid.
spread = rng.normal(size=(heavy.sum(), 3, 3)) * 0.11 + 0.3 * np.eye(3)
values, axes = np.linalg.eigh(spread @ spread.swapaxes(1, 2))

# %%
# 3. Side by side: bonds are half and half in the colours of their atoms.
pl = pv.Plotter(window_size=(1200, 720), lighting='none', border=False)
pl.set_background('white', top='lightsteelblue')
pl.add_light(pv.Light(position=(-15, -25, 30), light_type='scene light'))
pl.add_light(pv.Light(light_type='headlight', intensity=0.35))
shiny = {'specular': 0.4, 'specular_power': 30}
aside = np.array([5.0, 0, 0])
left, right = atoms - aside, atoms + aside
ends = np.stack([colors[first], colors[second]], 1)
pl.ibr.add_spheres(left, 0.45 * size, colors=colors, name='atoms', **shiny)
pl.ibr.add_cylinders(left[first], left[second], 0.13, colors=ends, name='bonds', **shiny)
both = heavy[first] & heavy[second]
pl.ibr.add_cylinders(right[first[both]], right[second[both]], 0.07, color='ivory', caps='round')
pl.ibr.add_ellipsoids(right[heavy], np.sqrt(values), axes, colors=colors[heavy], **shiny)
pl.ibr.add_spheres(right, 1.3 * size, colors=colors, opacity=0.2, name='volume')

# %%
# 4. A crowd of them behind, on a floor that takes shadows.
turns = np.linalg.qr(rng.normal(size=(COUNT, 3, 3)))[0]
low, high = (-110, 35, -4), (110, 220, 10)
places = rng.uniform(low, high, (COUNT, 3))
crowd = np.einsum('nij,aj->nai', turns, atoms) + places[:, None]
pl.ibr.add_spheres(
    crowd.reshape(-1, 3), np.tile(0.45 * size, COUNT), colors=np.tile(colors, (COUNT, 1))
)
sticks = crowd[:, first].reshape(-1, 3), crowd[:, second].reshape(-1, 3)
pl.ibr.add_cylinders(*sticks, 0.13, colors=np.tile(ends, (COUNT, 1, 1)))
pl.add_mesh(pv.Plane(center=(0, 50, -6), i_size=400, j_size=400), color='white')
pl.ibr.add(pvibr.Shadows())
pl.camera.position, pl.camera.focal_point, pl.camera.up = (0, -24, 9), (0, 4, 0.3), (0, 0, 1)
pl.show(auto_close=False)
print(pl.ibr.report())
pl.close()
