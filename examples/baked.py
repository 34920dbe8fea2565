"""
A scene for browsers
====================

A page that draws by itself, and a glTF file, know meshes and colours only. What pvibr draws
becomes that: shadows and a picture as colours, poles and stones as meshes, within a number of
triangles.
"""

import tempfile
from pathlib import Path

import numpy as np
import pyvista as pv
from pyvista import examples

import pvibr

COUNT = 150
rng = np.random.default_rng(3)

# %%
# 1. Poles and stones around a ball, a picture thrown onto the ground, a sun with shadows, a sky.
pl = pv.Plotter(window_size=(960, 540), lighting='none')
pl.add_light(pv.Light(position=(-6, -9, 12), light_type='scene light', intensity=0.9))
pl.add_light(pv.Light(light_type='headlight', intensity=0.2))
ground = pl.add_mesh(pv.Plane(i_size=24, j_size=24), color='wheat', name='ground')
pl.add_mesh(pv.Sphere(radius=1.6, center=(0, 0, 1.6)), color='firebrick', smooth_shading=True)
feet = rng.uniform(-11, 11, (COUNT, 2))
ends = np.c_[feet, np.zeros(COUNT)], np.c_[feet, np.full(COUNT, 1.2)]
pl.ibr.add_cylinders(*ends, 0.12, color='sienna', name='poles')
pl.ibr.add_spheres(
    np.c_[rng.uniform(-11, 11, (COUNT, 2)), np.full(COUNT, 0.3)], 0.3,
    scalars=rng.uniform(0, 1, COUNT), cmap='Greys', show_scalar_bar=False, name='stones',
)  # fmt: skip
above = pvibr.Orthographic.from_extent(-5, 5, -3, 3, zmax=0.5)
pl.ibr.add(pvibr.Projector(examples.mapfile, above, actors=[ground]))
pl.ibr.add(pvibr.Shadows())
pl.ibr.add(pvibr.Sky())
pl.camera_position = [(4, -22, 9), (0, 0, 1), (0, 0, 1)]
pl.show(auto_close=False)

# %%
# 2. What a browser would miss, and what is made of it.
print(pl.ibr.web_report('html'))

# %%
# 3. A plotter of plain actors, which `jupyter_backend='client'` shows; `pl.export_html` writes
#    it as a page, and a GLB opens in any viewer.
with tempfile.TemporaryDirectory() as folder:
    pl.ibr.export_glb(Path(folder) / 'scene.glb', triangles=60_000, texture=256)
    print(sum(file.stat().st_size for file in Path(folder).iterdir()), 'bytes')
plain = pl.ibr.to_plain_plotter(triangles=60_000, texture=512)
pl.close()
plain.show()
