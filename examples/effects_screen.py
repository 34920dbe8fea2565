"""
What screens do
===============

Skies behind the scene, and what is laid over the picture: vignette, iris, night vision, a title.
"""

import numpy as np
import pyvista as pv
from pyvista import examples

import pvibr

# %%
# 1. The same hills, six times.
hills = examples.load_random_hills().elevation()
pl = pv.Plotter(shape=(2, 3), window_size=(1200, 680), border=False)
for k in range(6):
    pl.subplot(*divmod(k, 3))
    pl.set_background('#3a3f47')
    names = 'off', 'sky', 'vignette', 'iris', 'night vision', 'image'
    pl.add_text(names[k], font_size=10, color='white', shadow=True)
    pl.add_mesh(hills, cmap='gist_earth', show_scalar_bar=False, smooth_shading=True)
    pl.camera_position = [(-12, -13, 8), (0, 8, 4.5), (0, 0, 1)]

# %%
# 2. A sky that turns with the camera.
pl.subplot(0, 1)
pl.ibr.add(pvibr.Sky())

# %%
# 3. A vignette; an iris of any shape, here a star drawn as an array.
pl.subplot(0, 2)
pl.ibr.add(pvibr.Sky())
pl.ibr.add(pvibr.Vignette(intensity=0.9, radius=0.3))
pl.subplot(1, 0)
y, x = np.mgrid[-1:1:512j, -1:1:512j]
star = np.hypot(x, y) < 0.45 + 0.2 * np.cos(5 * np.arctan2(x, -y))
pl.ibr.add(pvibr.Iris(star, opening=0.2, color=(0.55, 0.1, 0.15)))

# %%
# 4. Night vision, its grain changes by ``pl.ibr.time``; and an image over the picture.
pl.subplot(1, 1)
pl.ibr.add(pvibr.NightVision(gain=3))
pl.subplot(1, 2)
pl.ibr.add(pvibr.ImageOverlay(examples.logofile, place=(0.55, 0.05, 0.97, 0.35), opacity=0.9))
pl.show(auto_close=False)
print(pl.ibr.report())
pl.close()
