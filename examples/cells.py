"""
Blood cells
===========

Red cells and a few white ones, as instances in a look without a ground: fog, and a lens that is
wide open.
"""

import numpy as np
import pyvista as pv
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

import pvibr

SIZE = 900
COUNT = 2_000
rng = np.random.default_rng(4)

# %%
# 1. A red cell after Evans and Fung (1972), 7.8 micrometres wide; a white one has folds.
red = pv.Sphere(radius=1, theta_resolution=60, phi_resolution=60)
away = np.minimum(np.hypot(*red.points[:, :2].T), 1)
rim = np.sqrt(1 - away**2) * (0.207 + 2.003 * away**2 - 1.123 * away**4) / 2
red.points[:, 2] = np.sign(red.points[:, 2]) * rim
red = red.scale(3.9).compute_normals(cell_normals=False)
white = pv.Icosphere(radius=1, nsub=5)
folds = sum(np.sin(white.points @ rng.normal(0, 9, 3) + k) for k in range(40))
white.points *= 5.6 + 0.028 * folds[:, None]
white = white.compute_normals(cell_normals=False)

# %%
# 2. They drift, none in another: of two that are too close, the first stays.
places = rng.uniform((-80, 6, -45), (80, 180, 45), (COUNT, 3))
near = cKDTree(places).query_pairs(7.4, output_type='ndarray')
places = np.delete(places, np.unique(near[:, 1]), axis=0)
turns = Rotation.random(len(places), random_state=4)
is_white = np.arange(len(places)) % 41 == 7

# %%
# 3. Plasma dims what is far; the lens is focused 42 micrometres away.
pl = pv.Plotter(window_size=(16 * SIZE // 9, SIZE))
shine = {'smooth_shading': True, 'specular': 0.4, 'specular_power': 18, 'ambient': 0.16}
poses = pvibr.matrices(places, turns)
pl.ibr.add_instances(red, poses[~is_white], color='#c22a22', name='red', **shine)
pl.ibr.add_instances(white, poses[is_white], color='#e9dfc8', name='white', **shine)
pl.camera_position = [(0, -20, 2), (3, 60, 0), (0, 0, 1)]
pl.camera.view_angle = 40
look = pl.ibr.look('studio', ground=False)
sky = look.effects['Sky']
sky.top, sky.horizon, sky.bottom = '#5c1512', '#d98a72', '#5c1512'
look.effects['AmbientOcclusion'].radius, shadows = 5.0, look.effects['Shadows']
shadows.method, shadows.strength = 'pcf', 0.55
pl.ibr.add(pvibr.Fog(90.0, begin=30.0, color='#b8614c'))
pl.ibr.add(pvibr.DepthOfField(radius=0.8, distance=42.0))
pl.ibr.add(pvibr.Accumulation(16))
pl.show(auto_close=False)
pl.close()
