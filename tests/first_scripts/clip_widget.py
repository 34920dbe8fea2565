"""The widget that clips takes a handle, or says why not."""

import pyvista as pv

pl = pv.Plotter()
balls = pl.ibr.add_instances(pv.Sphere(), [(x, 0, 0) for x in range(10)])
try:
    pl.add_mesh_clip_plane(balls)
except TypeError as error:
    assert 'clipping' in str(error) or 'Instances' in str(error)
picture = pl.screenshot()
assert (picture != picture[0, 0]).any()
