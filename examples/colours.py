"""
A value for each instance
=========================

A wind farm coloured by the power of each turbine, with a scalar bar. The values change in place;
nothing is baked again.
"""

import numpy as np
import pyvista as pv

import pvibr

COUNT = 1_000
rng = np.random.default_rng(0)

# %%
# 1. A turbine: a tower, a nacelle and three blades, 150 m high.
tower = pv.Cone(center=(0, 0, 55), direction=(0, 0, 1), height=110, radius=4, resolution=24)
nacelle = pv.Box((-3, 7, -2.5, 2.5, 98, 103))
blade = pv.ParametricEllipsoid(0.7, 2, 24).translate((-5, 0, 124))
blades = [blade.rotate_x(angle, point=(0, 0, 100)) for angle in (20, 140, 260)]
turbine = pv.merge([tower, nacelle, *blades])

# %%
# 2. Rows of turbines, 700 m apart, each turned a little differently into the wind.
side = int(np.ceil(np.sqrt(COUNT)))
places = 700.0 * np.stack(np.divmod(np.arange(COUNT), side), 1)
angle = rng.normal(0.3, 0.1, COUNT)
poses = np.tile(np.eye(4), (COUNT, 1, 1))
poses[:, 0, :2] = np.stack([np.cos(angle), -np.sin(angle)], 1)
poses[:, 1, :2] = np.stack([np.sin(angle), np.cos(angle)], 1)
poses[:, :2, 3] = places

# %%
# 3. Colours as ``add_mesh`` gives them; the bar is titled by the name.
power = 8 + 2 * np.sin(places[:, 0] / 4000) + rng.normal(0, 0.5, COUNT)
pl = pv.Plotter(window_size=(960, 540))
farm = pl.ibr.add_instances(
    turbine, poses, scalars=power, cmap='plasma', clim=(0, 12), name='power (MW)',
    scalar_bar_args={'n_labels': 4, 'height': 0.12, 'position_y': 0.03},
)  # fmt: skip
pl.camera_position = [(-330, -560, 210), (5500, 5000, -620), (0, 0, 1)]
look = pl.ibr.look('daylight')
look.effects['Ground'].color, look.effects['Ground'].height = '#6d8fa3', 0.0  # the sea
look.effects['AmbientOcclusion'].radius = 12.0
pl.ibr.add(pvibr.Fog(12_000.0))

# %%
# 4. Each row takes wind from the next, and some turbines are out of service: they are hidden.
farm.scalars = power * 0.96 ** (places[:, 0] / 700)
farm.visible = rng.random(COUNT) > 0.05

# %%
# 5. Single ones can be changed too.
farm.update([0, 1, 2], scalars=0.0)
pl.show()
