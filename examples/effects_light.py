"""
Light that spreads, and light that is tamed
===========================================

Bloom, glow, afterglow and tone mapping. From left to right and down: off; bloom; glow of the bar
alone; its afterglow as it moves; three times the light, and the same through a film's curve.
"""

import numpy as np
import pyvista as pv

import pvibr

# %%
# 1. A dim room with two lamps: a white ball and a coloured bar.
pl = pv.Plotter(shape=(2, 3), window_size=(1200, 680), border=False)
bars = []
for k in range(6):
    pl.subplot(*divmod(k, 3))
    pl.set_background('#05070c')
    names = 'off', 'bloom', 'glow', 'afterglow', 'exposure 1.6', 'exposure 1.6, ACES'
    pl.add_text(names[k], font_size=10, color='white')
    pl.add_mesh(pv.Plane(center=(0, 0, -0.5), i_size=6, j_size=6), color='#39424e')
    pl.add_mesh(pv.Sphere(radius=0.35, center=(-0.8, 0, 0)), color='white', ambient=1.0)
    stick = pv.Cylinder(center=(0.7, 0, 0), direction=(0, 0.4, 1), radius=0.12, height=1.2)
    bar = pl.add_mesh(stick, color='orangered', ambient=0.8)
    pl.add_mesh(pv.Cube(center=(0, 0.9, 0), x_length=0.6), color='teal')
    bars.append(bar)
    pl.camera_position = [(0.4, -4.2, 1.5), (0, 0.2, -0.05), (0, 0, 1)]

# %%
# 2. Bloom takes what is bright; glow takes what it is told, whatever its colour.
pl.subplot(0, 1)
pl.ibr.add(pvibr.Bloom(threshold=0.85, intensity=0.8))
pl.subplot(0, 2)
pl.ibr.add(pvibr.Glow([bars[2]], 1.5))

# %%
# 3. A trail: the bar moves, by the time of the animation.
pl.subplot(1, 0)
pl.ibr.add(pvibr.Afterglow([bars[3]], 1.2, fade=0.4))
pl.show(auto_close=False, interactive=False)
for time in np.linspace(0, 0.6, 19):
    pl.ibr.time = time
    bars[3].position = (-1.6 * time, -0.8 * time, 0)
    pl.render()

# %%
# 4. Three times the light: what a display can show stays as it is, or all follows a film's curve.
for column, curve in ((1, 'faithful'), (2, 'aces')):
    pl.subplot(1, column)
    pl.ibr.add(pvibr.ToneMapping(curve=curve, exposure=1.6))
pl.render()
print(pl.ibr.report())
pl.close()
