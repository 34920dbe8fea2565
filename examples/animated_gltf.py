"""
A lamp that hops
================

glTF files keep movements. This one is made here, read back, shown at some moments and filmed.
"""

import tempfile
from pathlib import Path

import numpy as np
import pyvista as pv

from pvibr import animation as anim
from pvibr.maths import quaternions

# %%
# 1. A desk lamp: a foot, two bars and a shade with its bulb, each on a joint.
foot = pv.Cylinder(center=(0, 0.1, 0), direction=(0, 1, 0), radius=0.9, height=0.2)
bar = pv.Capsule(center=(0, 0.8, 0), direction=(0, 1, 0), radius=0.1, cylinder_length=1.5)
shade = pv.Cone(center=(0, 0, 0.4), direction=(0, 0, -1), radius=0.8, height=1.2, resolution=48)
parts = [(foot, 0, 'teal'), (bar, 1, 'silver'), (bar, 2, 'silver'), (shade, 3, 'teal')]
bodies = []
for mesh, joint, color in [*parts, (pv.Sphere(radius=0.45, center=(0, 0, 0.95)), 3, 'gold')]:
    mesh = mesh.triangulate().compute_normals(split_vertices=True)
    bodies.append(anim.FigureMesh(mesh, joint, look={'color': color}))
chain = anim.Skeleton([-1, 0, 1, 2], anim.Pose([[0, 0, 0], [0, 0.2, 0], *[[0, 1.6, 0]] * 2]))

# %%
# 2. Its hop: it crouches, jumps and lands. Angles are in degrees.
times = [0, 0.4, 0.6, 0.85, 1.1, 1.5]
way = np.transpose([[0] * 6, [0, 0, 0.4, 1.5, 0, 0], [0, 0, 0.4, 1.3, 2, 2]])
angles = [-35, -62, -10, -35, -60, -35], [75, 125, 25, 75, 120, 75], [-20, -45, -5, -20, -40, -20]
tracks = [anim.Track(0, 'translation', times, way)]
for joint, degrees in enumerate(angles, 1):
    turns = quaternions.from_axis_angle([[1, 0, 0]] * 6, np.radians(degrees))
    tracks.append(anim.Track(joint, 'rotation', times, turns))

# %%
# 3. A file, which any program for glTF shows as well: ``pvibr play lamp.glb`` is one.
folder = tempfile.TemporaryDirectory()
file, movie = (Path(folder.name) / name for name in ('lamp.glb', 'lamps.gif'))
anim.Figure(bodies, chain, [anim.Clip('hop', tracks)]).save(file)

# %%
# 4. Five lamps, each ahead of the one before, as a movie: each frame is later by its share.
pl = pv.Plotter(window_size=(960, 400))
for k in range(5):
    lamp = pl.ibr.add_animated(file, smooth_shading=True)
    lamp.play('hop', start=-0.22 * k)
    lamp.user_matrix = pv.Transform().translate(0, 0, 3.2 * k).matrix
pl.camera_position = [(19, 6, 9), (0, 1.9, 7.6), (0, 1, 0)]
pl.ibr.look('studio')
pl.open_gif(movie, fps=10)
pl.ibr.play()
for _ in range(5):
    pl.write_frame()
pl.mwriter.close()  # from here on a window goes on by itself
pl.show()
folder.cleanup()
