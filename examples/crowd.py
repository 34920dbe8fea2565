"""
A crowd
=======

Thousands of figures on a square, each at its own time, drawn in one go: near ones as posed meshes,
far ones as images of the phases of their clip.
"""

import numpy as np
import pyvista as pv

import pvibr
from pvibr.scenes.walker import walker

SIZE = 900
COUNT = 4_000

# %%
# 1. A figure: its meshes, a skeleton and clips. `pvibr.read_gltf` reads one from a file.
person = walker(3000)

# %%
# 2. Where they stand: apart from each other; most walk, some stand and wave.
rng = np.random.default_rng(3)
side = int(np.ceil(np.sqrt(COUNT)))
i, j = np.divmod(np.arange(COUNT), side)
x, y = 1.7 * (np.stack([i, j]) - side / 2) + rng.uniform(-0.55, 0.55, (2, COUNT))
heading = np.where(rng.uniform(size=COUNT) < 0.5, 0.0, np.pi) + rng.normal(0, 0.5, COUNT)
poses = np.tile(np.eye(4), (COUNT, 1, 1))
poses[:, 0, 3], poses[:, 1, 3] = x, y
poses[:, 0, 0], poses[:, 0, 1] = np.cos(heading), -np.sin(heading)
poses[:, 1, 0], poses[:, 1, 1] = np.sin(heading), np.cos(heading)
poses[:, :3, :3] *= rng.uniform(0.9, 1.05, (COUNT, 1, 1))

# %%
# 3. The crowd: each has its time, speed, clip and a pale colour, which tints clothes and skin.
cloth = ('#ffffff', '#f0e6c8', '#c9d6e6', '#e6cdb8', '#b8a596', '#8f7f76', '#d8dcd8', '#c4b4be')
palette = np.array([pv.Color(name).float_rgb for name in cloth])
pl = pv.Plotter(window_size=(16 * SIZE // 9, SIZE))
crowd = pl.ibr.add_animated(
    person,
    poses,
    times=rng.uniform(0, 1, COUNT),
    speeds=rng.uniform(0.8, 1.2, COUNT),
    clips=np.where(rng.uniform(size=COUNT) < 0.85, 'Walk', 'Wave').tolist(),
    colors=palette[rng.integers(0, len(palette), COUNT)],
    blend='multiply',
    max_error=2.0,
)

# %%
# 4. Any moment of it, in a look: the time moves all of them.
pl.camera_position = [(0, -64, 6.0), (0, -34, 0.2), (0, 0, 1)]
pl.camera.view_angle = 32
effects = pl.ibr.look('daylight').effects
effects['AmbientOcclusion'].radius, effects['Shadows'].method = 0.6, 'pcf'
pl.ibr.add(pvibr.Fog(160.0))
pl.ibr.add(pvibr.Accumulation(16))
pl.ibr.time = 0.5
pl.show()
