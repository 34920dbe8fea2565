"""export_gltf writes every instance."""

import tempfile
from pathlib import Path

import numpy as np
import pyvista as pv

pl = pv.Plotter()
pl.ibr.add_instances(pv.Cube(), [(3.0 * x, 0, 0) for x in range(8)], color='red')
with tempfile.TemporaryDirectory() as folder:
    path = Path(folder) / 'cubes.gltf'
    pl.export_gltf(path)
    read = pv.read(path)
corners = np.vstack([block.points for block in read.recursive_iterator() if block.n_points])
assert len(corners) == 8 * pv.Cube().n_points
assert sorted(np.ptp(corners, axis=0).round(3)) == [1, 1, 22]
