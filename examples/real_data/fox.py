"""
A fox that walks and runs
=========================

The fox of the Khronos glTF sample assets (CC0; movements CC-BY 4.0, see the data): two of
its clips in step, so that each paw keeps its turn.
"""

from pathlib import Path

import pyvista as pv

import pvibr

FILE = Path('../shared/data/gltf/Fox.glb')

# %%
# 1. The fox as the file has it; its y axis becomes our z axis.
fox = pvibr.read_gltf(FILE, up='z')
print(fox)

# %%
# 2. From a walk to a run within a second; both stay in step.
gait = pvibr.animation.SyncedClips(fox, ['Walk', 'Run'], [1, 0])
gait.go([0, 1], at=1.0, fade=1.0)

# %%
# 3. A window in which it plays; also without one, eight moments side by side.
pl = pv.Plotter(window_size=(1280, 720))
for k in range(8):
    actor = pl.ibr.add_animated(fox)
    actor.driver = gait if k == 0 else pvibr.animation.PoseSource(gait.sample(0.4 * k))
    actor.user_matrix = pv.Transform().translate(110 * (k % 4), 0, -120 * (k // 4)).matrix
pl.camera_position = [(370, -560, 110), (165, 0, -20), (0, 0, 1)]
pl.ibr.play()
pl.show()
