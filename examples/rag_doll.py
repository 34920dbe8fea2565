"""
A rag doll
==========

Whatever simulates bodies can drive a figure: it hands over a matrix per joint. Here this is a
little physics; MuJoCo, PyBullet or OpenSim do it in the same way.
"""

import numpy as np
import pyvista as pv

import pvibr
from pvibr.maths import quaternions

# %%
# 1. Places on the body, of a pair the left one first; a capsule for the bone between two of them.
pairs = [[0.2, 1.45], [0.5, 1.4], [0.8, 1.3], [0.12, 0.95], [0.16, 0.5], [0.18, 0.1]]
middle = [[0, 0, z] for z in (1.0, 1.5, 1.7, 1.85)]
rest = np.array(middle + [[side * x, 0, z] for x, z in pairs for side in (1, -1)])
limbs = [[i, i + 2] for i in (4, 5, 6, 7, 10, 11, 12, 13)]
start, end = np.array([[0, 1], [2, 3], *limbs]).T
long = np.linalg.norm(rest[end] - rest[start], axis=1)
radii = [0.17, 0.13, 0.07, 0.07, 0.06, 0.06, 0.09, 0.09, 0.07, 0.07]
bodies = [
    pvibr.Body(pv.Capsule(center=(d / 2, 0, 0), radius=r, cylinder_length=d), node=i)
    for i, (r, d) in enumerate(zip(radii, long, strict=True))
]
free = pvibr.Skeleton([-1] * len(bodies), pvibr.Pose(rest[start]))
doll = pvibr.Figure(bodies, free)

# %%
# 2. Places keep moving and fall, the ground brakes, and sticks between places keep their lengths.
trunk = [0, 1, 2, 3, 4, 5, 10, 11]
a, b = np.array(limbs + [[a, b] for a in trunk for b in trunk if a < b]).T
length, many = np.linalg.norm(rest[b] - rest[a], axis=1), np.bincount(np.r_[a, b])[:, None]
places, step, moments = rest + np.array([0, 0, 0.9]), 1 / 240, []
before = places - step * (np.cross([0.3, 3, 0.4], rest - rest[0]) + np.array([2.5, 0, 2]))
for _ in range(600):
    places, before = 2 * places - before - [0, 0, 9.81 * step**2], places
    for _ in range(20):
        gap = places[b] - places[a]
        gap *= (1 - length / np.linalg.norm(gap, axis=1))[:, None]
        np.add.at(places, a, gap / many[a])
        np.add.at(places, b, -gap / many[b])
    places[:, 2] = np.maximum(places[:, 2], 0.1)
    before[:, :2] += 0.3 * (places - before)[:, :2] * (places[:, 2:] == 0.1)
    turns = quaternions.between([1, 0, 0], places[end] - places[start])
    moments.append(pvibr.Pose(places[start], turns).matrices())  # figure-from-joint

# %%
# 3. The doll where it lies, and moments of its fall as meshes.
pl = pv.Plotter(window_size=(960, 540))
for i, color in ((0, 'tan'), (100, 'sandybrown'), (200, 'coral')):
    pl.add_mesh(pv.merge(doll.mesh(pose=moments[i])), color=color, smooth_shading=True)
pl.ibr.add_figure(doll, color='firebrick', smooth_shading=True).pose = moments[-1]
pl.add_mesh(pv.Plane(center=(2.5, 0, 0), i_size=9, j_size=4), color='whitesmoke')
pl.camera_position = [(2.4, -8, 3), (2.4, 0, 1.2), (0, 0, 1)]
pl.show(auto_close=False)
pl.close()
