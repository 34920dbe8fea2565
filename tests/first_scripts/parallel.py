"""Parallel projection, against the meshes."""

import numpy as np
import pyvista as pv


def shot(add):
    pl = pv.Plotter(window_size=(300, 200))
    add(pl)
    pl.enable_parallel_projection()
    pl.view_isometric()
    return pl.screenshot().astype(float)


bean = pv.ParametricEllipsoid(1, 0.6, 0.4)
places = pv.PolyData(np.random.default_rng(0).uniform(0, 30, (60, 3)))
meshes = places.glyph(geom=bean, orient=False, scale=False)
theirs = shot(lambda pl: pl.add_mesh(meshes, color='gold'))
ours = shot(lambda pl: pl.ibr.add_instances(bean, places, color='gold'))
assert np.abs(ours - theirs).mean() < 1
