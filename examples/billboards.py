"""
Billboards
==========

An image at each point, turned to the eye: bushes that stay upright, smoke that blends, signs of so
many pixels. Each set is one draw.
"""

import numpy as np
import pyvista as pv

import pvibr  # noqa: F401  PyVista finds pl.ibr by itself; this only says where it comes from

COUNT = 600
rng = np.random.default_rng(0)
y, x = np.mgrid[-1:1:128j, -1:1:128j]

# %%
# 1. A bush: leaves with gaps between them, cut out by alpha. Two of them, packed in one texture.
bushes = []
for green in (110, 150):
    alpha = np.zeros_like(x)
    for cx, cy in rng.normal(0, 0.38, (220, 2)):
        alpha = np.maximum(alpha, np.hypot(x - cx, 0.7 * (y - cy)) < 0.07)
    color = (x * 0 + 60, green + 40 * y * -1, x * 0 + 50, 255 * alpha)
    bushes.append(np.stack(color, -1).clip(0, 255).astype(np.uint8))

# %%
# 2. Smoke: a flipbook of soft puffs that fade, blended from far to near.
puffs = []
for step in np.linspace(0, 1, 8):
    soft = np.clip(1 - np.hypot(x, y) / (0.5 + 0.5 * step), 0, 1) ** 0.7
    grey = np.full_like(x, 70 + 90 * step)
    puffs.append(np.stack([grey, grey, grey, 140 * soft * (1 - 0.8 * step)], -1).astype(np.uint8))
turns = np.linspace(0, 1, 40)
smoke = np.c_[np.sin(9 * turns), np.cos(9 * turns), 0 * turns] * turns[:, None]
smoke += np.c_[3 * turns**2, 0 * turns, 1.5 + 7 * turns]

# %%
# 3. All together. ``anchor`` says what of the card stands at the point.
pl = pv.Plotter(window_size=(960, 540))
pl.add_mesh(
    pv.Cone(center=(0, 0, 0.75), direction=(0, 0, 1), height=1.5, radius=1.2), color='sienna'
)
ground = np.c_[rng.uniform(-25, 25, (COUNT, 2)), np.zeros(COUNT)]
pl.ibr.add_billboards(
    ground, bushes, size=rng.uniform(0.8, 2.0, COUNT), facing='cylindrical', anchor='bottom'
)
pl.ibr.add_billboards(
    smoke, puffs, size=0.8 + 2.5 * turns, fps=8, index=(7 * turns).astype(int), cutout=None
)
sign = np.where(np.maximum(abs(x), abs(y)) < 0.8, 1.0, 0.0)[..., None] * [1.0, 0.85, 0.2]
pl.ibr.add_billboards([[0, 0, 10]], sign, size=24, size_unit='pixel')
pl.camera.position, pl.camera.focal_point, pl.camera.up = (0, -24, 6), (0, 0, 3.2), (0, 0, 1)
pl.ibr.look('daylight').effects['Ground'].color = '#8a8a5c'
pl.show(auto_close=False)
print(pl.ibr.report())
pl.close()
