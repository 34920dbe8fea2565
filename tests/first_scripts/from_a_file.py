"""A first scene: instances of a mesh that was read from a file."""

import tempfile
from pathlib import Path

import numpy as np
import pyvista as pv

with tempfile.TemporaryDirectory() as folder:
    path = Path(folder) / 'tree.ply'
    pv.Cone(direction=(0, 0, 1), resolution=60).save(path)
    tree = pv.read(path)
points = np.random.default_rng(0).uniform(-500, 500, (10_000, 3)) * [1, 1, 0]

pl = pv.Plotter()
trees = pl.ibr.add_instances(tree, points, max_error=1.0)  # in pixels
trees.scalars = points[:, 0]  # one value per instance, mapped as add_mesh does
pl.show(auto_close=False)
print(pl.ibr.report())  # levels, their measured errors, bytes, times

picture = pl.screenshot()
assert (picture != picture[0, 0]).any()
assert len(pl.scalar_bars) == 1
pl.close()
