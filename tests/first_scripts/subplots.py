"""Linked subplots: instances on the left, their meshes on the right."""

import numpy as np
import pyvista as pv

bean = pv.ParametricEllipsoid(1, 0.6, 0.4)
places = pv.PolyData(np.random.default_rng(0).uniform(0, 20, (60, 3)))
pl = pv.Plotter(shape=(1, 2), window_size=(600, 300), border=False)
pl.ibr.add_instances(bean, places, color='gold')
pl.subplot(0, 1)
pl.add_mesh(places.glyph(geom=bean, orient=False, scale=False), color='gold')
pl.link_views()
pl.camera_position = 'iso'
picture = pl.screenshot().astype(float)
assert np.abs(picture[:, :300] - picture[:, 300:]).mean() < 2
