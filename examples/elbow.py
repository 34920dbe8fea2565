"""
An elbow, blended in three ways
===============================

Linear blending lets an elbow that bends and twists collapse. Dual quaternions keep its thickness,
and sculpted shapes, added as a pose comes near theirs, give it what bones alone do not.
"""

import numpy as np
import pyvista as pv

import pvibr
from pvibr.maths import quaternions

# %%
# 1. An upper arm and a forearm of two units each; between them both joints pull.
line = pv.Line((0, 0, 0), (4, 0, 0), resolution=64)
line['radius'] = 0.6 - 0.06 * line.points[:, 0]  # thinner toward the wrist
arm = line.tube(scalars='radius', absolute=True, n_sides=48, capping=False).triangulate()
share = np.clip((x := arm.points[:, 0]) - 1.5, 0, 1)
parts = {
    'weights': np.stack([1 - share, share], 1),
    'parents': [-1, 0],
    'rest': pvibr.animation.Pose([[0, 0, 0], [2, 0, 0]]),
}
plain = pvibr.Figure.from_arrays(arm.points, arm.regular_faces, **parts)


def bent(part):
    bend = quaternions.from_axis_angle([0, 0, 1], np.radians(95.0 * part))
    twist = quaternions.from_axis_angle([1, 0, 0], np.radians(130.0 * part))
    turns = [[1, 0, 0, 0], quaternions.multiply(bend, twist)]
    return pvibr.animation.Pose([[0, 0, 0], [2, 0, 0]], turns)


# %%
# 2. Three key poses with a biceps that swells; what a sculptor would give them from a mesh editor.
keys, shapes = [0.4, 0.7, 1.0], []
swell = np.exp(-(((x - 1.1) / 0.45) ** 2)) * np.clip(arm.point_normals[:, 1], 0, 1)
for part in keys:
    points, normals = plain.posed(0, bent(part), 'dual')
    shapes.append(points + 0.35 * part * swell[:, None] * normals)
turns = np.stack([bent(part).rotation for part in keys])
poses = pvibr.animation.Pose(np.stack([bent(1).translation] * 3), turns)
sculpted = pvibr.Figure(plain.meshes, plain.skeleton)
sculpted.correctives = pvibr.animation.Correctives.from_sculpted(plain, [1], poses, shapes)

# %%
# 3. One below the other, at moments between the keys and at the last of them.
pl = pv.Plotter(window_size=(960, 720))
ways = [(plain, 'linear', 'tan'), (plain, 'dual', 'skyblue'), (sculpted, 'linear', 'salmon')]
for row, (figure, how, color) in enumerate(ways):
    for column, part in enumerate((0.25, 0.5, 0.75, 1.0)):
        actor = pl.ibr.add_animated(figure, skinning=how, color=color, smooth_shading=True)
        actor.pose = bent(part)
        actor.user_matrix = pv.Transform().translate(4.2 * column, -3.4 * row, 0).matrix
pl.camera_position = [(7.7, -2.6, 24), (7.7, -2.6, 0), (0, 1, 0)]
pl.ibr.look('paper', ground=False)
pl.add_text('linear blending, dual quaternions, sculpted shapes', font_size=10)
pl.show()
