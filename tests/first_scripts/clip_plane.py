"""A clipping plane of the mapper cuts instances as it cuts meshes."""

import numpy as np
import pyvista as pv
import vtk

plane = vtk.vtkPlane()
plane.SetOrigin(4.5, 0, 0)
plane.SetNormal(1, 0, 0)


def shot(add):
    pl = pv.Plotter(window_size=(300, 200))
    actor = add(pl)
    actor.mapper.AddClippingPlane(plane)
    pl.camera_position = 'xz'
    return pl.screenshot().astype(float)


ball, places = pv.Sphere(radius=0.4), pv.PolyData([(float(x), 0, 0) for x in range(10)])
meshes = places.glyph(geom=ball, orient=False, scale=False)
theirs = shot(lambda pl: pl.add_mesh(meshes, color='w'))
ours = shot(lambda pl: pl.ibr.add_instances(ball, places, color='w'))
assert np.abs(ours - theirs).mean() < 1
