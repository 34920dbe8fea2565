"""
A macro photograph
==================

A lens that is wide open, close to what it looks at: depth of field in a look.
"""

import numpy as np
import pyvista as pv
from pyvista import examples
from scipy.spatial.transform import Rotation

import pvibr

SIZE = 900
COUNT = 60

# %%
# 1. An ant that comes with PyVista, made round, and more of them behind it.
ant = pv.read(examples.antfile).clean().subdivide(2, 'loop').rotate_x(90)
ant = ant.compute_normals()
rng = np.random.default_rng(5)
places = np.column_stack(
    [rng.uniform(-160, 160, COUNT), rng.uniform(60, 420, COUNT), 0 * np.ones(COUNT)]
)

# %%
# 2. Those behind are instances; light comes from a low sun.
pl = pv.Plotter(window_size=(16 * SIZE // 9, SIZE))
pl.add_mesh(ant, color='#7a3b1e', smooth_shading=True, specular=0.7, specular_power=40)
turns = Rotation.from_euler('z', rng.uniform(0, 360, (COUNT, 1)), degrees=True)
poses = pvibr.matrices(places, turns)
pl.ibr.add_instances(ant, poses, color='#7a3b1e', specular=0.5, name='others')
pl.camera_position = [(34, -46, 7), (2, 0, -0.6), (0, 0, 1)]
pl.camera.view_angle = 28
effects = pl.ibr.look('daylight').effects
effects['AmbientOcclusion'].radius, effects['Shadows'].method = 2.5, 'pcf'
pl.ibr.add(pvibr.DepthOfField(radius=0.7, distance=50.0))
pl.ibr.add(pvibr.Accumulation(32))
pl.show()
