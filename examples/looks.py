"""
Looks
=====

Sky, sun, ground, shadows, ambient occlusion and tone in one call.
"""

import pyvista as pv
from pyvista import examples

import pvibr

SIZE = 360

# %%
# 1. An ant that comes with PyVista, made round, with its feet on the ground.
ant = pv.read(examples.antfile).clean().subdivide(3, 'loop').rotate_x(90)

# %%
# 2. The same plotter four times.
pl = pv.Plotter(shape=(2, 2), window_size=(16 * SIZE // 9 * 2, 2 * SIZE), border=False)
for k, name in enumerate(('studio', 'daylight', 'dusk', 'paper')):
    pl.subplot(k // 2, k % 2)
    pl.add_mesh(ant, color='sienna', smooth_shading=True, specular=0.5, specular_power=30)
    pl.camera_position = [(30, -62, 17), (1, 0, 1), (0, 0, 1)]
    pl.camera.view_angle = 26
    pl.ibr.look(name)

# %%
# 3. What a look consists of can be changed.
shadows = next(effect for effect in pl.ibr.effects if isinstance(effect, pvibr.Shadows))
shadows.strength = 0.7
pl.show(auto_close=False)
print(pl.ibr.report())
pl.close()
