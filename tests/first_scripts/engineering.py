"""An orthographic engineering view with edges."""

import numpy as np
import pyvista as pv


def shot(add):
    pl = pv.Plotter(window_size=(300, 200))
    add(pl)
    pl.enable_parallel_projection()
    pl.view_xz()
    return pl.screenshot().astype(float)


bolt = pv.Cylinder(resolution=6, height=2)
places = pv.PolyData([(2.0 * x, 0, 2.0 * z) for x in range(4) for z in range(3)])
meshes = places.glyph(geom=bolt, orient=False, scale=False)
theirs = shot(lambda pl: pl.add_mesh(meshes, color='w', show_edges=True))
ours = shot(lambda pl: pl.ibr.add_instances(bolt, places, color='w', show_edges=True))
assert np.abs(ours - theirs).mean() < 1
