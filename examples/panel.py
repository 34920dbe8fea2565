"""
A control panel
===============

Beside the picture, a row for each setting of what is in the scene. ``python panel.py`` opens it in
a browser, Ctrl+C ends it; it needs ``pip install 'pvibr[jupyter]'``.
"""

import numpy as np
import pyvista as pv
from pyvista import examples
from trame.app import get_server
from trame.ui.vuetify3 import VAppLayout

import pvibr
from pvibr_widgets import trame_panel

COUNT = 200

# %%
# 1. Balloons above hills.
hills = examples.load_random_hills()
pl = pv.Plotter(off_screen=True, window_size=(800, 540), lighting='none')
pl.add_mesh(hills, color='#7d8f69', smooth_shading=True)
pl.add_light(pv.Light(position=(-20, -25, 40), light_type='scene light', cone_angle=90))
pl.add_light(pv.Light(light_type='headlight', intensity=0.3))
places = hills.points[np.random.default_rng(0).choice(hills.n_points, COUNT)]
pl.ibr.add_spheres(places + np.array([0, 0, 1.5]), 0.3, color='#d9694f', name='balloons')
pl.camera_position = [(-20, -18, 20), (0, 9, 2), (0, 0, 1)]

# %%
# 2. What the panel finds: effects of any kind, and whatever is added later.
pl.ibr.add(pvibr.Sky())
pl.ibr.add(pvibr.Shadows())
pl.ibr.add(pvibr.Vignette())

# %%
# 3. A page with picture and panel. In a notebook ``pvibr_widgets.panel(pl)`` in a cell is all, in
#    a window of Qt it is a dock.
server = get_server(client_type='vue3')
with VAppLayout(server):
    trame_panel(pl, server, picture=True)
server.start()
pl.close()
