"""
A forest
========

Thousands of trees of 30 000 triangles each, in one call: near trees are drawn as meshes, far ones
as images, and no outline is further than ``max_error`` pixels from that of the mesh.
"""

import pyvista as pv

import pvibr
from pvibr.scenes.landscape import landscape

SIZE = 900
COUNT = 5_000
TRIANGLES = 30_000

# %%
# 1. A landscape: ground, a mesh for each kind of tree, which kind each tree is, and where it
# stands, as matrices (n, 4, 4).
scene = landscape(COUNT, size=640, triangles=TRIANGLES)

# %%
# 2. All trees at once. They are seen from above the ground only, so half a sphere of views is
# enough, at twice the density.
pl = pv.Plotter(window_size=(16 * SIZE // 9, SIZE))
pl.add_mesh(scene.terrain, scalars='color_rgb', rgb=True).prop.interpolation = 'Phong'
trees = pl.ibr.add_instances(
    scene.parts(), scene.matrices, index=scene.index, max_error=2.0, views='half', name='trees'
)

# %%
# 3. Walk in, early in the morning: light from the side, and haze that is denser in the valley.
pl.camera_position = scene.path(5)[1]
pl.camera.view_angle = scene.view_angle
look = pl.ibr.look('daylight', ground=False)
look.lights[0].position, look.lights[0].intensity = (-0.9, 0.25, 0.55), 2.2
look.effects['AmbientOcclusion'].radius = 1.5
sky = look.effects['Sky']
sky.top, sky.horizon, sky.bottom = '#7fa6cf', '#f4e3c4', '#f4e3c4'
pl.ibr.add(pvibr.Fog(260.0, height=60.0, begin=15.0))
pl.ibr.add(pvibr.Accumulation(4))
pl.show(auto_close=False)

# %%
# 4. What was drawn how, and up to which size on the screen each level was measured to be good.
print(pl.ibr.report())
pl.close()
