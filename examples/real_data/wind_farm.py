"""
Horns Rev
=========

The 80 turbines of Horns Rev 1 at their real places: metres in UTM zone 32, six million metres from
the origin, which is where single precision would begin to shake.
"""

from pathlib import Path

import numpy as np
import pyvista as pv

FILE = Path('../shared/data/instances/wind/wind_farms.csv')

# %%
# 1. A turbine of 70 m with a rotor of 80 m.
tower = pv.Cone(center=(0, 0, 35), direction=(0, 0, 1), height=70, radius=3, resolution=60)
blade = pv.ParametricEllipsoid(0.6, 2, 20, u_res=60, v_res=60).translate((-4, 0, 90))
blades = [blade.rotate_x(angle, point=(0, 0, 70)) for angle in (20, 140, 260)]
turbine = pv.merge([tower, pv.Box((-5, 5, -2, 2, 68, 72)).triangulate(), *blades])

# %%
# 2. Where they stand.
rows = [line.split(',') for line in FILE.read_text().splitlines()]
places = np.array([[float(r[1]), float(r[2]), 0.0] for r in rows if r[0] == 'HornsRev1'])

# %%
# 3. Sea and turbines, from the north west.
pl = pv.Plotter(window_size=(1280, 720))
pl.background_color = 'aliceblue'
center = places.mean(0)
pl.add_mesh(pv.Plane(center=center, i_size=2e4, j_size=2e4), color='steelblue', lighting=False)
farm = pl.ibr.add_instances(turbine, places, color='white', name='Horns Rev 1')
pl.camera_position = [places[0] + (-700, 600, 260), center, (0, 0, 1)]
pl.show()
