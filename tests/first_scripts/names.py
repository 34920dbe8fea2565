"""A name replaces what had it."""

import pyvista as pv

places = [(2.0 * x, 0, 0) for x in range(5)]
pl = pv.Plotter()
pl.ibr.add_instances(pv.Sphere(), places, color='red', name='things')
first = pl.screenshot()
pl.ibr.add_instances(pv.Cube(), places, color='blue', name='things')
pl.render()
assert (pl.screenshot() != first).any()
pl.ibr.add_instances(pv.Sphere(), places, color='red', name='things')
assert len(pl.actors) == 1
assert len(pl.ibr) == 1
pl.render()
assert (pl.screenshot() == first).all()
pl.add_mesh(pv.Cone(), name='things')
assert len(pl.ibr) == 0
