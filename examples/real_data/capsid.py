"""
A virus shell
=============

The 1 680 capsomers of the chlorella virus (PDB 1M4X, CC0), 16 million atoms, each capsomer as the
surface of a sum of Gaussians. Coloured by the distance from the middle.
"""

from pathlib import Path

import numpy as np
import pyvista as pv

FILE = Path('../shared/data/instances/capsids/1M4X.npz')

# %%
# 1. A capsomer's surface.
data = np.load(FILE)
atoms = pv.PolyData(data['atoms'])
density = atoms.gaussian_splatting(radius=0.03, dimensions=(120, 120, 120))
surface = density.contour([0.2]).smooth_taubin(n_iter=10)
print(f'{surface.n_cells:,} triangles, {surface.n_cells * len(data["matrices"]):,} in all')

# %%
# 2. All of them.
centers = data['matrices'] @ [*surface.center, 1.0]
distance = np.linalg.norm(centers[:, :3], axis=1)
pl = pv.Plotter(window_size=(1280, 720))
shell = pl.ibr.add_instances(
    surface, data['matrices'], scalars=distance, cmap='Spectral', name='radius (Å)'
)
pl.show()
