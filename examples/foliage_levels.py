"""
Levels of a plant
=================

What consists of many small parts needs no triangle for each of them: a leaf is a textured quad, a
bunch of leaves is three, and a tree that is far is one that turns to the eye.
"""

import numpy as np
import pyvista as pv

import pvibr
from pvibr.scenes.trees import tree_parts

TRIANGLES = 40_000

# %%
# 1. The levels. Leaves are what is connected and small; ``labels`` would name them.
tree = tree_parts('broadleaf', triangles=TRIANGLES)
levels = pvibr.foliage_levels(tree, views=16)

# %%
# 2. What each level costs and how far it is from the mesh.
print(levels.measure(size=96, directions=3))

# %%
# 3. In a scene the levels are chosen by their error: each is drawn up to the size at which its
# measured error is below ``max_error``.
x, y = np.meshgrid(np.linspace(-140, 140, 15), np.linspace(0, 420, 22))
points = np.column_stack([x.ravel(), y.ravel(), np.zeros(x.size)])
points[:, :2] += np.random.default_rng(1).uniform(-7, 7, (len(points), 2))
pl = pv.Plotter(window_size=(1200, 420), border=False)
pl.ibr.add_instances(levels, points, max_error=2.0, name='trees')
pl.camera.position, pl.camera.focal_point, pl.camera.up = (0, -40, 11), (0, 100, 5), (0, 0, 1)
look = pl.ibr.look('daylight')
look.effects['Ground'].color = '#8d9a68'
look.effects['AmbientOcclusion'].radius = 3.0
pl.ibr.add(pvibr.Fog(500.0))
pl.show(auto_close=False)
print(pl.ibr.report())
pl.close()

# %%
# 4. The levels in a row: the mesh, a quad a leaf, three a bunch, and a turntable.
pl = pv.Plotter(window_size=(1200, 420), border=False)
for k, name in enumerate(('mesh', 'parts', 'clusters')):
    for actor in levels.actors(name):
        actor.position = (16 * k, 0, 0)
        pl.add_actor(actor)
pl.ibr.add_billboards([[48, 0, 0]], **levels.turntable)
pl.camera.position, pl.camera.focal_point, pl.camera.up = (24, -75, 10), (24, 0, 7), (0, 0, 1)
pl.camera.view_angle = 17
pl.show(auto_close=False)
pl.close()
