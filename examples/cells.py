"""
Fifty thousand rings
====================

Any dataset will do: of an unstructured grid the surface is drawn. Holes stay holes in the images,
and what is behind them is seen.
"""

import numpy as np
import pyvista as pv
from scipy.spatial.transform import Rotation

COUNT = 50_000
rng = np.random.default_rng(1)

# %%
# 1. A mesh with a hole, as an unstructured grid with values at its points.
ring = pv.ParametricTorus(ringradius=0.35, crosssectionradius=0.12, u_res=60, v_res=30)
ring['height'] = ring.points[:, 2]
grid = ring.cast_to_unstructured_grid()
print(f'{grid.n_cells:,} cells each, {COUNT * grid.n_cells:,} in all')

# %%
# 2. Everywhere in a box, turned every way, of many sizes: a rotation times a scale.
turn = Rotation.random(COUNT, random_state=1).as_matrix()
poses = np.tile(np.eye(4), (COUNT, 1, 1))
poses[:, :3, :3] = turn * rng.uniform(0.5, 1.2, (COUNT, 1, 1))
poses[:, :3, 3] = rng.uniform(0, COUNT ** (1 / 3), (COUNT, 3))

# %%
# 3. The scalars are the mesh's own; their colours are baked into the images.
pl = pv.Plotter(window_size=(960, 540))
rings = pl.ibr.add_instances(grid, poses, scalars='height', cmap='coolwarm', show_scalar_bar=False)
pl.camera_position = 'xy'
pl.camera.zoom(3)
pl.show(auto_close=False)
print(pl.ibr.report())
pl.close()
