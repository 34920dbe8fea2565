"""
Molecules
=========

Caffeine as balls and sticks, as thermal ellipsoids, and packed as in a crystal: spheres, cylinders
and ellipsoids without a triangle, exact at any distance.
"""

import numpy as np
import pyvista as pv

import pvibr

SIZE = 900
COUNT = 120
rng = np.random.default_rng(0)

# %%
# 1. Caffeine: its atoms, in angstroms; which are bonded; a tensor of thermal motion for each.
atoms = np.array([
    [-3.38, -1.13, 0.57], [-2.14, -0.93, -0.15], [-1.81, -1.65, -1.26], [-0.61, -1.26, -1.71],
    [-0.20, -0.27, -0.87], [-1.12, -0.05, 0.11], [-0.82, 0.94, 1.00], [0.39, 1.64, 0.86],
    [1.30, 1.39, -0.14], [0.98, 0.42, -1.03], [1.77, 0.14, -1.95], [-1.74, 1.23, 2.09],
    [2.56, 2.14, -0.25], [0.63, 2.52, 1.67], [-3.19, -1.65, 1.50], [-4.05, -1.70, -0.06],
    [-3.82, -0.17, 0.82], [-2.43, -2.43, -1.68], [-2.62, 0.59, 1.99], [-1.21, 1.02, 3.02],
    [-2.07, 2.27, 2.05], [3.40, 1.45, -0.23], [2.58, 2.70, -1.18], [2.63, 2.84, 0.58],
])  # fmt: skip
element = np.array([0, 2, 0, 2, 0, 0, 2, 0, 2, 0, 3, 0, 0, 3] + [1] * 10)  # C, H, N, O
colors = np.array([[90, 90, 95], [235] * 3, [60, 90, 220], [220, 50, 40]], np.uint8)[element]
size = np.array([0.7, 0.31, 0.71, 0.66])[element]
gaps = np.linalg.norm(atoms[:, None] - atoms, axis=2)
bonds = np.argwhere(np.triu(gaps < 1.2 * (size[:, None] + size), 1))
heavy = element != 1
spread = rng.normal(size=(heavy.sum(), 3, 3)) * 0.11 + 0.3 * np.eye(3)
values, axes = np.linalg.eigh(spread @ spread.swapaxes(1, 2))

# %%
# 2. Side by side: bonds are half and half in the colours of their atoms.
pl = pv.Plotter(window_size=(16 * SIZE // 9, SIZE))
pl.ibr.add_spheres(atoms, 0.45 * size, colors=colors, specular=0.4)
pl.ibr.add_cylinders(*atoms[bonds.T], 0.13, colors=colors[bonds], specular=0.4)
right, inner = atoms + np.array([9.5, -0.5, 0.5]), bonds[heavy[bonds].all(1)]
pl.ibr.add_cylinders(*right[inner.T], 0.07, color='ivory', caps='round')
pl.ibr.add_ellipsoids(right[heavy], np.sqrt(values), axes, colors=colors[heavy], specular=0.4)
pl.ibr.add_spheres(right, 1.3 * size, colors=colors, opacity=0.2)

# %%
# 3. A crystal of them behind, atom beside atom, and a ruler.
deep, wide, high = np.unravel_index(np.arange(COUNT), (COUNT // 30 + 1, 10, 3))
cells = np.column_stack([7.2 * wide - 28.4 + 3.6 * (deep % 2), 20 + 4.9 * deep, 0.5 + 4.8 * high])
packed = (atoms + cells[:, None]).reshape(-1, 3)
pl.ibr.add_spheres(packed, np.tile(1.3 * size, COUNT), colors=np.tile(colors, (COUNT, 1)))
pl.ibr.add_cylinders([[-0.5, -5.0, -2.2]], [[9.5, -5.0, -2.2]], 0.06, color='#33373d')
pl.add_point_labels([[4.5, -6.5, -2.2]], ['1 nm'], font_size=24, shape=None, show_points=False)
pl.camera_position, pl.camera.view_angle = [(4.5, -36, 16), (4.5, 4, 0.4), (0, 0, 1)], 25
effects = pl.ibr.look('studio').effects
effects['AmbientOcclusion'].radius, effects['Shadows'].resolution = 2.5, 1024
pl.ibr.add(pvibr.Fog(90.0, begin=40.0))
pl.ibr.add(pvibr.Accumulation(24))
pl.show()
