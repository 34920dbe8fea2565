"""Translucent spheres with depth peeling."""

import numpy as np
import pyvista as pv

places = np.random.default_rng(0).uniform(0, 3, (20, 3))
pl = pv.Plotter(window_size=(300, 200))
pl.enable_depth_peeling(20)
balls = pl.ibr.add_spheres(places, radius=0.5, color='red', opacity=0.4)
ours = pl.screenshot().astype(float)
other = pv.Plotter(window_size=(300, 200))
other.enable_depth_peeling(20)
ball = pv.Sphere(theta_resolution=60, phi_resolution=60)
other.add_mesh(
    pv.PolyData(places).glyph(geom=ball, orient=False, scale=False),
    color='red',
    opacity=0.4,
    smooth_shading=True,
    culling='back',
)  # spheres are one layer
other.camera = pl.camera
theirs = other.screenshot().astype(float)
assert np.abs(ours - theirs).mean() < 3
