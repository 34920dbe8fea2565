"""export_gltf writes every instance."""

import tempfile
from pathlib import Path

import pyvista as pv

pl = pv.Plotter()
pl.ibr.add_instances(pv.Cube(), [(3.0 * x, 0, 0) for x in range(8)], color='red')
with tempfile.TemporaryDirectory() as folder:
    path = Path(folder) / 'cubes.gltf'
    pl.export_gltf(path)
    read = pv.read(path).combine().extract_surface(algorithm=None)
assert read.split_bodies().n_blocks == 8 or read.n_cells == 8 * 12
assert abs(max(read.length, 0) - pv.MultiBlock([pv.Cube(), pv.Cube(center=(21, 0, 0))]).length) < 1
