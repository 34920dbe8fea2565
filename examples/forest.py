"""
A forest
========

Thousands of trees of 50 000 triangles each, in one call. Near trees are drawn as meshes, far ones
as images, and no outline is further than ``max_error`` pixels from that of the mesh.
"""

import pyvista as pv

import pvibr  # noqa: F401  PyVista finds pl.ibr by itself; this only says where it comes from
from pvibr.scenes.landscape import landscape

COUNT = 5_000
TRIANGLES = 50_000

# %%
# 1. A landscape: ground, a mesh for each kind of tree, which kind each tree is, and where it
# stands, as matrices (n, 4, 4).
scene = landscape(COUNT, triangles=TRIANGLES)

# %%
# 2. All trees at once. They are seen from above the ground only, so half a sphere of views is
# enough, at twice the density.
pl = pv.Plotter(window_size=(960, 540), lighting='none')
for light in scene.lights():  # the sun and the sky
    pl.add_light(light)
pl.background_color = 'lightsteelblue'
pl.add_mesh(scene.terrain, scalars='color_rgb', rgb=True).prop.interpolation = 'Phong'
trees = pl.ibr.add_instances(
    scene.parts(), scene.matrices, index=scene.index, max_error=1.0, views='half', name='trees'
)

# %%
# 3. Walk in.
pl.camera_position = scene.path(5)[1]
pl.camera.view_angle = scene.view_angle
pl.show(auto_close=False)

# %%
# 4. What was drawn how, and up to which size on the screen each level was measured to be good.
print(pl.ibr.report())
pl.close()
