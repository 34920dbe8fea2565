"""PyVista's enable_shadows, and Shadows after it: one warning, one of them."""

import warnings

import pyvista as pv

import pvibr

pl = pv.Plotter(lighting='none')
pl.add_light(pv.Light(position=(5, 3, 9), light_type='scene light'))
pl.add_mesh(pv.Plane(i_size=20, j_size=20))
pl.ibr.add_instances(pv.Sphere(), [(2.0 * x - 4, 0, 1) for x in range(5)], color='red')
with warnings.catch_warnings(record=True) as said:
    warnings.simplefilter('always')
    pl.enable_shadows()
    pl.ibr.add(pvibr.Shadows())
    picture = pl.screenshot()
assert len(said) == 1
assert (picture != picture[0, 0]).any()
