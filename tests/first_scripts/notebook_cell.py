"""A cell of a notebook that is run twice."""

import pyvista as pv

import pvibr

pl = pv.Plotter()
for _ in range(2):
    pl.ibr.add_instances(pv.Sphere(), [(2.0 * x, 0, 0) for x in range(5)], name='balls')
    pl.ibr.add(pvibr.Bloom())
    pl.ibr.add(pvibr.Shadows())
assert len(pl.ibr) == 3
assert [e.name for e in pl.ibr.effects].count('Bloom') == 1
assert (pl.screenshot() != 255).any()
