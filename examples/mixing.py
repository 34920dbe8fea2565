"""
Running and looking up
======================

Two movements at once: the legs run while neck and head look up, by a mask of joints.
"""

import numpy as np
import pyvista as pv

from pvibr import animation as anim
from pvibr.maths import quaternions

# %%
# 1. An ostrich of capsules, one on each joint; x is forward, z up.
JOINTS = {  # parent, place, end of its bone, thickness, colour
    'body': (None, (0, 0, 2), (-0.7, 0, 0.1), 0.5, 'saddlebrown'),
    'neck': ('body', (0.35, 0, 0.2), (0.3, 0, 1.3), 0.14, 'bisque'),
    'head': ('neck', (0.3, 0, 1.3), (0.4, 0, 0.05), 0.17, 'bisque'),
}
for side, y in (('left', 0.3), ('right', -0.3)):
    JOINTS[f'{side} thigh'] = ('body', (-0.2, y, -0.3), (0.25, 0, -0.6), 0.2, 'bisque')
    JOINTS[f'{side} shin'] = (f'{side} thigh', (0.25, 0, -0.6), (-0.35, 0, -0.75), 0.09, 'tan')
    JOINTS[f'{side} foot'] = (f'{side} shin', (-0.35, 0, -0.75), (0.35, 0, -0.25), 0.07, 'gray')
names, bodies = list(JOINTS), []
for joint, (_, _, bone, radius, color) in enumerate(JOINTS.values()):
    along = {'center': np.array(bone) / 2, 'direction': bone, 'radius': radius}
    mesh = pv.Capsule(**along, cylinder_length=np.linalg.norm(bone)).triangulate()
    bodies.append(anim.FigureMesh(mesh, joint, look={'color': color}))
parents = [names.index(parent) if parent else -1 for parent, *_ in JOINTS.values()]
skeleton = anim.Skeleton(parents, anim.Pose([row[1] for row in JOINTS.values()]), names)


def turning(joint, seconds, degrees):
    turns = quaternions.from_axis_angle([[0, 1, 0]] * len(degrees), np.radians(degrees))
    return anim.Track(names.index(joint), 'rotation', np.linspace(0, seconds, len(turns)), turns)


# %%
# 2. Two clips. Legs run half a round apart.
run = [turning('neck', 0.6, [8, 16, 8, 16, 8]), turning('head', 0.6, [0, -8, 0, -8, 0])]
legs = {'thigh': [-45, -5, 45, 0], 'shin': [10, 30, 60, 95], 'foot': [-10, -30, 25, -40]}
for part, angles in legs.items():
    for side, turn in (('left', [0, 1, 2, 3, 0]), ('right', [2, 3, 0, 1, 2])):
        run.append(turning(f'{side} {part}', 0.6, np.take(angles, turn)))
look = anim.Clip('look up', [turning('neck', 2, [-30, -40, -30]), turning('head', 2, [-60] * 3)])
ostrich = anim.Figure(bodies, skeleton, [anim.Clip('run', run), look])

# %%
# 3. It looks up from a second on: a layer over the run, for the neck and what hangs on it.
layer = anim.AnimationLayer(anim.ClipSource(ostrich, 1), 0.0, anim.joint_mask(skeleton, ['neck']))
layer.weight.go(1.0, at=1.0, fade=0.6)
pl, times = pv.Plotter(window_size=(1200, 400)), [0.45, 0.9, 1.3, 1.75, 2.2]
for k, time in enumerate(times):
    bird = pl.ibr.add_animated(ostrich, smooth_shading=True)
    bird.pose = anim.Mixer(anim.ClipSource(ostrich, 'run'), layer).sample(time)
    bird.user_matrix = pv.Transform().translate(3 * k, 0, 0).matrix
pl.camera_position = [(6, -13, 2.6), (6, 0, 2.1), (0, 0, 1)]
pl.ibr.look('studio')
pl.show()
