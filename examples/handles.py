"""
Handles in the scene
====================

A projector and a light with handles, the plane in focus picked on the scene, a bar for the time:
dragged by mouse or finger, or moved by Tab, arrows, page up and page down.
"""

import numpy as np
import pyvista as pv
from pyvista import examples

import pvibr
from pvibr import animation as anim
from pvibr_widgets import light_handles, pick_focus, projector_handles, time_bar

SIZE = 560

# %%
# 1. A staircase with a ball that floats up and down, twice.
pl = pv.Plotter(shape=(1, 2), window_size=(2 * SIZE, SIZE), lighting='none', border=False)
looks = {'color': 'white', 'ambient': 0.1, 'diffuse': 0.7}
rise = anim.Track(0, 'translation', [0, 2, 4], [[0, 0, 0], [0, 0, 1.2], [0, 0, 0]])
ball = anim.FigureMesh(pv.Sphere(radius=0.45, center=(0.6, -0.6, 1.4)), node=0)
for column in (0, 1):
    pl.subplot(0, column)
    for k in range(6):
        pl.add_mesh(pv.Box((-3, 3, 0.6 * k, 0.6 * (k + 1), -0.1, 0.35 * k)), **looks)
    pl.add_mesh(pv.Box((-3, 3, -3, 0, -0.2, -0.1)), **looks)
    figure = anim.Figure([ball], anim.Skeleton([-1], [np.eye(4)]), [anim.Clip('float', [rise])])
    pl.ibr.add_animated(figure, clip='float')
    pl.camera_position = [(-6, -15, 8), (-0.3, 0.1, 1), (0, 0, 1)]

# %%
# 2. At the left a slide projector and a lamp; while one of its handles is selected, with the
#    frustum that its shadows are found in.
pl.subplot(0, 0)
camera = pv.Camera()
camera.position, camera.focal_point, camera.up = (-0.6, -3.6, 3.0), (0, 1.8, 0.8), (0, 0, 1)
slide = pl.ibr.add(pvibr.Projector(examples.mapfile, camera, mode='modulate'))
lamp = pv.Light(position=(2.2, -1, 4.2), focal_point=(0.6, 0.3, 0.4), light_type='scene light')
lamp.positional, lamp.cone_angle, lamp.intensity = True, 28, 0.8
pl.add_light(lamp, only_active=True)
pl.ibr.add(pvibr.Shadows())
projector_handles(pl, slide)
handles = light_handles(pl, lamp)

# %%
# 3. At the right what one clicks on is in focus; what is behind it is tinted until Escape is
#    pressed. The space bar, or the button, plays.
pl.subplot(0, 1)
pl.add_light(pv.Light(position=(-3, -5, 6), light_type='scene light'), only_active=True)
lens = pl.ibr.add(pvibr.DepthOfField(radius=0.3))
focus = pick_focus(pl, lens)
time_bar(pl, 0, 4).set(1.2)
pl.show(auto_close=False)
handles.focus('position')
focus.pick((1.42 * SIZE, 0.53 * SIZE))
print(f'in focus: {lens.distance:.2f} from the camera')
pl.show()
