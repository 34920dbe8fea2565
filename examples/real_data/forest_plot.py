"""
Every stem of a forest
======================

The 51 250 living stems of the SCBI ForestGEO plot in Virginia (CC-BY-4.0), each a tree of 50 000
triangles, as high as its trunk is thick. Files: github.com/SCBI-ForestGEO/SCBI-ForestGEO-Data.
"""

from pathlib import Path

import numpy as np
import pyvista as pv
from scipy.interpolate import griddata

from pvibr.maths.transforms import trs
from pvibr.scenes.trees import tree_parts

FOLDER = Path('../shared/data/instances/scbi_forestgeo')

# %%
# 1. Where the stems are and how thick, and the height of the ground.
columns = {'delimiter': ',', 'skip_header': 1}
stems = np.genfromtxt(FOLDER / 'scbi_alive_stems_2018.csv.gz', usecols=(2, 3, 4), **columns)
stems = stems[np.isfinite(stems).all(1)]
lines = (FOLDER / 'scbi_elev.csv').read_text().splitlines()[1:]
known = np.array([line.rsplit(',', 3)[1:] for line in lines], float)
x, y = np.meshgrid(np.arange(0, 401, 5.0), np.arange(0, 641, 5.0), indexing='ij')


def ground(places):
    found = griddata(known[:, :2], known[:, 2], places)
    return np.where(
        np.isfinite(found), found, griddata(known[:, :2], known[:, 2], places, 'nearest')
    )


# %%
# 2. A trunk of 30 cm carries a tree of 22 m; the mesh is 16 m high.
height = 22 * (stems[:, 2] / 300) ** 0.6
angle = np.random.default_rng(0).uniform(0, np.pi, len(stems))
turn = np.stack([np.cos(angle), 0 * angle, 0 * angle, np.sin(angle)], 1)
places = np.column_stack([stems[:, :2], ground(stems[:, :2])])
poses = trs(places, turn, height / 16)

# %%
# 3. Ground and trees.
pl = pv.Plotter(window_size=(1280, 720))
pl.background_color = 'lightsteelblue'
pl.add_mesh(pv.StructuredGrid(x, y, ground((x, y))), color=(0.35, 0.38, 0.22))
trees = pl.ibr.add_instances([tree_parts('broadleaf', height=16)], poses, views='half')
pl.camera_position = [(-140, -140, 480), (200, 320, 300), (0, 0, 1)]
pl.show()
