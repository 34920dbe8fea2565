"""
An island
=========

Four thousand trees of 30 000 triangles each on an island in the morning haze.
"""

import numpy as np
import pyvista as pv
from scipy.spatial.transform import Rotation

import pvibr
from pvibr.scenes.trees import tree, with_looks

SIZE = 900
COUNT = 4_000
TRIANGLES = 30_000

# %%
# 1. A terrain of a few hills that falls under the sea at its rim; metres.
rng = np.random.default_rng(11)
n = 220
axis = np.linspace(-400, 400, n)
x, y = np.meshgrid(axis, axis)
z = np.zeros_like(x)
for wave in (400, 210, 110, 55, 28):
    for a, p in rng.uniform(0, 2 * np.pi, (5, 2)):
        z += 0.055 * wave * np.sin(2 * np.pi * (np.cos(a) * x + np.sin(a) * y) / wave + p)
height = 70 * np.exp(-((np.hypot(x, 1.2 * y) / 230) ** 2)) + 0.5 * z - 14
terrain = pv.StructuredGrid(x, y, height).extract_surface(algorithm='dataset_surface')
terrain = terrain.triangulate().compute_normals(cell_normals=False, split_vertices=False)
above, up = terrain.points[:, 2], np.abs(terrain['Normals'][:, 2])
sand, grass, rock = (np.array(pv.Color(c).int_rgb) for c in ('#cdbb8e', '#64763c', '#7b7266'))
colors = np.where((above < 2.5)[:, None], sand, grass)
colors = np.where(((up < 0.74) & (above > 2.5))[:, None], rock, colors)
terrain['rgb'] = (colors * rng.uniform(0.82, 1.08, (n * n, 1))).astype(np.uint8)

# %%
# 2. Trees where it is green.
free = np.flatnonzero((above > 4) & (up > 0.85))
feet = terrain.points[rng.choice(free, COUNT)] - (0, 0, 0.3)
kinds = 'broadleaf', 'conifer', 'poplar'
parts = [with_looks(tree(kind, triangles=TRIANGLES), kind) for kind in kinds]
turns = Rotation.from_euler('z', rng.uniform(0, 360, (COUNT, 1)), degrees=True)
poses = pvibr.matrices(feet, turns, rng.uniform(0.6, 1.1, COUNT))

# %%
# 3. The look's ground is the sea.
pl = pv.Plotter(window_size=(16 * SIZE // 9, SIZE))
pl.add_mesh(terrain, scalars='rgb', rgb=True, smooth_shading=True)
pl.ibr.add_instances(parts, poses, index=rng.integers(0, 3, COUNT), views='half', name='trees')
pl.camera_position = [(-250, -620, 105), (10, 0, 20), (0, 0, 1)]
pl.camera.view_angle = 26
look = pl.ibr.look('daylight')
look.lights[0].intensity, look.effects['Sky'].middle = 1.15, 12.0
look.effects['Ground'].color, look.effects['Ground'].height = '#2c6484', 0.0
look.effects['AmbientOcclusion'].radius = 6.0
pl.ibr.add(pvibr.Fog(2600.0))
pl.ibr.add(pvibr.Accumulation(8))
pl.show()
