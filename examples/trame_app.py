"""
An application in the browser
=============================

A page of trame with a slider for what is in its scene and a switch that lets the time go on:
``python trame_app.py`` opens it, Ctrl+C ends it. It needs ``pip install 'pvibr[jupyter]'``.
"""

import numpy as np
import pyvista as pv
from trame.app import get_server
from trame.ui.vuetify3 import SinglePageLayout
from trame.widgets import vuetify3 as v3
from trame_pyvista.ui import plotter_ui

import pvibr
from pvibr import animation as anim

COUNT = 300
# %%
# 1. A scene as any other: stones around a lamp that rises and sinks.
pl = pv.Plotter(off_screen=True, window_size=(960, 540), lighting='none')
pl.set_background('#101820', top='#2b3a4a')
pl.add_mesh(pv.Disc(inner=0, outer=14, c_res=80), color='#8d99a6')
rng = np.random.default_rng(0)
angle, away = rng.uniform(0, 2 * np.pi, COUNT), rng.uniform(2, 13, COUNT)
places = np.c_[away * np.cos(angle), away * np.sin(angle), np.full(COUNT, 0.25)]
pl.ibr.add_instances(pv.Icosphere(radius=0.3, nsub=2), places, color='#c9b79c')
pl.add_light(pv.Light(position=(8, -6, 9), cone_angle=60, light_type='scene light'))
rise = anim.Track(0, 'translation', [0, 1, 2], [[0, 0, 1], [0, 0, 3], [0, 0, 1]])
lamp, joint = anim.FigureMesh(pv.Sphere(), node=0), anim.Skeleton([-1], [np.eye(4)])
lamp = pvibr.Figure([lamp], joint, [anim.Clip('rise', [rise])])
pl.ibr.add_animated(lamp, clip='rise', color='#ffd166', lighting=False)
pl.ibr.add(pvibr.Shadows())
bloom = pl.ibr.add(pvibr.Bloom(threshold=0.4))
pl.camera_position = [(0, -24, 11), (0, 0, 1), (0, 0, 1)]

# %%
# 2. A page with a slider and a switch over the picture, which is drawn here.
server = get_server(client_type='vue3')
with SinglePageLayout(server) as layout:
    with layout.toolbar:
        v3.VSlider(v_model=('shine', 0.3), min=0, max=1, label='Bloom', hide_details=True)
        v3.VSwitch(v_model=('plays', False), label='Play', hide_details=True)
    with layout.content:
        view = plotter_ui(pl, mode='server', add_menu=False)


# %%
# 3. What changes here is shown once the view is updated; time that goes on does so by itself.
@server.state.change('shine', 'plays')
def follow(shine, plays, **_):
    bloom.intensity = shine
    if plays != pl.ibr.playing:
        pl.ibr.play(loop=2.0) if plays else pl.ibr.stop()
    view.update()


server.start()
pl.close()
