"""Arrows along vectors, as long as a scalar says, against PyVista's own glyphs."""

import numpy as np
import pyvista as pv

points = pv.Sphere(theta_resolution=9, phi_resolution=9)
points['length'] = np.linspace(0.2, 1, points.n_points)


def shot(add):
    pl = pv.Plotter(window_size=(300, 200))
    add(pl)
    pl.camera_position = 'xz'
    return pl.screenshot().astype(float)


arrow = pv.Arrow()
kwargs = {'orient': 'Normals', 'scale': 'length', 'factor': 0.3}
theirs = shot(lambda pl: pl.add_mesh(points.glyph(geom=arrow, **kwargs), color='w'))
ours = shot(lambda pl: pl.ibr.add_instances(arrow, points, color='w', **kwargs))
accessor = shot(lambda pl: pl.ibr.add_instances(points.ibr.glyph(geom=arrow, **kwargs), color='w'))

assert np.abs(ours - theirs).mean() < 2
assert np.abs(accessor - theirs).mean() < 2
