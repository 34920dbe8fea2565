"""Ten kinds of things that PyVista draws, each fifty times."""

import numpy as np
import pyvista as pv
from pyvista import examples

places = np.random.default_rng(2).uniform(0, 2000, (50, 3))
wave = pv.ParametricEllipsoid(300, 200, 100)
wave['height'] = wave.points[:, 2]
kinds = {
    'airplane': examples.load_airplane(),
    'grid': examples.load_hexbeam().scale(50, inplace=False),
    'image': pv.ImageData(dimensions=(5, 5, 5), spacing=(50, 50, 50)),
    'blocks': pv.MultiBlock([pv.Sphere(radius=150), pv.Cube(center=(300, 0, 0), x_length=200)]),
    'scalars': wave,
    'tube': pv.Spline(np.random.default_rng(3).uniform(0, 300, (8, 3)), 60).tube(radius=20),
    'actor': pv.Actor(mapper=pv.DataSetMapper(pv.Sphere(radius=150))),
    'textured': pv.Plane(i_size=300, j_size=300),
    'lines': pv.Spline(np.random.default_rng(4).uniform(0, 300, (8, 3)), 60),
    'points': pv.PolyData(np.random.default_rng(5).uniform(0, 300, (90, 3))),
}
for name, mesh in kinds.items():
    pl = pv.Plotter(window_size=(200, 150))
    keys = {'texture': examples.load_globe_texture()} if name == 'textured' else {}
    pl.ibr.add_instances(mesh, places, **keys)
    picture = pl.screenshot()
    assert (picture != picture[0, 0]).any(-1).sum() > 100, name
    if name not in ('lines', 'points'):  # these are of one colour
        assert len(np.unique(picture.reshape(-1, 3), axis=0)) > 3, name
    pl.close()
