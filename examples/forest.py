"""
A forest
========

Thousands of trees of 30 000 triangles each, in one call: near trees are drawn as meshes, far ones
as images, and no outline is further than ``max_error`` pixels from that of the mesh.
"""

import numpy as np
import pyvista as pv
from scipy.spatial.transform import Rotation

import pvibr
from pvibr.scenes.landscape import landscape

SIZE = 900
COUNT = 5_000
TRIANGLES = 30_000

# %%
# 1. A landscape: ground, a mesh for each kind of tree, each tree's kind, and where it stands.
scene = landscape(COUNT, size=640, triangles=TRIANGLES)

# %%
# 2. All trees at once. They are seen from above only: half a sphere of views is enough.
pl = pv.Plotter(window_size=(16 * SIZE // 9, SIZE))
pl.add_mesh(scene.terrain, scalars='color_rgb', rgb=True).prop.interpolation = 'Phong'
trees = pl.ibr.add_instances(
    scene.parts(), scene.matrices, index=scene.index, max_error=2.0, views='half', name='trees'
)

# %%
# 3. Tufts of grass around the eye: some blades each, drawn as meshes at any size.
pl.camera_position, pl.camera.view_angle = scene.path(5)[1], scene.view_angle
rng, many = np.random.default_rng(0), 5 * COUNT
side, up = 0.03 * rng.normal(size=(20, 3)) * (1, 1, 0), np.array([0, 0, 0.5])
root, lean = rng.normal(0, 0.25, (2, 20, 3)) * (1, 1, 0.3)
blades = np.stack([root - side, root + side, root + lean + up], axis=1).reshape(-1, 3)
tuft = pv.PolyData.from_regular_faces(blades, np.arange(60).reshape(-1, 3))
tuft.point_data.active_normals = np.tile([0.0, 0.0, 1.0], (60, 1))  # lit as the ground is
away = 150 * rng.random(many) * np.exp(2j * np.pi * rng.random(many))
spots = np.column_stack([away.real, away.imag]) + pl.camera.position[:2]
feet = np.column_stack([spots, scene.height_at(spots)])
turns = Rotation.from_euler('z', rng.uniform(0, 6, (many, 1)))
poses = pvibr.matrices(feet, turns, rng.uniform(0.5, 1.4, many))
colors = (np.array([140, 160, 80]) + rng.random((many, 1)) * (50, 30, 30)) / 255
pl.ibr.add_instances(tuft, poses, colors=colors, smooth_shading=True, ambient=0.2, name='grass')

# %%
# 4. Early in the morning: light from the side, and haze that is denser in the valley.
look = pl.ibr.look('daylight', ground=False)
look.lights[0].position, look.lights[0].intensity = (-0.9, 0.25, 0.55), 1.8
occlusion, shadows = look.effects['AmbientOcclusion'], look.effects['Shadows']
occlusion.radius, occlusion.strength = 3.0, 0.4
shadows.method, shadows.casts = 'pcf', [trees]
sky = look.effects['Sky']
sky.top, sky.horizon, sky.bottom = '#7fa6cf', '#f4e3c4', '#f4e3c4'
pl.ibr.add(pvibr.Fog(260.0, height=60.0, begin=15.0))
pl.ibr.add(pvibr.Accumulation(8))
pl.show()
