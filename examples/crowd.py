"""
A crowd
=======

Thousands of figures, each at its own time, drawn in one go: near as posed meshes, far as images of
the phases of their clip. While time goes on, nothing is uploaded for the far ones.
"""

import numpy as np
import pyvista as pv

import pvibr  # noqa: F401
from pvibr.scenes.walker import walker

COUNT = 4000

# %%
# 1. A figure: its meshes, a skeleton and clips. `pvibr.read_gltf` reads one from a file.
person = walker(3000)

# %%
# 2. Where they stand and where they look: matrices that take the figure to the world.
rng = np.random.default_rng(3)
angle = rng.uniform(0, 2 * np.pi, COUNT)
away = 4 + 40 * rng.uniform(0, 1, COUNT) ** 0.6
places = np.stack([away * np.cos(angle), away * np.sin(angle), np.zeros(COUNT)], 1)
heading = angle + np.pi
poses = np.tile(np.eye(4), (COUNT, 1, 1))
poses[:, 0, 0], poses[:, 0, 1] = np.cos(heading), -np.sin(heading)
poses[:, 1, 0], poses[:, 1, 1] = np.sin(heading), np.cos(heading)
poses[:, :3, 3] = places

# %%
# 3. The crowd: each has its time, speed, clip and colour.
pl = pv.Plotter(window_size=(1000, 560))
pl.set_background('#cfdde6', top='#f4f7f9')
pl.add_mesh(pv.Disc(center=(0, 0, -0.02), inner=0, outer=50, c_res=90), color='#b9b7a8')
crowd = pl.ibr.add_animated(
    person,
    poses,
    times=rng.uniform(0, 1, COUNT),
    speeds=rng.uniform(0.8, 1.2, COUNT),
    clips=np.where(rng.uniform(size=COUNT) < 0.8, 'Walk', 'Wave').tolist(),
    colors=rng.uniform(0.3, 1, (COUNT, 3)),
    blend='multiply',
    max_error=2.0,
)

# %%
# 4. Any moment of it: the time moves all of them.
pl.camera_position = [(0, -34, 9), (0, 0, 0), (0, 0, 1)]
for second in (0.0, 0.25, 0.5):
    pl.ibr.time = second
    pl.render()
pl.show()
