"""
Spheres
=======

A helix of atoms beside a heap of grains: no triangles, yet silhouettes, normals, depth and shadows
of true spheres, at any distance.
"""

import numpy as np
import pyvista as pv

import pvibr  # noqa: F401

COUNT = 100_000
rng = np.random.default_rng(0)

# %%
# 1. A double helix: each atom with its radius and the colour of its element.
turns = np.linspace(0, 5 * np.pi, 90)
strands = []
for phase in (0.0, 2.4):
    strands.append(np.c_[2 * np.cos(turns + phase), 2 * np.sin(turns + phase), 0.75 * turns])
share = np.linspace(0.2, 0.8, 5)[:, None, None]
rungs = (strands[0] * (1 - share) + strands[1] * share)[:, ::3].reshape(-1, 3)
atoms = np.r_[strands[0], strands[1], rungs] + [0, 0, 0.7]
element = np.r_[np.tile([0, 1, 1], 60), rng.integers(1, 4, len(rungs))]
radii = np.array([0.6, 0.5, 0.42, 0.4])[element]
colors = np.array([[255, 150, 40], [90, 90, 95], [60, 90, 220], [220, 50, 40]], np.uint8)[element]

# %%
# 2. A heap: a hundred thousand grains, coloured by height.
r, turn = 7 * np.sqrt(rng.uniform(0, 1, COUNT)), rng.uniform(0, 2 * np.pi, COUNT)
height = rng.uniform(0, 1, COUNT) * 3.5 * (1 - r / 7)
grains = np.c_[9 + r * np.cos(turn), 2 + r * np.sin(turn), height + 0.03]

# %%
# 3. All together; in a look, each throws a shadow on the others and on the ground.
pl = pv.Plotter(window_size=(960, 540))
pl.ibr.add_spheres(atoms, radii, colors=colors, specular=0.4, specular_power=40, name='atoms')
pl.ibr.add_spheres(
    grains, rng.uniform(0.04, 0.09, len(grains)), scalars=height, cmap='YlOrBr_r',
    show_scalar_bar=False, name='grains',
)  # fmt: skip
pl.camera.position, pl.camera.focal_point, pl.camera.up = (2, -34, 12), (5, 0, 5.4), (0, 0, 1)
pl.ibr.look('studio').effects['AmbientOcclusion'].radius = 1.0
pl.show(auto_close=False)
print(pl.ibr.report())
pl.close()
