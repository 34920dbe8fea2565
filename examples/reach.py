"""
An arm that reaches
===================

Inverse kinematics: a trunk of thirteen joints follows a ball, and none bends more than it may.
"""

import numpy as np
import pyvista as pv

import pvibr

# %%
# 1. The trunk: a tube that tapers, a joint per unit of its height, and two joints per vertex.
JOINTS, TIP = 13, 'joint12'
z = np.linspace(0, JOINTS - 1, 8 * JOINTS)
path = pv.MultipleLines(np.stack([0 * z, 0 * z, z], 1))
path['radius'] = 0.8 - 0.6 * z / z[-1]
tube = path.tube(scalars='radius', absolute=True, n_sides=32).triangulate()
joint = np.clip(np.rint(tube.points[:, 2]), 0, JOINTS - 2).astype(int)
share = np.clip(tube.points[:, 2] - joint + 0.5, 0, 1)
figure = pvibr.Figure.from_arrays(
    tube.points,
    tube.regular_faces,
    joints=np.stack([np.maximum(joint - 1, 0), joint], 1),
    weights=np.stack([1 - share, share], 1),
    parents=np.arange(JOINTS) - 1,
    rest=pvibr.animation.Pose([[0, 0, 0]] + [[0, 0, 1]] * (JOINTS - 1)),
)

# %%
# 2. The rig: each joint swings half a radian at most.
limit = pvibr.animation.JointLimit(axis=[0, 0, 1], swing=0.5, twist=(-0.2, 0.2))
rig = pvibr.animation.Rig(
    figure.skeleton, [pvibr.animation.InverseKinematics(TIP)], dict.fromkeys(range(JOINTS), limit)
)


def ball(time):
    return np.array([6 * np.cos(time), 6 * np.sin(time), 5 + 3 * np.sin(2 * time)])


moving = rig.on(figure.rest, lambda time: {TIP: ball(time)})

# %%
# 3. Some moments as meshes, and the last one as a figure that goes on.
times = np.linspace(0.2, 2.4, 4)
pl = pv.Plotter(window_size=(960, 640))
for time, opacity in zip(times, (0.15, 0.3, 0.5), strict=False):
    pl.add_mesh(figure.mesh(pose=moving.sample(time)), color='lightseagreen', opacity=opacity)
    pl.add_mesh(pv.Sphere(radius=0.35, center=ball(time)), color='gold', opacity=opacity)
pl.ibr.add_animated(figure, color='lightseagreen', smooth_shading=True).driver = moving
pl.add_mesh(pv.Sphere(radius=0.35, center=ball(times[-1])), color='gold')
way = pv.MultipleLines([ball(time) for time in np.linspace(0, 2 * np.pi, 100)])
pl.add_mesh(way, color='gray', line_width=2)
pl.camera_position = [(10, -20, 14), (0, 0, 4.5), (0, 0, 1)]
pl.ibr.look('studio')
pl.ibr.time = times[-1]
pl.show(auto_close=False)
pl.close()
